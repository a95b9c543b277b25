"""Effects that no column shows: of the driver, of time, or of chance along the drive (drift, cycle, regimes).

References
----------
.. [1] N. M. Laird, J. H. Ware, "Random-effects models for longitudinal data", Biometrics 38, 1982: `Population`.
.. [2] G. E. P. Box, G. C. Tiao, "Intervention analysis with applications to economic and environmental problems", J.
       American Statistical Association 70, 1975: `Step`.
.. [3] U. K. Müller, M. W. Watson, "Testing models of low-frequency variability", Econometrica 76, 2008: half cosines
       over the fitted time, `TimeSmooth`.
.. [4] D. T. Gillespie, "Exact numerical simulation of the Ornstein-Uhlenbeck process and its integral", Physical Review
       E 54, 1996: `Drift`.
.. [5] A. Demir, A. Mehrotra, J. Roychowdhury, "Phase noise in oscillators: a unifying theory", IEEE Trans. Circuits
       and Systems I 47, 2000: a phase in Brownian motion, `Cycle`.
.. [6] J. R. Norris, "Markov Chains", 1997, section 2.6: a chain in continuous time stays exponentially long, `Regimes`.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any, ClassVar

import msgspec
import numpy as np
from msgspec import Meta

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects.base import FACTOR_LIMIT, Effect, EffectTerms
from xosc_lateral.drivers.model.linear_filters import recur
from xosc_lateral.drivers.model.records import set_once


class NoState(msgspec.Struct):
    """Of an effect that is a plain function of time."""


class HiddenEffect(Effect, frozen=True, kw_only=True):
    """An effect of time or of chance alone; a plain function of time needs nothing but `advance`.

    Raises `DriverProfileError` if a field is not finite, or one in `positive` is not above 0.
    """

    positive: ClassVar[tuple[str, ...]] = ()  # Fields that must be above 0.

    # Type of the state: a msgspec struct of numbers, arrays and generators.
    State: ClassVar[type[msgspec.Struct]] = NoState

    def __post_init__(self) -> None:
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
        """Terms at the next rows of an even grid, which go on where those of the last call ended; so does `state`.

        `time` in the drive's clock, shape (n,), n >= 1, and `step` of the grid in [s].
        """


class Adapted(HiddenEffect, frozen=True, kw_only=True):
    """What makes another driver of a profile's (`fitting.derive`).

    `shift` of the mean offset, positive left [m]; factors of `EffectTerms`, 1/5 to 5 [-].
    """

    positive: ClassVar[tuple[str, ...]] = ("spread", "rate", "fine")
    shift: float = 0.0
    spread: float = 1.0
    rate: float = 1.0
    fine: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.positive:
            if not 1.0 / FACTOR_LIMIT <= getattr(self, name) <= FACTOR_LIMIT:
                raise DriverProfileError(
                    f"effect adapted: {name} {getattr(self, name):g}, expected {1 / FACTOR_LIMIT:g} to {FACTOR_LIMIT:g}"
                )

    def advance(self, state: NoState, time: FloatArray, step: float) -> EffectTerms:
        """The same at all times, shape (n,): shift [m], factors [-]; what is 1 is left out."""
        even = np.ones(len(time))
        spread, rate, fine = (
            None if factor == 1.0 else factor * even for factor in (self.spread, self.rate, self.fine)
        )
        return EffectTerms(self.shift * even, spread, rate, fine)


class PopulationState(msgspec.Struct):
    """One driver: shift [m], factor on the spread and on the fine noise [-]."""

    shift: float
    spread: float
    fine: float


class Population(HiddenEffect, frozen=True, kw_only=True):
    """A driver is drawn for every run: a shift, normal, and factors on spread and fine noise, log-normal.

    Fields are standard deviations: of the drivers' mean offsets, with its standard error [m], and of logarithms [-].
    """

    shift: float
    shift_error: float = 0.0
    log_spread: float = 0.0
    log_fine: float = 0.0

    State: ClassVar[type[msgspec.Struct]] = PopulationState

    def begin(self, rng: np.random.Generator, step: float) -> PopulationState:
        """Draw a driver. `step` in [s]."""
        shift, spread, fine = rng.normal(size=3) * (self.shift, self.log_spread, self.log_fine)
        return PopulationState(float(shift), float(np.exp(spread)), float(np.exp(fine)))

    def advance(self, state: PopulationState, time: FloatArray, step: float) -> EffectTerms:
        """One driver for the whole drive: shift [m], factors [-], shape (n,)."""
        n = len(time)
        return EffectTerms(np.full(n, state.shift), np.full(n, state.spread), None, np.full(n, state.fine))


class Step(HiddenEffect, frozen=True, kw_only=True):
    """The mean offset jumps once, by `size` (positive: to the left) with a standard error [m], at `at_s` [s].

    `share_before` of the fitted drive [-] was before the jump: the mean over the drive stays unchanged.
    """

    size: float
    size_error: float = 0.0
    at_s: float = 0.0
    share_before: float = 0.5

    def advance(self, state: NoState, time: FloatArray, step: float) -> EffectTerms:
        """Below the mean before, above after, shape (n,) [m]; nothing is random."""
        after = (time >= self.at_s).astype(np.float64)
        return EffectTerms(location=self.size * (after - (1.0 - self.share_before)))


class VarianceTrend(HiddenEffect, frozen=True, kw_only=True):
    """Spread and fine noise change steadily with time on the road; outside the fitted time the outermost value holds.

    By factors > 0 [-] from the beginning to the end of the time that they were fitted on, `from_s` to `to_s` [s].
    """

    positive: ClassVar[tuple[str, ...]] = ("factor", "fine_factor")
    factor: float
    factor_error: float = 0.0
    fine_factor: float = 1.0
    from_s: float = 0.0
    to_s: float = 3600.0

    def advance(self, state: NoState, time: FloatArray, step: float) -> EffectTerms:
        """1 in the middle of the fitted time, shape (n,) [-]; nothing is random."""
        share = np.clip((time - self.from_s) / max(self.to_s - self.from_s, 1e-9), 0.0, 1.0) - 0.5
        return EffectTerms(spread=self.factor**share, fine=self.fine_factor**share)


class TimeSmooth(HiddenEffect, frozen=True, kw_only=True):
    """Mean, spread and fine noise change with time as they did; before and after the fitted time the outermost value
    holds. By sizes of the k-th half cosine, k = 1, 2, ..., of the mean offset [m] and of logarithms [-]."""

    location: tuple[float, ...] = ()
    location_errors: tuple[float, ...] = ()
    spread: tuple[float, ...] = ()
    spread_errors: tuple[float, ...] = ()
    fine: tuple[float, ...] = ()
    from_s: Annotated[float, Meta(description="Time that it was fitted on, in the drive's clock. [s]")] = 0.0
    to_s: float = 3600.0

    def __post_init__(self) -> None:
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


# ---- Hidden effects that are random processes: drift, a cycle wit ----
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
