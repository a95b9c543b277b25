"""Vehicles over time in their lanes, whatever they come from, and what truly happens: lane changes and lane keeping."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray, rate
from xosc_lateral.base.segment import MINIMUM_SPEED
from xosc_lateral.base.track import Column, lane_levels
from xosc_lateral.drivers.drives.lane_changes import SETTLED_OFFSET, Course
from xosc_lateral.extras.recordings.cuts import DEFAULT_CUTS
from xosc_lateral.extras.recordings.lane_order import Order, RoadLanes, in_groups
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.motion.segments import ACROSS_LANE
from xosc_lateral.world.road.network import RoadNetwork

STEP = 0.05
"""Of everything that a detector sees: the rate of 20 Hz at which radar and camera object lists come. [s]"""
LONGEST_GAP = 1.0
"""Rows farther apart are not of one track, as in `recordings.cuts`. [s]"""
MIN_DURATION = 5.0
"""Shorter tracks hold neither lane keeping nor a whole lane change, as in `recordings.cuts`. [s]"""


@dataclass(frozen=True, eq=False, slots=True)
class LaneTrack(EntityMotion):
    """A vehicle over one unbroken stretch, at `STEP` times whole numbers."""

    cluster: str  # vehicles of one name are resampled together

    lateral = Column(np.float64, "m")  # from the centre of the first row's lane, through lane changes, positive left
    base = Column(np.float64, "m", "nearest")  # the same of the centre of each row's lane
    level = Column(np.int64, "", "nearest")  # lanes to the left of the first row's lane
    # where it is among others, see `RoadLanes.stations`
    line = Column(np.int64, "", "nearest")
    rank = Column(np.int64, "", "nearest")
    station = Column(np.float64, "m")  # of its middle
    jump = Column(np.float64, "m", "nearest")  # of stations, from those of its first line

    @property
    def first(self) -> int:
        """Number of the first instant."""
        return round(float(self.time[0]) / STEP)

    def has_lane(self, side: int) -> BoolArray:
        """Whether there is a lane beside its own, to the left (1) or the right (-1); not known: there is."""
        index, count = self.lane_index, self.lane_count
        known = np.isfinite(index) & np.isfinite(count)
        return np.asarray(~known | (index + side >= 0) & (index + side < count))


@dataclass(frozen=True, eq=False, slots=True)
class Scene:
    """Tracks that see each other."""

    name: str
    tracks: tuple[LaneTrack, ...]
    ego: str | None = None  # the vehicle whose neighbours are watched; None: everybody's
    network: RoadNetwork | None = None
    names: tuple[str, ...] = ()  # of all that the run holds, in its order, on which colours go; unknown: of the tracks


def tracks_of(motion: EntityMotion, *, cluster: str, cuts: Sequence[int] = ()) -> Iterator[LaneTrack]:
    """Unbroken stretches of a vehicle in its lanes, at even instants; `cuts`: rows at which something else begins."""
    motion.validate("offset", "lane_width", "speed", "lane_index", "lane_count", "following")
    for piece in motion.pieces(LONGEST_GAP, cuts):
        if len(piece) > 1 and piece.time[-1] - piece.time[0] >= MIN_DURATION:
            base, level = lane_levels(piece.offset, piece.lane_width)
            piece = piece.having(lateral=piece.offset + base, base=base, level=level)
            if "line" in piece.columns:
                line, station = piece.columns["line"], piece.columns["station"]
                new = np.r_[False, np.diff(line) != 0]
                jump = np.cumsum(np.where(new, np.diff(station, prepend=station[:1]), 0.0))
                piece = piece.having(station=station - jump, jump=jump)
            even = piece.every(STEP)
            yield LaneTrack(even.name, even.time, even.columns, even.breaks, even.entity, cluster)


def in_lanes(motion: EntityMotion, lanes: RoadLanes) -> EntityMotion:
    """With what the road is like where it is, and its place among others."""
    network, way = lanes.network, motion.way()
    line, rank, station = lanes.stations(motion.road, motion.lane, motion.s, way)
    index, count = network.lane_index(motion.road, motion.lane, motion.s)
    along = np.abs(np.sin(motion.heading_relative)) < np.sin(ACROSS_LANE)
    return motion.having(
        lane_width=network.lane_width(motion.road, motion.lane, motion.s),
        lane_index=index.astype(np.float64),
        lane_count=count.astype(np.float64),
        following=along & (index >= 0) & (motion.speed >= MINIMUM_SPEED * (1.0 - 1e-6)),
        line=line,
        rank=rank,
        station=station + motion.box.center_x,
    )


class Rows:
    """All rows of a scene's tracks, one track after the other, and who is next to whom."""

    def __init__(self, scene: Scene) -> None:
        self.tracks = scene.tracks
        self.begin = np.cumsum([0, *map(len, self.tracks)])
        instant = np.concatenate([track.first + np.arange(len(track)) for track in self.tracks])
        line, rank = (np.concatenate([track.columns[name] for track in self.tracks]) for name in ("line", "rank"))
        frame = np.where(line >= 0, (instant - instant.min()) * (int(line.max()) + 1) + line, -1)
        self.group, self.station = in_groups(frame, rank - rank.min()), self.of("station") + self.of("jump")
        is_seen = [scene.ego in (None, track.name) for track in self.tracks]
        names = ("x", "y", "heading", "speed", "offset", "lane_width")
        self.columns = {name: self.of(name) for name in names}
        for name in ("length", "width", "center_x"):
            self.columns[name] = np.repeat([getattr(track.box, name) for track in self.tracks], np.diff(self.begin))
        self._everybody = Order(self.group, self.station)
        self._seen = Order(np.where(np.repeat(is_seen, np.diff(self.begin)), self.group, -1), self.station)

    def of(self, column: str) -> FloatArray:
        """A column of all."""
        return np.concatenate([track.columns[column] for track in self.tracks])

    def ahead(self, row: int) -> int:
        """Row of who is next ahead in the same lane; -1: nobody."""
        rows = slice(row, row + 1)
        return int(self._everybody.next_to(self.group[rows], self.station[rows], is_ahead=True)[0])

    def beside(self, number: int, side: int) -> list[IntArray]:
        """Rows of the vehicles, with an ego of it alone, that are next ahead and not ahead of a track, row by row, in
        the lane on a side of it; -1: nobody."""
        rows = slice(self.begin[number], self.begin[number + 1])
        group = np.where(self.group[rows] >= 0, self.group[rows] + side, -1)
        return [self._seen.next_to(group, self.station[rows], is_ahead=is_ahead) for is_ahead in (True, False)]


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


