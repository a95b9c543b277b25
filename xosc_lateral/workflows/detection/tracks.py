"""Vehicles over time in their lanes, whatever they come from, and what truly happens: lane changes and lane keeping."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.drivers.drives.lane_changes import SETTLED_OFFSET, Course, lane_levels
from xosc_lateral.workflows.recordings.cuts import DEFAULT_CUTS
from xosc_lateral.world.road.network import RoadNetwork

STEP = 0.05
"""Of everything that a detector sees: the rate of 20 Hz at which radar and camera object lists come. [s]"""
MAX_GAP = 1.0
"""Rows farther apart are not of one track, as in `recordings.cuts`. [s]"""
MIN_DURATION = 5.0
"""Shorter tracks hold neither lane keeping nor a whole lane change, as in `recordings.cuts`. [s]"""


class Size(NamedTuple):
    """Box of a vehicle, and its middle ahead of the reference point, the rear axle. [m]"""

    length: float
    width: float
    ahead: float


@dataclass(frozen=True, eq=False, slots=True)
class Rows:
    """Rows of a vehicle as a source has them, any step; arrays of shape (n,)."""

    time: FloatArray  # [s]
    offset: FloatArray  # from its lane's centre, positive left [m]
    lane_width: FloatArray  # [m]
    speed: FloatArray  # [m/s]
    lane_index: FloatArray  # 0: rightmost driving lane; NaN: not known
    lane_count: FloatArray  # NaN: not known
    following: BoolArray  # in a driving lane at 40 km/h or more
    x: FloatArray  # x, y, heading: of the reference point; NaN: not known [m], [rad]
    y: FloatArray
    heading: FloatArray
    road: IntArray  # index in the network, OpenDRIVE lane, way along it; -1, 0, 0: not known
    lane: IntArray
    s: FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class Track:
    """A vehicle over one unbroken stretch, with the columns of `Rows` at even instants; arrays of shape (n,)."""

    name: str
    cluster: str  # vehicles of one name are resampled together
    size: Size
    first: int  # number of the first instant: its time is `STEP` times that
    rows: Rows
    lateral: FloatArray  # from the centre of the first row's lane, continuous through lane changes, positive left [m]
    base: FloatArray  # the same of the centre of each row's lane [m]
    level: IntArray  # lanes to the left of the first row's lane

    def __len__(self) -> int:
        return len(self.lateral)

    @property
    def time(self) -> FloatArray:
        """[s]"""
        return self.rows.time

    def has_lane(self, side: int) -> BoolArray:
        """Whether there is a lane beside its own, to the left (1) or the right (-1); not known: there is."""
        index, count = self.rows.lane_index, self.rows.lane_count
        known = np.isfinite(index) & np.isfinite(count)
        return np.asarray(~known | (index + side >= 0) & (index + side < count))


@dataclass(frozen=True, eq=False, slots=True)
class Scene:
    """Tracks that see each other."""

    name: str
    tracks: tuple[Track, ...]
    ego: str | None = None  # the vehicle whose neighbours are watched; None: everybody's
    network: RoadNetwork | None = None


def tracks_of(name: str, rows: Rows, size: Size, *, cluster: str, cuts: Sequence[int] = ()) -> Iterator[Track]:
    """Unbroken stretches of a vehicle's rows, at even instants; `cuts`: rows at which something else begins."""
    broken = np.flatnonzero(np.diff(rows.time) > MAX_GAP) + 1
    edges = sorted({0, *broken.tolist(), *cuts, len(rows.time)})
    for begin, end in pairwise(edges):
        if end - begin > 1 and rows.time[end - 1] - rows.time[begin] >= MIN_DURATION:
            yield _even(name, cluster, size, rows, slice(begin, end))


