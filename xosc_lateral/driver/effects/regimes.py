"""On/off regimes: at times the driver is another one, distracted say.

References
----------
.. [1] J. R. Norris, "Markov Chains", 1997, section 2.6: a chain in continuous time stays exponentially long.
"""

from __future__ import annotations

from typing import ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.hidden import HiddenEffect

FloatArray = NDArray[np.float64]


class RegimesState(msgspec.Struct):
    """Generator, whether the regime is on, when it ends and when the drive began. [s]"""

    rng: np.random.Generator
    on: bool
    end: float
    begun_at: float | None = None


class Regimes(HiddenEffect, frozen=True, kw_only=True):
    """A two-state Markov process multiplies the spread while it is on.

    Parameters
    ----------
    factor : float
        Spread in the on regime over spread in the off regime. [-]
    factor_error : float
        Standard error. [-]
    fine_factor : float
        The same for the fine noise. [-]
    on_s, off_s : float
        Mean length of either regime. [s]
    """

    positive: ClassVar[tuple[str, ...]] = ("factor", "fine_factor", "on_s", "off_s")
    factor: float
    factor_error: float = 0.0
    fine_factor: float = 1.0
    on_s: float
    off_s: float

    State: ClassVar[type[msgspec.Struct]] = RegimesState

    def begin(self, rng: np.random.Generator, step: float) -> RegimesState:
        """The first regime is drawn from the long-run share; terms have shape (n,). `step` in [s]."""
        on = bool(rng.random() < self.on_s / (self.on_s + self.off_s))
        return RegimesState(rng, on, self._length(rng, on))

    def advance(self, state: RegimesState, time: FloatArray, step: float) -> EffectTerms:
        """Regimes with exponential lengths, on an even grid [s] of shape (n,)."""
        return self.terms_where(self.states(state, time))

    def states(self, state: RegimesState, time: FloatArray) -> NDArray[np.bool_]:
        """Whether the regime is on, shape of `time` [s], (n,)."""
        if state.begun_at is None:
            state.begun_at = float(time[0])
        elapsed = time - state.begun_at
        first, ends = state.on, [state.end]
        while ends[-1] <= elapsed[-1]:
            state.on = not state.on
            ends.append(ends[-1] + self._length(state.rng, state.on))
        state.end = ends[-1]
        switched = np.searchsorted(np.asarray(ends), elapsed, side="right") % 2 == 1
        return np.asarray(switched ^ first)

    def terms_where(self, on: NDArray[np.bool_]) -> EffectTerms:
        """Terms for given regimes, shape of `on`."""
        return EffectTerms(spread=np.where(on, self.factor, 1.0), fine=np.where(on, self.fine_factor, 1.0))

    def _length(self, rng: np.random.Generator, on: bool) -> float:
        return float(rng.exponential(self.on_s if on else self.off_s))