def truth_of(track: LaneTrack) -> Truth:
    """Lane changes and lane keeping of a track, by its movement across the lanes alone: the same for every source."""
    n, time = len(track), track.time
    width = track.box.width
    room = np.maximum(0.5 * (track.lane_width - width), SETTLED_OFFSET)
    course = Course.across(time, track.lateral, track.base, track.level, room)
    keeping = track.following.copy()
    keeping[:EDGE_ROWS], keeping[max(n - EDGE_ROWS, 0) :] = False, False
    changes = []
    for rough in course.maneuvers():
        keeping[max(rough.first - MARGIN_ROWS, 0) : rough.last + MARGIN_ROWS + 1] = False
        if rough.lanes and not rough.cut and not rough.aborted and rough.first >= EDGE_ROWS:
            changes.append(_lane_change(track, rough.first, rough.last, 1 if rough.lanes > 0 else -1))
    return Truth(tuple(changes), keeping)


def _lane_change(track: LaneTrack, begin: int, end: int, side: int) -> LaneChange:
    level, base = track.level, track.base[begin]
    centre = begin + int(np.argmax(side * (level[begin : end + 1] - level[begin]) > 0))
    towards = side * (track.lateral[begin : centre + 1] - base)
    reached = towards + 0.5 * track.box.width >= 0.5 * track.lane_width[begin : centre + 1]
    return LaneChange(side, begin, begin + int(np.argmax(reached)) if reached.any() else centre, centre, end)


STILL_SPEED = 0.01
"""Lateral speed that nobody drives at throughout; played maneuvers come down to rounding. [m/s]"""


def moves_in_lane(track: LaneTrack, truth: Truth) -> bool:
    """Whether a vehicle moves sideways while it keeps its lane."""
    speed = np.abs(rate(track.offset, STEP, past=True))
    return bool((speed[truth.keeping] > STILL_SPEED).any())
