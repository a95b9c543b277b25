"""What all effects without a column share: numbers in, numbers out, and a state that goes on block by block."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import Effect, EffectTerms, step_of
from xosc_lateral.driver.records import set_once
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


class NoState(msgspec.Struct):
    """Of an effect that is a plain function of time."""


class HiddenEffect(Effect, frozen=True, kw_only=True):
    """An effect of time or of chance alone; its fields are finite numbers.

    A new one says how its state begins and goes on; a plain function of time needs
    nothing but `advance`.

    Raises `DriverProfileError` if a field is not finite, or one in `positive` is not above 0.
    """

    positive: ClassVar[tuple[str, ...]] = ()
    """Fields that must be above 0."""

    State: ClassVar[type[msgspec.Struct]] = NoState
    """Type of the state: a msgspec struct of numbers, arrays and generators."""

    def __post_init__(self) -> None:
        """Validate once."""
        for name in self.__struct_fields__:
            value = float(getattr(self, name))
            set_once(self, **{name: value})
            if not np.isfinite(value) or (name in self.positive and value <= 0):
                raise DriverProfileError(f"effect {self.kind}: {name} = {value}")

    @property
    def columns(self) -> tuple[str, ...]:
        """None: hidden."""
        return ()

    def begin(self, rng: np.random.Generator, step: float) -> Any:
        """State at the start of a drive of the given step [s]; the effect's terms will have shape (n,)."""
        return NoState()

    @abstractmethod
    def advance(self, state: Any, time: FloatArray, step: float) -> EffectTerms:
        """Terms at the next rows of an even grid, which go on where those of the last call ended.

        Parameters
        ----------
        state : State
            Goes on.
        time : array, shape (n,), n >= 1
            In the drive's clock. [s]
        step : float
            Of the grid. [s]
        """

    def terms(self, time: FloatArray, context: Mapping[str, FloatArray], rng: np.random.Generator) -> EffectTerms:
        """Evaluate on a whole drive, even grid [s] of shape (n,); see `Effect.terms`."""
        if not len(time):
            return EffectTerms()
        step = step_of(time)
        return self.advance(self.begin(rng, step), time, step)
