"""What all effects without a column share: numbers in, numbers out, and their check."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.running import RunningTerms
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class HiddenEffect(ABC):
    """An effect of time or of chance alone; its fields are finite numbers.

    Raises
    ------
    DriverProfileError
        If a field is not finite, or one in `positive` is not above 0.
    """

    kind: ClassVar[str]
    positive: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        """Validate once."""
        for item in fields(self):
            value = float(getattr(self, item.name))
            object.__setattr__(self, item.name, value)
            if not np.isfinite(value) or (item.name in self.positive and value <= 0):
                raise DriverProfileError(f"effect {self.kind}: {item.name} = {value}")

    @property
    def columns(self) -> tuple[str, ...]:
        """None: hidden."""
        return ()

    @abstractmethod
    def terms(self, time: FloatArray, context: Mapping[str, FloatArray], rng: np.random.Generator) -> EffectTerms:
        """Evaluate on a uniform time grid; see `Effect.terms`."""

    def running(self, rng: np.random.Generator) -> RunningTerms:
        """Begin a drive of unknown length. This one is for effects that depend on nothing but the time."""
        return _ByTime(self, rng)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"kind": self.kind, **asdict(self)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Read back what `to_dict` gave."""
        try:
            return cls(**{name: value for name, value in data.items() if name != "kind"})
        except (TypeError, ValueError) as error:
            raise DriverProfileError(f"effect {cls.kind}: {error}") from error


class _ByTime:
    """Terms of an effect that is a plain function of time."""

    def __init__(self, effect: HiddenEffect, rng: np.random.Generator) -> None:
        self._effect, self._rng = effect, rng

    def take(self, time: FloatArray) -> EffectTerms:
        return self._effect.terms(time, {}, self._rng)
