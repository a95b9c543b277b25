"""A recorded vehicle in the lanes of a road, row by row; and its lateral maneuvers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, count
from typing import TypeAlias

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray, fitted_rate, rate, true_slices
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.lazy import interpolate
from xosc_lateral.base.track import lane_levels
from xosc_lateral.drivers.drives.identity import LONGEST_BRIDGE, LONGEST_GAP, leaps
from xosc_lateral.drivers.drives.lane_changes import RATE_WINDOW, SETTLED_OFFSET, Course, Rough
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.motion.segments import bell_share
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.enums import DynamicsShape

MARKING_TOLERANCE = 1.0  # so far beside every driving lane a vehicle still keeps to one: it drives on its marking [m]
MAXIMUM_COORDINATE = 1e8  # no map projection gives such a position: the Earth's circumference is 4e7 m [m]
SHORTEST_STEP = 1e-4  # rows that follow sooner are of the same moment: no sensor has 10 kHz [s]
MINIMUM_PASSAGE = 2.0  # passages below this are left out: a speed and its change can't be told in less [s]
MINIMUM_BRIDGE = 2.0  # a gap is bridged where rows are farther apart than this many usual steps [-]
BACKWARDS_DISTANCE = 0.5  # who falls back so far drives backwards; less is an error of standing vehicles' positions [m]
MOVING_SPEED = 0.25  # below, a vehicle stands, and its direction is that of errors: half a walking pace [m/s]
VELOCITY_WINDOW = 2.0  # rows whose positions a velocity is fitted to: 0.2 m of noise at 10 Hz are 0.08 m/s in it [s]
HEADING_WINDOW = 2.0  # way over which a heading is averaged, so that positions' noise does not turn a slow vehicle [m]


@dataclass(frozen=True, eq=False, slots=True)
class Recording:
    """Vehicles on a road, and what was left out, a line each."""

    vehicles: tuple[EntityMotion, ...]  # one passage each, in the lanes of the road; their headings are their lanes'
    left_out: tuple[str, ...]
    start: float  # start, end: of the window [s]
    end: float
    rows: Mapping[str, int] = field(default_factory=dict)  # recorded rows by what became of them
    inferred: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    # by vehicle, from when to when nobody saw it, and its path was bridged [s from the window's start]


@dataclass(frozen=True, eq=False, slots=True)
class RecordedTrack(EntityMotion):
    """One vehicle as recorded, in the coordinates of the road: x, y and heading of the recorded point."""

    ahead: float  # that point ahead of the reference point [m]

    def distance(self, other: RecordedTrack, begin: float, end: float) -> float:
        """The least to another track between two moments [s]; infinite where they are not there at once. [m]"""
        first, last = max(begin, self.time[0]), min(end, self.time[-1])
        time = other.time[(other.time >= first) & (other.time <= last)]
        x, y = (
            np.interp(time, other.time, there) - np.interp(time, self.time, here)
            for there, here in ((other.x, self.x), (other.y, self.y))
        )
        return float(np.hypot(x, y).min(initial=np.inf))


def own_lateral(vehicle: EntityMotion) -> tuple[FloatArray, FloatArray, IntArray]:
    """Lateral position, that of each row's lane centre, both from the first row's lane centre and positive to the LEFT
    of the vehicle's own travel [m], and how many lanes to that side; shape (n,).
    """
    aside = vehicle.way() * vehicle.offset
    base, lanes = lane_levels(aside, vehicle.lane_width)
    return aside + base, base, lanes


def place_tracks(tracks: Sequence[RecordedTrack], network: RoadNetwork, start: float, end: float) -> Recording:
    """Each vehicle's passages in driving lanes within a window of time: who comes back after one is NAME#2.

    Raises `NotEnoughDataError`.
    """
    vehicles, left_out, counts = list[EntityMotion](), list[str](), Counter[str]()
    inferred, taken = dict[str, tuple[tuple[float, float], ...]](), {track.name for track in tracks}
    for track in tracks:
        inside = (np.hypot(track.x, track.y) < MAXIMUM_COORDINATE) & np.isfinite(track.heading)
        rows = np.flatnonzero(inside & (track.time >= start - 1e-9) & (track.time <= end + 1e-9))
        counts["outside the window, or nowhere"] += len(track.time) - len(rows)
        if len(rows):
            apart = np.r_[True, np.diff(track.time[rows]) > SHORTEST_STEP]
            counts["repeated time"] += int((~apart).sum())
            for vehicle, bridged in _place(track, rows[apart], network, left_out, start, counts, taken):
                vehicles.append(vehicle)
                gaps = tuple(
                    (float(vehicle.time[p.start]), float(vehicle.time[p.stop - 1])) for p in true_slices(bridged)
                )
                inferred |= {vehicle.name: gaps} if gaps else {}
    if not vehicles:
        why = f": {left_out[0]}" if left_out else ""
        raise NotEnoughDataError(f"no vehicle can be reconstructed between {start:g} and {end:g} s{why}")
    rows_of = {reason: count for reason, count in counts.items() if count}
    return Recording(tuple(vehicles), tuple(left_out), start, end, rows_of, inferred)


def _place(
    track: RecordedTrack, rows: NDArray[np.intp], network: RoadNetwork, left_out: list[str], start: float,
    counts: Counter[str], taken: set[str],
) -> list[tuple[EntityMotion, BoolArray]]:  # fmt: skip
    """Passages in order of time, and which of their rows nobody saw."""
    time, x, y, heading, inferred = _bridged(track, rows)
    velocity = np.stack([fitted_rate(x, time, VELOCITY_WINDOW), fitted_rate(y, time, VELOCITY_WINDOW)])
    heading = _steady_heading(time, x, y, velocity, heading, network)
    x, y = x - track.ahead * np.cos(heading), y - track.ahead * np.sin(heading)
    nearest = network.world_to_lane(x, y, heading=heading)
    on_lane = (nearest.distance <= MARKING_TOLERANCE) & (nearest.lane != 0)
    if not on_lane.any():
        left_out.append(f"{track.name}: on no driving lane")
        counts["off the lanes"] += len(rows)
        return []
    lane_heading, width, there = np.zeros(len(x)), np.full(len(x), np.nan), np.flatnonzero(on_lane)
    place = nearest.road[there], nearest.lane[there], nearest.s[there]
    lane_heading[there], width[there] = network.lane_to_world(*place).heading, network.lane_width(*place)
    way = np.where(np.cos(heading - lane_heading) < 0.0, -1, 1)
    turn = np.arctan2(velocity[1], velocity[0]) - lane_heading
    is_across = (np.abs(np.sin(turn)) > np.abs(np.cos(turn))) & (np.hypot(*velocity) >= MOVING_SPEED)
    driven = np.cumsum(np.r_[0.0, np.diff(x) * np.cos(heading[1:]) + np.diff(y) * np.sin(heading[1:])])
    is_back = driven < np.maximum.accumulate(driven) - BACKWARDS_DISTANCE
    elsewhere = on_lane & (is_across | is_back)
    passages = _passages(time, x, y, np.flatnonzero(on_lane & ~elsewhere))
    seen = ~inferred
    reasons = {
        "off the lanes": int((~on_lane & seen).sum()),
        "across a lane or backwards": int((elsewhere & seen).sum()),
    }
    every = np.concatenate([*passages, np.zeros(0, dtype=np.intp)])
    kept = int(seen[every].sum())
    lost = len(rows) - kept
    reasons["beyond them, a gap or a leap"] = lost - sum(reasons.values())
    counts.update({"kept": kept, **{why: max(count, 0) for why, count in reasons.items()}})
    rows_lost = ", ".join(f"{count} {why}" for why, count in reasons.items() if count > 0)
    if not passages:
        head = f"{track.name}: no {MINIMUM_PASSAGE:g} s along a driving lane without a gap"
        left_out.append(f"{head}; of {len(rows)} rows {rows_lost}")
        return []
    if lost:
        left_out.append(f"{track.name}: {lost} of {len(rows)} rows: {rows_lost}")
    if inferred[every].any():
        left_out.append(f"{track.name}: {int(inferred[every].sum())} rows are inferred: nobody saw it for up to 4 s")
    made = []
    free = (name for number in count(2) if (name := f"{track.name}#{number}") not in taken)
    for name, part in zip(chain([track.name], free), passages, strict=False):
        taken.add(name)
        moments, turned = time[part] - start, np.where(way[part] < 0, np.pi, 0.0)
        motion = EntityMotion.of(
            structs.replace(track.entity, name=name), moments, x=x[part], y=y[part],
            heading=lane_heading[part] + turned, heading_relative=turned,
            speed=np.hypot(rate(x[part], moments), rate(y[part], moments)), road=nearest.road[part],
            lane=nearest.lane[part], s=nearest.s[part], offset=nearest.offset[part], lane_width=width[part],
        )  # fmt: skip
        made.append((motion, inferred[part]))
    if len(made) > 1:
        left_out.append(f"{track.name}: comes back {len(made) - 1} times: {', '.join(one.name for one, _ in made[1:])}")
    return made


def _steady_heading(
    time: FloatArray, x: FloatArray, y: FloatArray, velocity: FloatArray, heading: FloatArray, network: RoadNetwork
) -> FloatArray:
    """Headings averaged over `HEADING_WINDOW` of way: those of a vehicle that stands are from when it last moved.

    One that never moves points along its lane, or against it where its headings agree, and are not all 0.
    """
    speed = np.hypot(*velocity)
    driven = np.where(speed >= MOVING_SPEED, speed, 0.0) * np.gradient(time) if len(time) > 1 else np.zeros(1)
    way, half = np.cumsum(driven), 0.5 * HEADING_WINDOW
    if way[-1] <= 0.0:
        nearest = network.world_to_lane(x, y)
        if not (nearest.lane != 0).all():
            return heading
        lane = network.lane_to_world(nearest.road, nearest.lane, nearest.s).heading
        is_against = heading.any() and np.cos(heading - lane).mean() < -np.cos(0.25 * np.pi)
        return np.asarray(lane + np.pi if is_against else lane)
    middle, turns = way - 0.5 * driven, np.cumsum(np.exp(1j * heading) * driven)
    edges, turned = np.r_[0.0, way], np.r_[0.0, turns]
    mean = np.interp(middle + half, edges, turned) - np.interp(middle - half, edges, turned)
    return np.asarray(np.angle(mean))


def _bridged(
    track: RecordedTrack, rows: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, BoolArray]:
    """Time, x, y and heading of the rows, with what lies between two where nobody saw the vehicle for a while and it
    came back where its speed leads; and which are inferred so. Shape (m,)."""
    time, x, y, heading = (values[rows] for values in (track.time, track.x, track.y, track.heading))
    inferred = np.zeros(len(rows), dtype=np.bool_)
    if len(rows) < 4:
        return time, x, y, heading, inferred
    step = np.diff(time)
    usual = float(np.median(step))
    gaps = (step > MINIMUM_BRIDGE * usual) & (step > LONGEST_GAP) & (step <= LONGEST_BRIDGE) & ~leaps(time, x, y)
    if not gaps.any():
        return time, x, y, heading, inferred
    parts = np.split(np.arange(len(rows)), np.flatnonzero(step > LONGEST_GAP) + 1)
    velocity = np.concatenate(
        [
            np.stack([fitted_rate(x[p], time[p], VELOCITY_WINDOW), fitted_rate(y[p], time[p], VELOCITY_WINDOW)])
            for p in parts
        ],
        axis=1,
    )
    new = []
    for k in np.flatnonzero(gaps).tolist():
        at = time[k] + usual * np.arange(1, int(np.ceil(step[k] / usual - 1e-6)))
        ends = [k, k + 1]
        path = interpolate.CubicHermiteSpline(time[ends], np.stack([x[ends], y[ends]], axis=1), velocity[:, ends].T)
        turn = np.unwrap(heading[ends])
        new.append(np.column_stack([at, path(at), np.interp(at, time[ends], turn)]))
    added = np.concatenate(new)
    order = np.argsort(np.r_[time, added[:, 0]], kind="stable")
    time, x, y, heading = (np.r_[old, added[:, k]][order] for k, old in enumerate((time, x, y, heading)))
    return time, x, y, heading, (order >= len(rows))


def _passages(time: FloatArray, x: FloatArray, y: FloatArray, rows: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Stretches of the rows without a gap or a leap, `MINIMUM_PASSAGE` at least: a bad row or two end none."""
    broken = (np.diff(time[rows]) > LONGEST_GAP) | leaps(time[rows], x[rows], y[rows])
    parts = np.split(rows, np.flatnonzero(broken) + 1)
    return [part for part in parts if len(part) > 3 and time[part[-1]] - time[part[0]] >= MINIMUM_PASSAGE]


# ---- lane changes, aborted ones, lane offsets; when, how long, of what shape ----
# A transition goes from one lateral level to another; its start, duration and shape are those of the least squares.
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