def _even(name: str, cluster: str, size: Size, rows: Rows, part: slice) -> Track:
    time, offset, width = rows.time[part], rows.offset[part], rows.lane_width[part]
    base, level = lane_levels(offset, width)
    first, last = int(np.ceil(time[0] / STEP - 1e-6)), int(np.floor(time[-1] / STEP + 1e-6))
    at = STEP * np.arange(first, last + 1)
    nearest = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
    nearest -= at - time[nearest - 1] < time[nearest] - at

    def line(values: FloatArray) -> FloatArray:
        return np.asarray(np.interp(at, time, values))

    lateral, here = line(offset + base), base[nearest]
    whole = rows.lane_index[part][nearest], rows.lane_count[part][nearest], rows.following[part][nearest]
    heading = np.asarray(np.unwrap(rows.heading[part]), dtype=np.float64)
    x, y, turned = (line(values) for values in (rows.x[part], rows.y[part], heading))
    place = rows.road[part][nearest], rows.lane[part][nearest], rows.s[part][nearest]
    instants: FloatArray = at.astype(np.float64)
    even = Rows(instants, lateral - here, line(width), line(rows.speed[part]), *whole, x, y, turned, *place)
    return Track(name, cluster, size, first, even, lateral, here, level[nearest])


# ---- what truly happens ----
MARGIN_ROWS = round(DEFAULT_CUTS.margin / STEP)
"""No lane keeping is counted so near to a lane change, and an alarm so shortly before it has seen it: its beginning is
known no better. [rows]"""
EDGE_ROWS = round(DEFAULT_CUTS.edge / STEP)
"""Nor so near to the ends of a track, where a lane change may begin or end unseen. [rows]"""


@dataclass(frozen=True, slots=True)
class LaneChange:
    """Rows of a track between which it changes lanes."""

    side: int  # 1: to the left, -1: to the right
    begin: int  # last row without movement to that side of 0.1 m/s or more
    crossing: int  # first row with the vehicle's side on the marking
    centre: int  # first row with the vehicle's reference point in the other lane
    end: int  # first row without that movement, near the new lane's centre


@dataclass(frozen=True, eq=False, slots=True)
class Truth:
    """Lane changes that were seen from their beginning, and rows of lane keeping, shape (n,)."""

    changes: tuple[LaneChange, ...]
    keeping: BoolArray


def truth_of(track: Track) -> Truth:
    """Lane changes and lane keeping of a track, by its movement across the lanes alone: the same for every source."""
    n, time = len(track), track.time
    width = track.size.width
    room = np.maximum(0.5 * (track.rows.lane_width - width), SETTLED_OFFSET)
    course = Course.across(time, track.lateral, track.base, track.level, room)
    keeping = track.rows.following.copy()
    keeping[:EDGE_ROWS], keeping[max(n - EDGE_ROWS, 0) :] = False, False
    changes = []
    for rough in course.maneuvers():
        keeping[max(rough.first - MARGIN_ROWS, 0) : rough.last + MARGIN_ROWS + 1] = False
        if rough.lanes and not rough.cut and not rough.aborted and rough.first >= EDGE_ROWS:
            changes.append(_lane_change(track, rough.first, rough.last, 1 if rough.lanes > 0 else -1))
    return Truth(tuple(changes), keeping)


def _lane_change(track: Track, begin: int, end: int, side: int) -> LaneChange:
    level, base = track.level, track.base[begin]
    centre = begin + int(np.argmax(side * (level[begin : end + 1] - level[begin]) > 0))
    towards = side * (track.lateral[begin : centre + 1] - base)
    reached = towards + 0.5 * track.size.width >= 0.5 * track.rows.lane_width[begin : centre + 1]
    return LaneChange(side, begin, begin + int(np.argmax(reached)) if reached.any() else centre, centre, end)


STILL_SPEED = 0.01
"""Lateral speed that nobody drives at throughout; played maneuvers come down to rounding. [m/s]"""


def moves_in_lane(track: Track, truth: Truth) -> bool:
    """Whether a vehicle moves sideways while it keeps its lane."""
    rate = np.abs(np.diff(track.rows.offset, prepend=track.rows.offset[:1])) / STEP
    return bool((rate[truth.keeping] > STILL_SPEED).any())
