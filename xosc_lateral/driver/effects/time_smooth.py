"""A smooth function of time: a driver who learns or tires, a camera that warms up.

Half cosines over the fitted time [1]_, those of the mean and of the logarithm of the spread each with their own sizes.

References
----------
.. [1] U. K. Müller, M. W. Watson, "Testing models of low-frequency variability", Econometrica 76, 2008.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.hidden import HiddenEffect, NoState
from xosc_lateral.driver.records import set_once
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


class TimeSmooth(HiddenEffect, frozen=True, kw_only=True):
    """Mean, spread and fine noise change with time as they did; before and after the fitted time the outermost value
    holds.

    Parameters
    ----------
    location, location_errors : tuple of float
        Size of the k-th half cosine of the mean offset and its standard error, k = 1, 2, ... [m]
    spread, spread_errors, fine : tuple of float
        The same of the natural logarithm of the spread, and of the fine noise.
    from_s, to_s : float
        Time that it was fitted on, in the drive's clock. [s]
    """

    location: tuple[float, ...] = ()
    location_errors: tuple[float, ...] = ()
    spread: tuple[float, ...] = ()
    spread_errors: tuple[float, ...] = ()
    fine: tuple[float, ...] = ()
    from_s: float = 0.0
    to_s: float = 3600.0

    def __post_init__(self) -> None:
        """Validate once."""
        names = ("location", "location_errors", "spread", "spread_errors", "fine")
        values = {name: tuple(map(float, getattr(self, name))) for name in names}
        set_once(self, from_s=float(self.from_s), to_s=float(self.to_s), **values)
        if not np.isfinite([self.from_s, self.to_s, *(one for own in values.values() for one in own)]).all():
            raise DriverProfileError(f"effect {self.kind}: a number is not finite")
        if self.to_s <= self.from_s:
            raise DriverProfileError(f"effect {self.kind}: to_s = {self.to_s} is not after from_s = {self.from_s}")

    def advance(self, state: NoState, time: FloatArray, step: float) -> EffectTerms:
        """A plain function of time, shape (n,): [m], or a factor [-]."""
        return EffectTerms(
            location=self.path(self.location, time) if self.location else None,
            spread=np.exp(self.path(self.spread, time)) if self.spread else None,
            fine=np.exp(self.path(self.fine, time)) if self.fine else None,
        )

    def path(self, sizes: tuple[float, ...], time: FloatArray) -> FloatArray:
        """Sum of half cosines of some sizes, shape (n,), in their unit. `time` [s]."""
        return np.asarray(half_cosines(time, self.from_s, self.to_s, len(sizes)) @ np.asarray(sizes))


def half_cosines(time: FloatArray, from_s: float, to_s: float, number: int) -> FloatArray:
    """The first half cosines over a stretch of time, within -1..1, shape (n, number). [-]"""
    share = np.clip((time - from_s) / max(to_s - from_s, 1e-9), 0.0, 1.0)
    return np.asarray(np.cos(np.pi * share[:, None] * np.arange(1, number + 1)))
