"""Hidden effects that are random processes: drift, a cycle with a phase of its own, regimes that switch.

References
----------
.. [1] D. T. Gillespie, "Exact numerical simulation of the Ornstein-Uhlenbeck process and its integral", Physical Review
       E 54, 1996: `Drift`.
.. [2] A. Demir, A. Mehrotra, J. Roychowdhury, "Phase noise in oscillators: a unifying theory", IEEE Trans. Circuits
       and Systems I 47, 2000: a phase in Brownian motion, `Cycle`.
.. [3] J. R. Norris, "Markov Chains", 1997, section 2.6: a chain in continuous time stays exponentially long, `Regimes`.
"""

from __future__ import annotations

from typing import ClassVar

import msgspec
import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.drivers.model.effects.base import EffectTerms
from xosc_lateral.drivers.model.effects.hidden import HiddenEffect
from xosc_lateral.drivers.model.linear_filters import recur


class DriftState(msgspec.Struct):
    """Generator, and the last value. [m]"""

    rng: np.random.Generator
    value: float = 0.0
    begun: bool = False


class Drift(HiddenEffect, frozen=True, kw_only=True):
    """Ornstein-Uhlenbeck process of the mean offset: standard deviation and its error [m], correlation time [s]."""

    positive: ClassVar[tuple[str, ...]] = ("size", "correlation_s")
    size: float
    size_error: float = 0.0
    correlation_s: float = 300.0

    State: ClassVar[type[msgspec.Struct]] = DriftState

    def begin(self, rng: np.random.Generator, step: float) -> DriftState:
        """Stationary from the start. `step` in [s]."""
        return DriftState(rng)

    def advance(self, state: DriftState, time: FloatArray, step: float) -> EffectTerms:
        """A path of its own for every drive, shape (n,) [m]: the Ornstein-Uhlenbeck process, sampled exactly."""
        keep = float(np.exp(-step / self.correlation_s))
        noise = state.rng.standard_normal(len(time))
        noise *= self.size
        noise *= np.sqrt(1.0 - keep**2)
        if not state.begun:
            noise[0] /= np.sqrt(1.0 - keep**2)
        location = recur(np.array([state.value]), noise, np.array([keep]))[1:]
        state.value, state.begun = float(location[-1]), True
        return EffectTerms(location=location)


class CycleState(msgspec.Struct):
    """Generator, first phase [turns], sum of the normal kicks so far [-], when the drive began [s]."""

    rng: np.random.Generator
    phase: float
    kicks: float = 0.0
    begun_at: float | None = None


class Cycle(HiddenEffect, frozen=True, kw_only=True):
    """A sine of constant amplitude [m] and period [s] whose phase starts anywhere and drifts.

    After `coherence_s` it has drifted by one radian (standard deviation). [s]
    """

    positive: ClassVar[tuple[str, ...]] = ("amplitude", "period_s", "coherence_s")
    amplitude: float
    amplitude_error: float = 0.0
    period_s: float
    coherence_s: float = 1e6

    State: ClassVar[type[msgspec.Struct]] = CycleState

    def begin(self, rng: np.random.Generator, step: float) -> CycleState:
        """Any phase. `step` in [s]."""
        return CycleState(rng, float(rng.random()))

    def advance(self, state: CycleState, time: FloatArray, step: float) -> EffectTerms:
        """A sine [m], shape (n,), whose phase drifts as Brownian motion does."""
        if state.begun_at is None:
            state.begun_at = float(time[0])
        kicks = np.cumsum(np.concatenate([[state.kicks], state.rng.normal(size=len(time))]))[1:]
        state.kicks = float(kicks[-1])
        drift = kicks * np.sqrt(step / self.coherence_s)
        phase = 2.0 * np.pi * (state.phase + (time - state.begun_at) / self.period_s) + drift
        return EffectTerms(location=self.amplitude * np.sin(phase))


class RegimesState(msgspec.Struct):
    """Generator, whether the regime is on, when it ends and when the drive began. [s]"""

    rng: np.random.Generator
    on: bool
    end: float
    begun_at: float | None = None


class Regimes(HiddenEffect, frozen=True, kw_only=True):
    """A two-state Markov process multiplies spread and fine noise while it is on.

    Factors are those of the on regime over the off regime [-]; `on_s` and `off_s` are the regimes' mean lengths [s].
    """

    positive: ClassVar[tuple[str, ...]] = ("factor", "fine_factor", "on_s", "off_s")
    factor: float
    factor_error: float = 0.0
    fine_factor: float = 1.0
    on_s: float
    off_s: float

    State: ClassVar[type[msgspec.Struct]] = RegimesState

    def begin(self, rng: np.random.Generator, step: float) -> RegimesState:
        """The first regime is drawn from the long-run share. `step` in [s]."""
        on = bool(rng.random() < self.on_s / (self.on_s + self.off_s))
        return RegimesState(rng, on, self._length(rng, on))

    def advance(self, state: RegimesState, time: FloatArray, step: float) -> EffectTerms:
        """Regimes with exponential lengths, on an even grid [s] of shape (n,)."""
        return self.terms_where(self.states(state, time))

    def states(self, state: RegimesState, time: FloatArray) -> BoolArray:
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

    def terms_where(self, on: BoolArray) -> EffectTerms:
        """Terms for given regimes, shape of `on`."""
        return EffectTerms(spread=np.where(on, self.factor, 1.0), fine=np.where(on, self.fine_factor, 1.0))

    def _length(self, rng: np.random.Generator, on: bool) -> float:
        return float(rng.exponential(self.on_s if on else self.off_s))
