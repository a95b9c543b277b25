"""Tracks in their lanes, of any recording on a known road, into the standard drive table.

A table of x, y (and heading, speed, length and class where there are any) in the coordinates of an OpenDRIVE road. The
road says which lane a vehicle is in and how far from its centre, what the lane is like, and who is ahead and beside; or
lanes do that are given as shapes between two lines each.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray, blocks, rate
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd, spatial
from xosc_lateral.base.vehicle_classes import DRIVEN, TRUCKS
from xosc_lateral.drivers.drives.cleaning import RUN
from xosc_lateral.drivers.drives.drive import MAX_GAP
from xosc_lateral.drivers.drives.evidence import of_registration
from xosc_lateral.extras.recordings.cuts import (
    DEFAULT_CUTS,
    LANE_AGREEMENT,
    MOVING_SPEED,
    CutSettings,
    lane_changes,
    name_states,
    number_runs,
    require_lane_direction,
)
from xosc_lateral.extras.recordings.importers import ImportedDrives, imported, importer
from xosc_lateral.extras.recordings.importers.track_table import Tracks, read_tracks
from xosc_lateral.extras.recordings.lane_order import LaneGraph, RoadLanes
from xosc_lateral.extras.recordings.neighbours import neighbour_columns
from xosc_lateral.files.mapping import MappingLike
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.workflows.options import flag
from xosc_lateral.world.road.network import RoadNetwork

LICENCE = "your own recording"
CURVATURE_WINDOW = 20.0  # way over which a lane's turning is averaged into a curvature: bounds are polygons [m]
FACING_STEP = 5.0  # of places at which lanes beside each other are compared: 2 mm off at R = 100 m [m]
POINT_SPACING = 1.0  # of a centre line, at most, so that the nearest point is next to a foot on it [m]
END_TOLERANCE = 1e-3  # a foot that lies farther than this before the start or past the end is outside [m]


@dataclass(eq=False)
class PlacedTracks:
    """Tracks and where each of their rows lies; arrays of shape (n,). `drive_table` takes out what it has used."""

    tracks: Tracks
    piece: IntArray  # of the lane graph; -1: in no lane
    along: FloatArray  # way of x, y from the piece's start, in the direction of travel [m]
    offset: FloatArray  # offset, lane_width: NaN in no lane [m]
    lane_width: FloatArray
    agreement: FloatArray  # cosine of the way and the lane's direction; NaN in no lane [-]
    road: Mapping[str, FloatArray] = field(default_factory=dict)  # columns that it has there: curvature, lane_index ...
    scale: FloatArray | float = 1.0  # metres along the lane per metre of `along` [-]

    def notes(self) -> tuple[str, ...]:
        """Those of the tracks, and whether they lie beside their lanes."""
        shift = of_registration(self.offset, self.lane_width, self.tracks.vehicle, self.tracks.heading)
        return (*self.tracks.notes, *([shift] if shift else []))

    def take(self, name: str) -> Any:
        """A column that nobody asks for after this: millions of rows are there once."""
        values = getattr(self, name)
        setattr(self, name, np.zeros(0))
        return values


@importer
def import_tracks(
    source: Path, *,
    road: Annotated[Path | str, flag("--road", kind=Path, metavar="FILE.xodr", help="Road on which the tracks lie.")],
    columns: MappingLike | None = None,
    settings: CutSettings = DEFAULT_CUTS,
) -> ImportedDrives:  # fmt: skip
    """A table of tracks (x, y and heading of any recording) on a known road: lanes, offsets, neighbours.

    `source`: table of one row per vehicle and instant, or a log of esmini (``--csv_logger``); x and y are the vehicle's
    middle, or lie `rear` behind it, in the road's coordinates.
    """
    network = read_opendrive(road)
    placed, graph = place_on_road(read_tracks(source, columns), network)
    require_lanes(placed, Path(road).name, source)
    sources, far = [source, Path(road)], mostly_beside(placed)
    return import_placed(placed, graph, settings, format="tracks", sources=sources, licence=LICENCE, notes=far)


def place_on_road(tracks: Tracks, network: RoadNetwork) -> tuple[PlacedTracks, LaneGraph]:
    """Every row's driving lane, and what the road is like there; x and y are inertial: the header's offset goes."""
    lanes = RoadLanes(network)
    if not len(lanes.graph.length):
        raise FormatError("the road has no driving lane that tracks could lie in", path=network.path)
    n, names = len(tracks.x), ("curvature", "lane_index", "lane_count", "crossfall", "grade")
    piece, along, scale = np.full(n, -1), np.zeros(n), np.ones(n)
    offset, width, agreement, *values = (np.full(n, np.nan) for _ in range(3 + len(names)))
    columns = dict(zip(names, values, strict=True))
    for rows in blocks(n):
        x, y = network.header_offset.undo(tracks.x[rows], tracks.y[rows])
        heading = tracks.heading[rows] - network.header_offset.heading
        place = network.world_to_lane(x, y, heading=heading)
        inside = np.flatnonzero((place.distance <= 0.0) & (place.lane != 0))
        number, way = lanes.place(place.road[inside], place.lane[inside], place.s[inside])
        on, inside = number >= 0, inside[number >= 0]
        where, there = (place.road[inside], place.lane[inside], place.s[inside]), rows.start + inside
        piece[there], along[there], offset[there] = number[on], way[on], place.offset[inside]
        width[there] = network.lane_width(*where)
        agreement[there] = np.cos(heading[inside] - network.lane_to_world(*where).heading)
        scale[there] = 1.0 - network.curvature(where[0], where[2]) * network.lane_centre_t(*where)
        seen = network.lane_curvature(*where), *network.lane_index(*where), *network.lean(*where)
        for column, part in zip(values, seen, strict=True):
            column[there] = part
    return PlacedTracks(tracks, piece, along, offset, width, agreement, columns, scale), lanes.graph


def mostly_beside(placed: PlacedTracks) -> list[str]:
    """A line, where a road that was given holds less than half of the rows."""
    beside = 100 * float((placed.piece < 0).mean())
    far = f"{beside:.0f} % of the rows lie in no lane: are the road and x, y in the same coordinates and units?"
    return [far] if beside > 50 else []


def require_lanes(placed: PlacedTracks, where: str, path: Path) -> None:
    """Refuse tracks that lie beside all lanes, or drive against them. Raises `FormatError`."""
    require_lane_direction(placed.agreement, placed.tracks.speed, where, path)
    if not (placed.piece >= 0).any():
        x, y = placed.tracks.x, placed.tracks.y
        there = f"x from {x.min():.1f} to {x.max():.1f} m, y from {y.min():.1f} to {y.max():.1f} m"
        what = f"no row lies in a driving lane of {where}: {there}; are both in the same coordinates?"
        raise FormatError(what, path=path)


def import_placed(
    placed: PlacedTracks, graph: LaneGraph, settings: CutSettings, *, only: Collection[str] | None = None, **about: Any
) -> ImportedDrives:
    """Neighbours, cuts and record, see `imported`; of the vehicles in `only` alone, if it is given."""
    if placed.tracks.step > MAX_GAP:
        what = f"rows are {placed.tracks.step:.4g} s apart (median): from {MAX_GAP:g} s on no drive can be made of them"
        raise FormatError(what, path=about["sources"][0], element="column 'time'")
    notes = tuple(dict.fromkeys((*about.pop("notes", ()), *placed.notes())))
    table = drive_table(placed, graph, settings)
    if only is not None:
        table = table[table["drive"].isin(only)].reset_index(drop=True)
    return imported(
        table, settings=asdict(settings), step=placed.tracks.step, dropped=placed.tracks.dropped, notes=notes, **about
    )  # fmt: skip


def drive_table(
    placed: PlacedTracks, beside: LaneGraph | Mapping[str, FloatArray], settings: CutSettings
) -> pd.DataFrame:
    """The standard columns, with `state`: which rows are cut, and why; `beside`: columns of neighbours, or the lanes
    in which they are sought."""
    tracks, inside = placed.tracks, placed.piece >= 0
    is_truck = np.isin(tracks.kind, list(TRUCKS))
    against = (tracks.speed > MOVING_SPEED) & (placed.take("agreement") < 0.0)
    reasons = {"no vehicle": ~np.isin(tracks.kind, ["", *DRIVEN]), "no lane": ~inside}
    reasons |= {"against the lane": against & inside} if against.any() else {}
    along = placed.take("along")
    middle = along if tracks.rear is None else along + tracks.rear  # gaps count from there
    gone: Any = np.zeros(0)
    tracks = placed.tracks = replace(tracks, x=gone, y=gone, heading=gone, width=None, height=None, rear=None)
    del along
    near = beside if isinstance(beside, Mapping) else neighbour_columns(
        beside, placed.take("piece"), middle, tracks.clock(), tracks.vehicle, tracks.step, tracks.speed, tracks.length,
        is_truck, scale=placed.take("scale"),
    )  # fmt: skip
    del middle
    vehicle, time, speed, kind = tracks.vehicle, tracks.time, tracks.speed, tracks.kind
    tracks = placed.tracks = replace(tracks, vehicle=gone, time=gone, speed=gone, kind=gone, length=gone)
    acceleration = rate(speed, time, 1.0, whose=vehicle)
    # A number that changes with the lane, and lateral position without jumps: a new piece ahead is no new lane.
    step = np.diff(placed.offset, prepend=placed.offset[:1])
    same = np.r_[False, vehicle[1:] == vehicle[:-1]]
    jump = same & (np.abs(step) > 0.5 * placed.lane_width)
    lane = np.cumsum(jump | (np.r_[False, inside[1:] != inside[:-1]] & same) | ~same).astype(np.int64)
    sideways = np.cumsum(np.where(jump | ~same | ~np.isfinite(step), 0.0, step))
    del step, same, jump
    reasons["lane change"] = lane_changes(sideways, placed.offset, lane, vehicle, time, settings)
    del sideways
    state = name_states(reasons, lane, vehicle, time, tracks.step, settings)
    runs = number_runs(state, lane, vehicle, time)
    del lane
    words = pd.concat([pd.Series(kind[part], dtype=str) for part in blocks(len(kind))], ignore_index=True).array
    del kind
    names = pd.Series(tracks.names, dtype=str).take(vehicle).array
    del vehicle
    return pd.DataFrame(
        {
            "drive": names,
            "time": np.round(time, 4),
            "offset": placed.offset,
            "lane_width": placed.lane_width,
            "speed": speed,
            "acceleration": acceleration,
            **placed.road,
            **near,
            "vehicle_class": words,
            "is_truck": is_truck.astype(np.float64),
            RUN: runs,
            "state": state,
        },
        copy=False,
    )


# ---- lanes between two lines each ------------------------------------------------------------------------------------


class LaneShape(ABC):
    """A lane between its boundaries, in coordinates along and across its centre line, shape (n, 2 or 3). [m]"""

    def __init__(self, centre: FloatArray, boundaries: Sequence[FloatArray], beyond: float = 0.0) -> None:
        self.centre = centre
        self.left, self.right = boundaries
        self.step = np.diff(centre[:, :2], axis=0)
        self.size = np.hypot(*self.step.T)
        self.start = np.concatenate([[0.0], np.cumsum(self.size)])
        self.length = float(self.start[-1])
        self.direction = np.unwrap(np.arctan2(self.step[:, 1], self.step[:, 0]))
        both = np.concatenate(boundaries)[:, :2]
        self.low, self.high = both.min(axis=0) - beyond, both.max(axis=0) + beyond

    def may_hold(self, x: FloatArray, y: FloatArray) -> NDArray[np.bool_]:
        """Points in the box about it, shape as the arguments."""
        return np.asarray((x >= self.low[0]) & (x <= self.high[0]) & (y >= self.low[1]) & (y <= self.high[1]))

    @abstractmethod
    def place(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, ...]:
        """Way along the centre line (NaN beyond its ends), offset from the middle of the boundaries, width, direction
        and curvature there; shape as the arguments. [m], [m], [m], [rad], [1/m]
        """


def place_in_shapes(tracks: Tracks, shapes: Sequence[LaneShape], left: IntArray) -> PlacedTracks:
    """Every row in the lane that it drives along, amid which it is; `left`: on the left of each lane, driven the same
    way, or -1. The agreement is that with lanes driven another way, too."""
    n, x, y = len(tracks.x), tracks.x, tracks.y
    piece = np.full(n, -1)
    along, offset, width, curvature, agreement = (np.full(n, np.nan) for _ in range(5))
    nearest = np.full(n, np.inf)
    for number, shape in enumerate(shapes):
        near = np.flatnonzero(shape.may_hold(x, y))
        if not len(near):
            continue
        way, aside, wide, ahead, bend = shape.place(x[near], y[near])
        inside = (np.abs(aside) <= 0.5 * wide) & np.isfinite(way)
        along_lane = np.cos(tracks.heading[near] - ahead)
        agreement[near[inside]] = np.fmax(agreement[near[inside]], along_lane[inside])
        better = inside & (along_lane > LANE_AGREEMENT) & (np.abs(aside) < nearest[near])
        rows = near[better]
        piece[rows], nearest[rows] = number, np.abs(aside[better])
        along[rows], offset[rows], width[rows], curvature[rows] = way[better], aside[better], wide[better], bend[better]
    index, count = (np.where(piece >= 0, lanes[piece], np.nan) for lanes in lanes_beside(left))
    road = {"curvature": curvature, "lane_index": index, "lane_count": count}
    return PlacedTracks(tracks, piece, np.nan_to_num(along), offset, width, agreement, road)


def lanes_beside(left: IntArray) -> tuple[IntArray, IntArray]:
    """Lanes to the right of each lanelet that are driven the same way, and all of them, itself included."""
    right = np.full(len(left), -1)
    right[left[left >= 0]] = np.flatnonzero(left >= 0)
    counts = []
    for next_lane in (right, left):
        steps, here = np.zeros(len(left), dtype=np.int64), next_lane
        while (here >= 0).any() and steps.max() < len(left):
            steps += here >= 0
            here = np.where(here >= 0, next_lane[here], -1)
        counts.append(steps)
    return counts[0], counts[0] + counts[1] + 1


def graph_of_shapes(shapes: Sequence[LaneShape], left: IntArray, following: Sequence[Sequence[int]]) -> LaneGraph:
    """Lanes and how they hang together; what lies side by side on a curve has the same station."""
    facing = {}
    for number in np.flatnonzero(left >= 0).tolist():
        for lane, other in ((number, int(left[number])), (int(left[number]), number)):
            shape = shapes[lane]
            way = np.linspace(0.0, shape.length, int(np.ceil(shape.length / FACING_STEP)) + 1)
            x, y = (np.interp(way, shape.start, shape.centre[:, axis]) for axis in (0, 1))
            other_way = shapes[other].place(x, y)[0]
            known = np.isfinite(other_way)
            if known.sum() > 1:
                facing[lane, other] = way[known], np.maximum.accumulate(other_way[known])
    return LaneGraph(np.array([shape.length for shape in shapes]), left, following, facing)


def curvature_along(start: FloatArray, direction: FloatArray, way: FloatArray) -> FloatArray:
    """Smoothed curvature [1/m] at ways along a polyline, by the way to its points and its pieces' direction."""
    middles = 0.5 * (start[1:] + start[:-1])
    half = 0.5 * CURVATURE_WINDOW
    bend = np.interp(way + half, middles, direction) - np.interp(way - half, middles, direction)
    span = np.minimum(way + half, middles[-1]) - np.maximum(way - half, middles[0])
    return np.asarray(np.where(span > 1.0, bend / np.maximum(span, 1.0), 0.0))


