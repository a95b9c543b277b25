"""What every core model can do: two independent parts, coarse and fine, sampled apart and in pieces of any length."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Start:
    """Where a sampled drive begins.

    Parameters
    ----------
    rel_offset : float
        First value of ``mean + spread * (coarse - mean) + fine * fine part``, in lane widths, positive left. [-]
    spread, fine : float
        The effects' factors on both parts at that moment. [-]
    """

    rel_offset: float
    spread: float = 1.0
    fine: float = 1.0


class CoreStream(Protocol):
    """One driver on one drive. Keeps its state: two calls for n and m steps give what one call for n + m gives.

    A stream can be copied (`copy.deepcopy`) and pickled to come back to a state.
    """

    @property
    def mean(self) -> float:
        """What this driver's coarse part moves about. [-]"""
        ...

    def take(self, n: int, rate: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Next n values of the coarse and of the fine part.

        Parameters
        ----------
        n : int
            Steps to take.
        rate : array, shape (n,), optional
            Pace of the coarse part at each step, > 0; 1 where absent. [-]

        Returns
        -------
        coarse, fine : array, shape (n,)
            In lane widths, positive left. [-]
        """
        ...


class CoreModel(Protocol):
    """Parameters of a core model: frozen, numbers only."""

    kind: ClassVar[str]
    """Name in the profile file."""

    @property
    def step(self) -> float:
        """Between two samples. [s]"""
        ...

    @property
    def mean(self) -> float:
        """Mean offset over all drivers that the model stands for. [-]"""
        ...

    def stream(self, seed: np.random.SeedSequence, start: Start | None = None) -> CoreStream:
        """Begin a drive; without `start` as chance has it."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        ...

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Back from `to_dict`; `DriverProfileError` when the values contradict each other."""
        ...
