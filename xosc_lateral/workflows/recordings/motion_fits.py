"""What maneuvers say of a recorded motion, by least squares: transitions across the road, and a speed along it.

A transition goes from one lateral level to another: start, duration and shape. A speed of straight pieces is a way of
parabolas with a continuous slope: a quadratic spline whose knots are the corners. With knots given, it is a linear
problem.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.world.motion.crossings import bell_share
from xosc_lateral.world.scenario.enums import DynamicsShape

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


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
    """Largest lateral acceleration [m/s2], by which a lane offset states its duration; of a linear one the cubic's."""
    factor = 0.5 * np.pi**2 if shape is DynamicsShape.SINUSOIDAL else 6.0
    return float(factor * abs(change) / duration**2)


def fit_transition(time: FloatArray, y: FloatArray, rough: Rough, free: float) -> Transition:
    """Start, duration and shape, not before `free` [s]; of a person, from where he sets off to where he settles."""
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
        candidate = _search(t, rows, rough, SHAPES[shape], middle, duration, free)
        if candidate[0] < best[0] * (1.0 - 1e-9):
            best = (*candidate, shape)
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


SPACING = 0.4  # rows are thinned to this: in that time, a change of acceleration of 1 m/s2 shows as 1 cm [s]
APART = 1.0  # corners are at least this far apart: a driver's foot needs about so long from one pedal to the other [s]
ROUNDS = 12  # of Gauss-Newton; corners move by less than 10 ms after eight


@dataclass(frozen=True, eq=False, slots=True)
class SpeedProfile:
    """Speed of straight pieces."""

    time: FloatArray  # time, speed: both ends and the corners between, shape (k,) [s], [m/s]
    speed: FloatArray
    start: float  # way at the first time [m]

    def way(self, time: FloatArray) -> FloatArray:
        """Way at times within the profile, shape as the argument. [m]"""
        step, change = np.diff(self.time), np.diff(self.speed)
        ways = self.start + np.r_[0.0, np.cumsum(step * (self.speed[:-1] + 0.5 * change))]
        k = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(step) - 1)
        u = time - self.time[k]
        return np.asarray(ways[k] + u * (self.speed[k] + 0.5 * u * change[k] / step[k]))


def fit_speed(time: FloatArray, way: FloatArray, *, error: float, apart: float = APART) -> SpeedProfile:
    """Speed with the fewest corners, `apart` [s] at least, for ways [m] at increasing times [s] within `error` [m].

    Greedy: corners are added where the error is largest, taken out while the bound still holds, moved to where the
    squared error is least, and taken out once more. Where corners would have to be closer than `apart` the bound is
    given up.
    """
    grid = np.arange(time[0], time[-1], min(SPACING, 0.5 * apart))
    kept = np.unique(np.r_[np.minimum(np.searchsorted(time, grid), len(time) - 1), len(time) - 1])
    t, w = time[kept], way[kept]
    if len(t) < 4:
        speed = max((w[-1] - w[0]) / (t[-1] - t[0]), 0.0)
        return SpeedProfile(t[[0, -1]], np.array([speed, speed]), float(w[0]))
    knots = _moved(t, w, _thinned(t, w, _has_enough_rows(t, w, error, apart), error), apart)
    knots = _moved(t, w, _thinned(t, w, knots, error), apart)
    spline = _spline(t, w, knots)
    corners = np.r_[t[0], knots, t[-1]]
    speed = spline(corners, 1)
    if (speed < 0.0).any():
        return _without_reversing(t, w, corners, max(error, float(np.abs(w - spline(t)).max())), apart)
    return SpeedProfile(corners, speed, float(spline(t[0])))