class Strip(LaneShape):
    """A lane between lines in the direction of travel, shape (n, 3); the centre may lie anywhere between. [m]"""

    def __init__(self, centre: FloatArray, left: FloatArray, right: FloatArray) -> None:
        super().__init__(_dense(centre), [left, right], END_TOLERANCE)
        self._tree = spatial.cKDTree(self.centre[:, :2])
        self._left, self._right = self._edge(left), self._edge(right)

    def _edge(self, line: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """A boundary as way along, offset from the centre line and height, in order of the way."""
        dense = _dense(line)
        way, aside, _, _ = self._foot(dense[:, 0], dense[:, 1])
        order = np.argsort(way, kind="stable")
        return way[order], aside[order], dense[order, 2]

    def place(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, ...]:
        """See `LaneShape`."""
        way, aside, k, beyond = self._foot(x, y)
        left, right = (np.interp(way, edge[0], edge[1]) for edge in (self._left, self._right))
        high, low = (np.interp(way, edge[0], edge[2]) for edge in (self._left, self._right))
        lean = np.hypot(left - right, high - low) / np.maximum(left - right, 1e-6)  # across the surface, as roads count
        outside = np.abs(beyond) > END_TOLERANCE
        curvature = curvature_along(self.start, self.direction, way)
        offset, width = lean * (aside - 0.5 * (left + right)), lean * (left - right)
        return np.where(outside, np.nan, way), offset, width, self.direction[k], curvature

    def _foot(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, NDArray[np.intp], FloatArray]:
        """Way along, distance to the left, number of the piece, and how far past its ends; shape as the arguments."""
        points = np.stack([x, y], axis=1)
        nearest = np.asarray(self._tree.query(points)[1], dtype=np.intp)
        before, after = (self._on(points, np.clip(nearest + side, 0, len(self.size) - 1)) for side in (-1, 0))
        is_before = before[4] <= after[4]
        way, aside, k, beyond = (np.where(is_before, *both) for both in zip(before[:4], after[:4], strict=True))
        return way, aside, k, beyond

    def _on(self, points: FloatArray, k: NDArray[np.intp]) -> tuple[Any, ...]:
        """The same on one piece each, and the distance from it squared."""
        along = self.step[k] / self.size[k][:, None]
        about = points - self.centre[k, :2]
        ahead = (about * along).sum(axis=1)
        aside = along[:, 0] * about[:, 1] - along[:, 1] * about[:, 0]
        held = np.clip(ahead, 0.0, self.size[k])
        past = np.where((k == 0) & (ahead < 0.0), ahead, 0.0)
        past = np.where((k == len(self.size) - 1) & (ahead > self.size[k]), ahead - self.size[k], past)
        return self.start[k] + held, aside, k, past, (ahead - held) ** 2 + aside**2


def middle(left: FloatArray, right: FloatArray) -> FloatArray:
    """A line between two others that are driven the same way, shape (n, 3). [m]"""
    shares = [way / way[-1] for way in map(_way, (left, right))]
    every = np.union1d(*shares)
    ends = [
        np.stack([np.interp(every, share, line[:, axis]) for axis in (0, 1, 2)], axis=1)
        for share, line in zip(shares, (left, right), strict=True)
    ]
    return np.asarray(0.5 * (ends[0] + ends[1]))


def _way(line: FloatArray) -> FloatArray:
    return np.asarray(np.r_[0.0, np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T))])


def _dense(line: FloatArray) -> FloatArray:
    """Without points that are there twice, and none farther from the next than `POINT_SPACING`."""
    line = line[np.r_[True, np.hypot(*np.diff(line[:, :2], axis=0).T) > 1e-9]]
    size, way = np.hypot(*np.diff(line[:, :2], axis=0).T), _way(line)
    count = np.maximum(np.ceil(size / POINT_SPACING).astype(np.int64), 1)
    piece = np.repeat(np.arange(len(size)), count)
    within = np.concatenate([np.arange(n) / n for n in count]) if len(count) else np.zeros(0)
    at = np.append(way[piece] + within * size[piece], way[-1])
    return np.stack([np.interp(at, way, line[:, axis]) for axis in (0, 1, 2)], axis=1)
