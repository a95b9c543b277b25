"""Tracks in their lanes, of any recording on a known road, into the standard drive table.

A table of x, y (and heading, speed, length and class where there are any) in the coordinates of an OpenDRIVE road. The
road says which lane a vehicle is in and how far from its centre, what the lane is like, and who is ahead and beside.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.files.mapping import MappingLike
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.workflows.options import MAPPING, flag
from xosc_lateral.workflows.recordings.cuts import (
    DEFAULT_CUTS,
    MOVING_SPEED,
    CutSettings,
    Rows,
    cut_table,
    require_lane_direction,
)
from xosc_lateral.workflows.recordings.importers import ImportedDrives, imported, importer
from xosc_lateral.workflows.recordings.importers.track_table import Tracks, rate, read_tracks
from xosc_lateral.workflows.recordings.lane_graph import LaneGraph, neighbour_columns
from xosc_lateral.world.road.lanes import DRIVING, beside
from xosc_lateral.world.road.network import RoadNetwork

LICENCE = "your own recording"
INTO_NEXT = 1e-3  # step beyond a section's end that brings one into the next [m]
Piece = tuple[int, int, int]  # road, lane section, lane


@importer
def import_tracks(
    source: Path, *,
    road: Annotated[Path | str, flag("--road", kind=Path, metavar="FILE.xodr", help="Road on which the tracks lie.")],
    columns: Annotated[Sequence[str], flag("--map", kind=list[str] | None, metavar="NAME=COLUMN[:UNIT]",
        help="vehicle, time, x, y, heading, speed, length, vehicle_class, e.g. heading=psi:deg.")] = (),
    mapping: Annotated[MappingLike | None, MAPPING] = None,
    settings: CutSettings = DEFAULT_CUTS,
) -> ImportedDrives:  # fmt: skip
    """A table of tracks (x, y and heading of any recording) on a known road: lanes, offsets, neighbours.

    `source`: table of one row per vehicle and instant, or a log of esmini (``--csv_logger``); x and y are the vehicle's
    middle, or lie `rear` behind it, in the road's coordinates.
    """
    network = read_opendrive(road)
    placed, graph = place_on_road(read_tracks(source, columns, mapping), network)
    require_lanes(placed, Path(road).name, source)
    sources = [source, Path(road)]
    return import_placed(placed, graph, settings, format="tracks", sources=sources, licence=LICENCE)


def place_on_road(tracks: Tracks, network: RoadNetwork) -> tuple[PlacedTracks, LaneGraph]:
    """Every row's driving lane, and what the road is like there; x and y are inertial: the header's offset goes."""
    pieces, graph = lane_graph(network)
    if not pieces:
        raise FormatError("the road has no driving lane that tracks could lie in", path=network.path)
    x, y = network.header_offset.undo(tracks.x, tracks.y)
    heading = tracks.heading - network.header_offset.heading
    place = network.world_to_lane(x, y, heading=heading)
    piece, along = np.full(len(tracks.x), -1), np.zeros(len(tracks.x))
    inside = np.flatnonzero((place.distance <= 0.0) & (place.lane != 0))
    road, lane, s = place.road[inside], place.lane[inside], place.s[inside]
    number = np.array([network.roads[r].section_number(at) for r, at in zip(road.tolist(), s.tolist(), strict=True)])
    for index, k, name in sorted(set(zip(road.tolist(), number.tolist(), lane.tolist(), strict=True))):
        mine = (road == index) & (number == k) & (lane == name)
        section, forward = network.roads[index].sections[k], network.travel_direction(index, name) > 0
        piece[inside[mine]] = pieces.get((index, k, name), -1)
        along[inside[mine]] = s[mine] - section.start if forward else section.end - s[mine]
    there = np.flatnonzero(piece >= 0)
    where = place.road[there], place.lane[there], place.s[there]

    def known(values: NDArray[Any]) -> FloatArray:
        column = np.full(len(piece), np.nan)
        column[there] = values
        return column

    names = ("curvature", "lane_index", "lane_count", "crossfall", "grade")
    values: list[NDArray[Any]]
    values = [network.lane_curvature(*where), *network.lane_index(*where), *network.lean(*where)]
    columns = dict(zip(names, map(known, values), strict=True))
    offset, width = np.where(piece >= 0, place.offset, np.nan), known(network.lane_width(*where))
    agreement = known(np.cos(heading[there] - network.lane_to_world(*where).heading))
    scale = known(1.0 - network.curvature(where[0], where[2]) * network.lane_centre_t(*where))
    return PlacedTracks(tracks, piece, along, offset, width, agreement, columns, np.nan_to_num(scale, nan=1.0)), graph


def lane_graph(network: RoadNetwork) -> tuple[dict[Piece, int], LaneGraph]:
    """Driving lanes of all sections, and how they hang together."""
    pieces: dict[Piece, int] = {}
    length = []
    for index, road in enumerate(network.roads):
        for k, section in enumerate(road.sections):
            for lane in section.lanes:
                if lane.type in DRIVING:
                    pieces[index, k, lane.id] = len(pieces)
                    length.append(section.end - section.start)
    left, following = np.full(len(pieces), -1), list[list[int]]()
    for (index, k, name), number in pieces.items():
        forward = network.travel_direction(index, name) > 0
        other = beside(name, 1 if forward else -1)
        if network.travel_direction(index, other) == network.travel_direction(index, name):
            left[number] = pieces.get((index, k, other), -1)
        section = network.roads[index].sections[k]
        end = section.end - INTO_NEXT if forward else section.start + INTO_NEXT
        step = network.advance(index, name, end, 2 * INTO_NEXT)
        next_piece = step.road, network.roads[step.road].section_number(step.s), step.lane
        ahead = pieces.get(next_piece, number) if step.remaining <= 0.0 else number
        following.append([] if ahead == number else [ahead])
    return pieces, LaneGraph(np.array(length), left, following)


TRUCKS = ("truck", "bus", "trailer", "semitrailer", "lorry", "van_trailer", "truck_trailer")


@dataclass(frozen=True, eq=False)
class PlacedTracks:
    """Tracks and where each of their rows lies; arrays of shape (n,)."""

    tracks: Tracks
    piece: IntArray  # of the lane graph; -1: in no lane
    along: FloatArray  # way of x, y from the piece's start, in the direction of travel [m]
    offset: FloatArray  # offset, lane_width: NaN in no lane [m]
    lane_width: FloatArray
    agreement: FloatArray  # cosine of the way and the lane's direction; NaN in no lane [-]
    road: Mapping[str, FloatArray] = field(default_factory=dict)  # columns that it has there: curvature, lane_index ...
    scale: FloatArray | float = 1.0  # metres along the lane per metre of `along` [-]


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
    table = _drive_table(placed, graph, settings)
    if only is not None:
        table = table[table["drive"].isin(only)].reset_index(drop=True)
    return imported(table, settings=asdict(settings), step=placed.tracks.step, **about)


def _drive_table(placed: PlacedTracks, graph: LaneGraph, settings: CutSettings) -> pd.DataFrame:
    tracks, inside = placed.tracks, placed.piece >= 0
    is_truck = np.isin(tracks.kind, TRUCKS)
    middle = placed.along if tracks.rear is None else placed.along + tracks.rear  # gaps count from there
    near = neighbour_columns(
        graph, placed.piece, middle, tracks.time, tracks.vehicle, tracks.step, tracks.speed, tracks.length, is_truck,
        scale=placed.scale,
    )  # fmt: skip
    # A number that changes with the lane, and lateral position without jumps: a new piece ahead is no new lane.
    step = np.diff(placed.offset, prepend=placed.offset[:1])
    same = np.r_[False, tracks.vehicle[1:] == tracks.vehicle[:-1]]
    jump = same & (np.abs(step) > 0.5 * placed.lane_width)
    lane = np.cumsum(jump | (np.r_[False, inside[1:] != inside[:-1]] & same) | ~same).astype(np.int64)
    sideways = np.cumsum(np.where(jump | ~same | ~np.isfinite(step), 0.0, step))
    columns = {
        "drive": np.array(tracks.names, dtype=object)[tracks.vehicle],
        "time": np.round(tracks.time, 4),
        "offset": placed.offset,
        "lane_width": placed.lane_width,
        "speed": tracks.speed,
        "acceleration": rate(tracks.speed, tracks.vehicle, tracks.time, tracks.step, 1.0),
        **placed.road,
        **near,
    }
    against = (tracks.speed > MOVING_SPEED) & (placed.agreement < 0.0)
    rows = Rows(tracks.vehicle, tracks.time, lane, tracks.step)
    reasons = {"no lane": ~inside, **({"against the lane": against & inside} if against.any() else {})}
    return cut_table(columns, rows, settings, sideways=sideways, reasons=reasons, kind=tracks.kind, is_truck=is_truck)
