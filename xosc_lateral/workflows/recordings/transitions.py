"""Transitions from one lateral level to another: start, duration and shape by least squares."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.world.motion.crossings import bell_share
from xosc_lateral.world.scenario.enums import DynamicsShape

MARGIN = 1.0  # rows of road-following that are fitted along, at both ends [s]
DURATIONS = (1.0, 16.0)
"""Of lane changes; naturalistic ones last 1 to 16.5 s (T. Toledo, D. Zohar, Transportation Research Record 1999, 2007:
mean 4.6 s). [s]"""
SHAPES: Mapping[DynamicsShape, Callable[[FloatArray], FloatArray]] = {
    DynamicsShape.SINUSOIDAL: lambda u: 0.5 - 0.5 * np.cos(np.pi * u),
    DynamicsShape.CUBIC: lambda u: u * u * (3.0 - 2.0 * u),
    DynamicsShape.LINEAR: lambda u: u,
}
"""Share of the way over share of the duration, as in `player.transition`."""


@dataclass(frozen=True, slots=True)
class Transition:
    """From one lateral level to another."""

    start: float  # start, duration: [s]
    duration: float
    shape: DynamicsShape
    lanes: int  # lanes to the left (negative: to the right); 0: within the lane
    offset: float  # where it ends, from the centre of the lane that it leads to, positive left [m]
    level: float  # the same from the centre of the first row's lane [m]
    aborted: bool = False  # one half of a lane change that was not carried through
    cut: bool = False  # the recording begins or ends within it
    change: float = 0.0  # of the level, positive left [m]
    residual: float = 0.0  # root mean square of the recorded path from the fitted one [m]
    bell_residual: float = np.inf  # the same from the bell that drivers take, where one was fitted [m]

    @property
    def end(self) -> float:
        """[s]"""
        return self.start + self.duration

    @property
    def is_bell(self) -> bool:
        """Whether the bell fits better than what a maneuver can say."""
        return self.bell_residual < self.residual


@dataclass(frozen=True, slots=True)
class Rough:
    """Rows of a transition as found, and between which levels; `held`: no person drove it, it begins and ends there."""

    first: int
    last: int
    before: float
    after: float
    lanes: int
    offset: float = 0.0
    held: bool = False
    aborted: bool = False
    cut: bool = False


def peak_acceleration(shape: DynamicsShape, change: float, duration: float) -> float:
    """Largest lateral acceleration of a transition, by which a lane offset states its duration. [m/s2]

    A linear one is given that of the cubic, as in `player.transition`.
    """
    factor = 0.5 * np.pi**2 if shape is DynamicsShape.SINUSOIDAL else 6.0
    return float(factor * abs(change) / duration**2)


def fit_transition(time: FloatArray, y: FloatArray, rough: Rough, free: float) -> Transition:
    """Start, duration and shape by least squares over a grid that is made finer; not before `free` [s].

    Nobody moves from centre to centre: a person is fitted between where he sets off and where he settles.
    """
    level = rough.after
    if not rough.held and not rough.aborted:
        rough = replace(rough, before=float(y[rough.first]), after=float(y[rough.last]))
    margin = 0.0 if rough.aborted else MARGIN
    first = int(np.searchsorted(time, max(time[rough.first] - margin, free)))
    last = int(np.searchsorted(time, time[rough.last] + margin, side="right"))
    t, rows = time[first:last], y[first:last]
    if len(t) < 4:
        t, rows = time[rough.first : rough.last + 1], y[rough.first : rough.last + 1]
    begin, end = max(time[rough.first], free), max(time[rough.last], free + 0.1)
    middle, duration = (
        0.5 * (begin + end),
        float(np.clip(end - begin, 0.1 if rough.held else DURATIONS[0], DURATIONS[1])),
    )
    best: tuple[float, float, float, DynamicsShape] = (np.inf, begin, duration, DynamicsShape.SINUSOIDAL)
    for shape in SHAPES if rough.held else (DynamicsShape.SINUSOIDAL, DynamicsShape.CUBIC):
        found = _search(t, rows, rough, SHAPES[shape], middle, duration, free)
        if found[0] < best[0] * (1.0 - 1e-9):
            best = (*found, shape)
    _, start, duration, shape = best
    residual = float(np.sqrt(best[0] / len(t))) if np.isfinite(best[0]) else 0.0
    where = rough.lanes, rough.offset, level
    bell_residual = np.inf
    if rough.lanes and not rough.held and not rough.cut and len(t):
        cost = _search(t, rows, rough, bell_share, middle, duration, free)[0]
        bell_residual = float(np.sqrt(cost / len(t)))
    return Transition(
        start, duration, shape, *where, rough.aborted, rough.cut, residual=residual, bell_residual=bell_residual
    )


def _search(
    t: FloatArray,
    y: FloatArray,
    rough: Rough,
    share_of: Callable[[FloatArray], FloatArray],
    middle: float,
    duration: float,
    free: float,
) -> tuple[float, float, float]:
    """Least cost [m2], start and duration [s]."""
    shortest = 0.1 if rough.held else DURATIONS[0]
    half, factor = 0.5 * duration + 0.5, 2.0
    best = (np.inf, middle - 0.5 * duration, duration)
    for _ in range(7 if rough.held else 5):
        middles = middle + half * np.linspace(-1.0, 1.0, 13)
        durations = np.clip(duration * factor ** np.linspace(-1.0, 1.0, 13), shortest, DURATIONS[1])
        m, d = (each.ravel() for each in np.meshgrid(middles, durations))
        possible = m - 0.5 * d >= free - 1e-9
        if not possible.any():
            m, d = np.array([free + 0.5 * duration]), np.array([duration])
            possible = np.ones(1, dtype=bool)
        m, d = m[possible], d[possible]
        share = share_of(np.clip((t - (m - 0.5 * d)[:, None]) / d[:, None], 0.0, 1.0))
        cost = ((y - rough.before - (rough.after - rough.before) * share) ** 2).sum(axis=1)
        k = int(cost.argmin())
        if cost[k] < best[0]:
            best = (float(cost[k]), float(m[k] - 0.5 * d[k]), float(d[k]))
        middle, duration = best[1] + 0.5 * best[2], best[2]
        half, factor = half / 4.0, factor**0.25
    return best
