"""Lateral maneuvers of a recorded vehicle: lane changes, aborted ones, lane offsets; when, how long, of what shape.

A transition goes from one lateral level to another; its start, duration and shape are those of the least squares.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from xosc_lateral.base.arrays import FloatArray, rate, true_slices
from xosc_lateral.drivers.drives.lane_changes import RATE_WINDOW, SETTLED_OFFSET, Course, Rough
from xosc_lateral.extras.recordings.recorded import MOVING_SPEED, own_lateral
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.motion.segments import bell_share
from xosc_lateral.world.scenario.enums import DynamicsShape

STILL_RATE = 1e-3  # lateral speed below which a vehicle stands still sideways [m/s] ...
STILL_DURATION = 0.5  # ... for at least so long [s]
FIT_MARGIN = 1.0  # rows of road-following that are fitted along, at both ends [s]
DURATIONS = (1.0, 16.0)
"""Of lane changes; naturalistic ones last 1 to 16.5 s (T. Toledo, D. Zohar, Transportation Research Record 1999, 2007:
mean 4.6 s). [s]"""
Share: TypeAlias = Callable[[FloatArray], FloatArray]
SHAPES: Mapping[DynamicsShape, Share] = {
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


@dataclass(frozen=True, eq=False, slots=True)
class LateralPlan:
    """Lateral maneuvers of a vehicle."""

    start: float  # level at the first row [m]
    transitions: tuple[Transition, ...]  # in order; none begins before the one before it is over
    is_played: bool  # the track stands still sideways for most of the time: no person drove it

    def at(self, time: FloatArray) -> FloatArray:
        """Level at some times, shape as the argument. [m]"""
        value = np.full(len(time), self.start)
        before = self.start
        for transition in self.transitions:
            share = SHAPES[transition.shape](np.clip((time - transition.start) / transition.duration, 0.0, 1.0))
            value = np.where(time >= transition.start, before + (transition.level - before) * share, value)
            before = transition.level
        return value


def lateral_plan(vehicle: EntityMotion, begin: float) -> LateralPlan:
    """Find and fit all lateral maneuvers; none starts before `begin` [s]."""
    side = 0.5 * (vehicle.lane_width - vehicle.box.width)
    course = Course.across(vehicle.time, *own_lateral(vehicle), np.asarray(side))
    time, y = course.time, course.y
    still_parts = [
        part
        for part in true_slices(np.abs(course.rate) < STILL_RATE)
        if time[part.stop - 1] - time[part.start] >= STILL_DURATION
    ]
    still = np.zeros(len(y), dtype=np.bool_)
    for part in still_parts:
        still[part] = True
    driven = np.hypot(*(rate(each, time, RATE_WINDOW) for each in (vehicle.x, vehicle.y)))
    moving = driven >= MOVING_SPEED  # in a jam, people stand still sideways too
    is_played = bool((still[moving] if moving.any() else still).mean() > 0.5)
    if is_played:
        rough = course.between_levels(still_parts)
        start = float(np.median(y[still_parts[0]])) if still[0] else float(y[0])
    else:
        rough = course.maneuvers()
        first = rough[0].first if rough else len(y)
        near = np.append(np.abs(y) < SETTLED_OFFSET, True)
        is_off = abs(y[0]) > SETTLED_OFFSET and first < int(np.argmax(near))
        start = float(y[0]) if is_off or first == 0 else 0.0
    transitions = list[Transition]()
    free, before = begin, start
    for movement in rough:
        transition = fit_transition(time, y, movement, free)
        transitions.append(replace(transition, change=transition.level - before))
        free, before = transition.end, transition.level
    return LateralPlan(start, tuple(transitions), is_played)


# ---- transitions by least squares -----------------------------------------------------------------------------------
def peak_acceleration(shape: DynamicsShape, change: float, duration: float) -> float:
    """Largest lateral acceleration [m/s2], by which a lane offset states its duration; of a linear one the cubic's."""
    factor = 0.5 * np.pi**2 if shape is DynamicsShape.SINUSOIDAL else 6.0
    return float(factor * abs(change) / duration**2)


def fit_transition(time: FloatArray, y: FloatArray, rough: Rough, free: float) -> Transition:
    """Start, duration and shape, not before `free` [s]; of a person, from where he sets off to where he settles."""
    level = rough.after
    if not rough.held and not rough.aborted:
        rough = replace(rough, before=float(y[rough.first]), after=float(y[rough.last]))
    margin = 0.0 if rough.aborted else FIT_MARGIN
    first = int(np.searchsorted(time, max(time[rough.first] - margin, free)))
    last = int(np.searchsorted(time, time[rough.last] + margin, side="right"))
    t, rows = time[first:last], y[first:last]
    if len(t) < 4:
        t, rows = time[rough.first : rough.last + 1], y[rough.first : rough.last + 1]
    begin, end = max(time[rough.first], free), max(time[rough.last], free + 0.1)
    shortest = 0.1 if rough.held else DURATIONS[0]
    middle, duration = 0.5 * (begin + end), float(np.clip(end - begin, shortest, DURATIONS[1]))
    best: tuple[float, float, float, DynamicsShape] = (np.inf, begin, duration, DynamicsShape.SINUSOIDAL)
    for shape in SHAPES if rough.held else (DynamicsShape.SINUSOIDAL, DynamicsShape.CUBIC):
        candidate = _search(t, rows, rough, SHAPES[shape], middle, duration, free)
        if candidate[0] < best[0] * (1.0 - 1e-9):
            best = (*candidate, shape)
    _, start, duration, shape = best
    residual, bell_residual = float(np.sqrt(best[0] / len(t))) if np.isfinite(best[0]) else 0.0, np.inf
    if rough.lanes and not rough.held and not rough.cut and len(t):
        cost = _search(t, rows, rough, bell_share, middle, duration, free)[0]
        bell_residual = float(np.sqrt(cost / len(t)))
    kind = rough.lanes, rough.offset, level, rough.aborted, rough.cut
    return Transition(start, duration, shape, *kind, residual=residual, bell_residual=bell_residual)


def _search(
    t: FloatArray, y: FloatArray, rough: Rough, share_of: Share, middle: float, duration: float, free: float
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
