"""What every core model can do: two independent parts, coarse and fine, sampled apart and in pieces of any length.

References
----------
.. [1] N. Neis, J. Beyerer, "A two-level stochastic model for the lateral movement of vehicles within their lane", IEEE
       ITSC 2023, pp. 1896-1903, arXiv:2405.17080: the split into both parts.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar, Protocol

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.records import Record, kebab


@dataclass(frozen=True, slots=True)
class Start:
    """Where sampled drives begin: ``mean + spread * (coarse - mean) + fine * fine part`` is `rel_offset` at first.

    In lane widths, positive left, one for all or of shape (drivers,); factors are the effects' at that moment. [-]
    """

    rel_offset: float | FloatArray
    spread: float = 1.0
    fine: float = 1.0


class CoreStream(Protocol):
    """One driver on one drive, or several at once. Two calls for n and m steps give what one call for n + m gives.

    A stream can be copied (`copy.deepcopy`) to come back to a state.
    """

    state: Any
    """All that changes while driving, a msgspec struct; `CoreModel.resume` goes on from it."""

    @property
    def mean(self) -> FloatArray | float:
        """What each driver's coarse part moves about, shape (drivers,), or a number for a single one. [-]"""
        ...

    def take(self, n: int, rate: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Next n values of the coarse and of the fine part, shape (n, drivers), or (n,) for a single driver.

        In lane widths, positive left. `rate` of the coarse part's mean reversion at each step, shape (n,), > 0 [-].
        """
        ...


class CoreModel(Record, frozen=True, tag_field="kind", tag=kebab, eq=False):
    """Parameters of a core model: frozen, numbers only. A new one subclasses this and is listed in `registry`."""

    kind: ClassVar[str]
    """Name in the profile file: the class's without `Model`, in lower case with hyphens."""

    State: ClassVar[type]
    """Type of its streams' state."""

    fine_scales_with_lane: ClassVar[bool] = True
    """Whether its fine part is a share of the lane's width, or as large in any lane."""

    def __init_subclass__(cls, **settings: Any) -> None:
        super().__init_subclass__(**settings)
        cls.kind = kebab(cls.__name__)

    @property
    def step(self) -> float:
        """Between two samples. [s]"""
        raise NotImplementedError

    @property
    def mean(self) -> float:
        """Mean offset over all drivers that the model stands for. [-]"""
        raise NotImplementedError

    @abstractmethod
    def stream(
        self, seed: np.random.SeedSequence, start: Start | None = None, *, drivers: int | None = None
    ) -> CoreStream:
        """Begin a drive; without `start` as chance has it.

        Or so many drives of as many `drivers` at once: arrays then have an axis of drivers. One driver gives the
        numbers that a drive by itself gives; of several, each has others, from the same sources of chance.
        """

    @abstractmethod
    def resume(self, state: Any) -> CoreStream:
        """Go on from a stream's state (which is not copied)."""


class ModelKind(StrEnum):
    """Core models of this package; `registry` knows those of plug-ins too, and older names."""

    TWO_LEVEL = "two-level"
    """The paper's, to the letter."""
    AUTOREGRESSIVE = "autoregressive"
    """Ours."""
