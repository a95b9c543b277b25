"""A recorded vehicle in the lanes of a road, row by row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.track import lane_levels
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.road.network import RoadNetwork

MARKING_TOLERANCE = 1.0  # so far beside every driving lane a vehicle still keeps to one: it drives on its marking [m]
LONGEST_GAP = 1.0  # rows farther apart than this are not of one passage, as in `recordings.cuts` [s]
MAXIMUM_COORDINATE = 1e8  # no map projection gives such a position: the Earth's circumference is 4e7 m [m]
SHORTEST_STEP = 1e-4  # rows that follow sooner are of the same moment: no sensor has 10 kHz [s]
MINIMUM_PASSAGE = 2.0  # passages below this are left out: a speed and its change can't be told in less [s]
LEAP_DISTANCE = 1.5  # farther than it can have driven (half a narrow lane): the identifier is another vehicle's now [m]
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
    """Each vehicle's longest passage in driving lanes within a window of time. Raises `NotEnoughDataError`."""
    vehicles, left_out = list[EntityMotion](), list[str]()
    for track in tracks:
        inside = (np.hypot(track.x, track.y) < MAXIMUM_COORDINATE) & np.isfinite(track.heading)
        rows = np.flatnonzero(inside & (track.time >= start - 1e-9) & (track.time <= end + 1e-9))
        if len(rows):
            rows = rows[np.r_[True, np.diff(track.time[rows]) > SHORTEST_STEP]]
            vehicle = _place(track, rows, network, left_out, start)
            if vehicle is not None:
                vehicles.append(vehicle)
    if not vehicles:
        why = f": {left_out[0]}" if left_out else ""
        raise NotEnoughDataError(f"no vehicle can be reconstructed between {start:g} and {end:g} s{why}")
    return Recording(tuple(vehicles), tuple(left_out), start, end)


def _place(
    track: RecordedTrack, rows: NDArray[np.intp], network: RoadNetwork, left_out: list[str], start: float
) -> EntityMotion | None:
    time, x, y = track.time[rows], track.x[rows], track.y[rows]
    velocity = np.stack([_slope(time, x), _slope(time, y)])
    heading = _steady_heading(time, x, y, velocity, track.heading[rows], network)
    x, y = x - track.ahead * np.cos(heading), y - track.ahead * np.sin(heading)
    nearest = network.world_to_lane(x, y, heading=heading)
    on_lane = (nearest.distance <= MARKING_TOLERANCE) & (nearest.lane != 0)
    if not on_lane.any():
        left_out.append(f"{track.name}: on no driving lane")
        return None
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
    reasons = {"off the lanes": int((~on_lane).sum()), "across a lane or backwards": int(elsewhere.sum())}
    if not passages:
        counts = "".join(f", {rows} of {len(time)} rows {why}" for why, rows in reasons.items() if rows)
        left_out.append(f"{track.name}: no {MINIMUM_PASSAGE:g} s along a driving lane without a gap{counts}")
        return None
    best = max(passages, key=lambda part: time[part[-1]] - time[part[0]])
    lost = len(time) - len(best)
    if lost:
        reasons["beyond them, a gap or a leap"] = lost - sum(reasons.values())
        counts = ", ".join(f"{rows} {why}" for why, rows in reasons.items() if rows > 0)
        left_out.append(f"{track.name}: {lost} of {len(time)} rows: {counts}")
    moments, x, y, turned = time[best] - start, x[best], y[best], np.where(way[best] < 0, np.pi, 0.0)
    step = np.maximum(np.gradient(moments), 1e-6)
    return EntityMotion.of(
        track.entity, moments, x=x, y=y, heading=lane_heading[best] + turned, heading_relative=turned,
        speed=np.hypot(np.gradient(x) / step, np.gradient(y) / step), road=nearest.road[best], lane=nearest.lane[best],
        s=nearest.s[best], offset=nearest.offset[best], lane_width=width[best],
    )  # fmt: skip


def _slope(time: FloatArray, values: FloatArray) -> FloatArray:
    """Rate of change at each row, by least squares over `VELOCITY_WINDOW`; shape (n,)."""
    if len(time) < 2:
        return np.zeros(len(time))
    half = 0.5 * VELOCITY_WINDOW + 1e-6
    first = np.minimum(np.searchsorted(time, time - half), np.maximum(np.arange(len(time)) - 1, 0))
    last = np.maximum(np.searchsorted(time, time + half), np.minimum(np.arange(len(time)) + 2, len(time)))
    t, v = time - time.mean(), values - values.mean()

    def total(terms: FloatArray) -> FloatArray:
        sums = np.r_[0.0, np.cumsum(terms)]
        return np.asarray(sums[last] - sums[first])

    count = (last - first).astype(np.float64)
    spread = count * total(t * t) - total(t) ** 2
    return np.asarray((count * total(t * v) - total(t) * total(v)) / spread)


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


def _passages(time: FloatArray, x: FloatArray, y: FloatArray, rows: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Stretches of the rows without a gap or a leap, `MINIMUM_PASSAGE` at least: a bad row or two end none."""
    from scipy.ndimage import median_filter

    step = np.maximum(np.diff(time[rows]), 1e-9)
    broken = step > LONGEST_GAP
    if len(step):
        moved = np.diff(x[rows]), np.diff(y[rows])
        vx, vy = (median_filter(each / step, 5, mode="nearest") for each in moved)
        about = np.maximum(np.hypot(vx, vy), 1.0)
        across = (moved[1] * vx - moved[0] * vy) / about
        # twice as far as about that time, or turned by more than 30 degrees
        broken |= np.hypot(*moved) > 2.0 * about * step + LEAP_DISTANCE
        broken |= np.abs(across) > 0.5 * about * step + LEAP_DISTANCE
    parts = np.split(rows, np.flatnonzero(broken) + 1)
    return [part for part in parts if len(part) > 3 and time[part[-1]] - time[part[0]] >= MINIMUM_PASSAGE]
