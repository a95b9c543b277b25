"""A recorded vehicle in the lanes of a road, row by row."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, count

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray, fitted_rate, rate, true_slices
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.track import lane_levels
from xosc_lateral.drivers.drives.identity import LONGEST_BRIDGE, LONGEST_GAP, leaps
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.road.network import RoadNetwork

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
    from scipy.interpolate import CubicHermiteSpline

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
        path = CubicHermiteSpline(time[ends], np.stack([x[ends], y[ends]], axis=1), velocity[:, ends].T)
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