def _without_reversing(t: FloatArray, w: FloatArray, corners: FloatArray, error: float, apart: float) -> SpeedProfile:
    """The least squared error of speeds that are not negative, with more corners where it is beyond the bound."""
    from scipy.optimize import lsq_linear

    while True:
        ways = [SpeedProfile(corners, one, 0.0).way(t) for one in np.eye(len(corners))]
        lowest = np.r_[-np.inf, np.zeros(len(corners))]
        start, *speed = lsq_linear(np.column_stack([np.ones(len(t)), *ways]), w, (lowest, np.inf)).x
        profile = SpeedProfile(corners, np.asarray(speed), float(start))
        residual, wide = np.abs(w - profile.way(t)), np.diff(corners) >= 2.0 * apart
        piece = np.clip(np.searchsorted(corners, t, side="right") - 1, 0, len(wide) - 1)
        worst = int(np.where(wide[piece], residual, 0.0).argmax())
        if residual[worst] <= error or not wide[piece[worst]]:
            return profile
        k = piece[worst] + 1
        corners = np.insert(corners, k, 0.5 * (corners[k - 1] + corners[k]))


def _spline(t: FloatArray, w: FloatArray, knots: FloatArray) -> BSpline[np.float64]:
    from scipy.interpolate import make_lsq_spline

    return make_lsq_spline(t, w, np.r_[[t[0]] * 3, knots, [t[-1]] * 3], 2)


def _has_enough_rows(t: FloatArray, w: FloatArray, error: float, apart: float) -> FloatArray:
    """Corners added in the middle of the worst piece until the bound holds."""
    knots = np.empty(0)
    while True:
        residual = np.abs(w - _spline(t, w, knots)(t))
        edges = np.r_[t[0], knots, t[-1]]
        piece = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, len(edges) - 2)
        residual[np.diff(edges)[piece] < 2.0 * apart] = 0.0  # can't be parted
        worst = int(residual.argmax())
        if residual[worst] <= error:
            return knots
        k = piece[worst]
        knots = np.insert(knots, k, 0.5 * (edges[k] + edges[k + 1]))


def _thinned(t: FloatArray, w: FloatArray, knots: FloatArray, error: float) -> FloatArray:
    """Without the corners that the bound does not need, the slightest first."""
    bound = max(error, float(np.abs(w - _spline(t, w, knots)(t)).max()))
    while len(knots):
        slope = np.diff(_spline(t, w, knots)(np.r_[t[0], knots, t[-1]], 1)) / np.diff(np.r_[t[0], knots, t[-1]])
        for k in np.argsort(np.abs(np.diff(slope)), kind="stable"):
            fewer = np.delete(knots, k)
            if np.abs(w - _spline(t, w, fewer)(t)).max() <= bound:
                knots = fewer
                break
        else:
            return knots
    return knots


def _moved(t: FloatArray, w: FloatArray, knots: FloatArray, apart: float) -> FloatArray:
    """Corners where the squared error is least (Gauss-Newton with halved steps), in order and apart."""
    if not len(knots):
        return knots
    from scipy.interpolate import BSpline

    spline = _spline(t, w, knots)
    residual = w - spline(t)
    for _ in range(ROUNDS):
        edges = np.r_[t[0], knots, t[-1]]
        bend = np.diff(np.diff(spline(edges, 1)) / np.diff(edges))
        basis = BSpline.design_matrix(t, np.r_[[t[0]] * 3, knots, [t[-1]] * 3], 2).toarray()
        moved = -bend * np.maximum(t[:, None] - knots, 0.0)  # what a later corner changes of the way
        step = np.linalg.lstsq(np.hstack([basis, moved]), residual, rcond=1e-10)[0][basis.shape[1] :]
        for _ in range(6):
            tried = np.clip(knots + step, knots - 2.0, knots + 2.0)
            if (np.diff(np.r_[t[0], tried, t[-1]]) >= 0.5 * apart).all():
                again = _spline(t, w, tried)
                left = w - again(t)
                if left @ left < residual @ residual:
                    break
            step = 0.5 * step
        else:
            return knots
        done = residual @ residual - left @ left < 1e-6 * (residual @ residual)
        knots, spline, residual = tried, again, left
        if done:
            break
    return knots
