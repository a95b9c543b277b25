"""Tracks of any recording on a known road into the standard drive table.

A table of x, y (and heading, speed, length and class where there are any) in the coordinates of an OpenDRIVE road. The
road says which lane a vehicle is in and how far from its centre, what the lane is like, and who is ahead and beside.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.importers.cuts import DEFAULT_CUTS, CutSettings
from xosc_lateral.formats.importers.placed import LaneGraph, PlacedTracks, import_placed
from xosc_lateral.formats.importers.table import Imported, guarded
from xosc_lateral.formats.importers.track_table import Tracks, read_tracks
from xosc_lateral.formats.mapping import MappingLike
from xosc_lateral.formats.opendrive import read_opendrive
from xosc_lateral.road.network import DRIVING, RoadNetwork

LICENCE = "your own recording"

INTO_NEXT = 1e-3
"""Step beyond a section's end that brings one into the next. [m]"""

Piece = tuple[int, int, int]
"""Road, lane section, lane."""


@guarded
def import_tracks(
    source: Path,
    *,
    road: Path | str,
    columns: Sequence[str] = (),
    mapping: MappingLike | None = None,
    settings: CutSettings = DEFAULT_CUTS,
    keep_cut: bool = False,
) -> Imported:
    """Read tracks on a known road.

    Raises `FormatError`: A missing column, or tracks that lie beside the road; `NotEnoughDataError` if nothing is left
    once lane changes are cut.

    `source`: CSV or Parquet table, one row per vehicle and instant; x and y are the vehicle's middle (or lie `rear`
    behind it, where there is that column), in the road's coordinates. Or a log that esmini wrote (``--csv_logger``).
    `road`: OpenDRIVE file. `columns`: ``NAME=COLUMN[:UNIT]`` for `vehicle`, `time`, `x`, `y`, `heading`, `speed`,
    `length`, `rear`, `vehicle_class`. `mapping`: more of them, saved.
    """
    network = read_opendrive(road)
    tracks = read_tracks(source, columns, mapping)
    pieces, graph = lane_graph(network)
    if not pieces:
        raise FormatError("the road has no driving lane that tracks could lie in", path=Path(road))
    placed = place(tracks, network, pieces)
    if not (placed.piece >= 0).any():
        raise FormatError(
            f"no row lies in a driving lane of {Path(road).name}: x from {tracks.x.min():.1f} to "
            f"{tracks.x.max():.1f} m, y from {tracks.y.min():.1f} to {tracks.y.max():.1f} m; "
            "are both in the same coordinates?",
            path=source,
        )
    return import_placed(
        placed,
        graph,
        settings,
        keep_cut=keep_cut,
        format="tracks",
        sources=[source, Path(road)],
        licence=LICENCE,
    )


def place(tracks: Tracks, network: RoadNetwork, pieces: dict[Piece, int]) -> PlacedTracks:
    """Find every row's lane, and what the road is like there."""
    found = network.world_to_lane(tracks.x, tracks.y, heading=tracks.heading)
    road, lane, s = found.road, found.lane, found.s
    inside = (found.distance <= 0.0) & (lane != 0)
    piece = np.full(len(road), -1)
    along = np.zeros(len(road))
    for index in np.unique(road[inside]):
        part = network.roads[index]
        starts = np.array(part.section_starts)
        mine = np.flatnonzero(inside & (road == index))
        section = np.clip(np.searchsorted(starts, s[mine], side="right") - 1, 0, len(starts) - 1)
        for k in np.unique(section):
            for name in np.unique(lane[mine[section == k]]):
                rows = mine[(section == k) & (lane[mine] == name)]
                begin, end = part.sections[k].start, part.sections[k].end
                forward = network.travel_direction(int(index), int(name)) > 0
                piece[rows] = pieces.get((int(index), int(k), int(name)), -1)
                along[rows] = s[rows] - begin if forward else end - s[rows]
    there = np.flatnonzero(piece >= 0)
    where = road[there], lane[there], s[there]
    lane_index, lane_count = network.lane_index(*where)
    values = {
        "lane_width": network.lane_width(*where),
        "curvature": network.lane_curvature(*where),
        "lane_index": lane_index,
        "lane_count": lane_count,
        "crossfall": network.crossfall(*where),
        "grade": network.grade(*where),
    }
    columns = {name: np.full(len(road), np.nan) for name in values}
    for name, known in values.items():
        columns[name][there] = known
    width = columns.pop("lane_width")
    offset = np.where(piece >= 0, found.offset, np.nan)
    return tracks.placed(piece, along, offset, width, columns)


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
    left = np.full(len(pieces), -1)
    following = []
    for (index, k, name), number in pieces.items():
        forward = network.travel_direction(index, name) > 0
        beside = _beside(name, 1 if forward else -1)
        if network.travel_direction(index, beside) == network.travel_direction(index, name):
            left[number] = pieces.get((index, k, beside), -1)
        following.append(_following(network, pieces, index, k, name, forward))
    return pieces, LaneGraph(np.array(length), left, following)


def _beside(lane: int, step: int) -> int:
    return lane + step if lane + step else lane + 2 * step


def _following(
    network: RoadNetwork, pieces: dict[Piece, int], index: int, k: int, name: int, forward: bool
) -> list[int]:
    """Piece straight ahead of this one, in the direction of travel."""
    section = network.roads[index].sections[k]
    end = section.end - INTO_NEXT if forward else section.start + INTO_NEXT
    step = network.advance(index, name, end, 2 * INTO_NEXT)
    if step.remaining > 0.0:
        return []
    starts = network.roads[step.road].section_starts
    there = int(np.clip(np.searchsorted(starts, step.s, side="right") - 1, 0, len(starts) - 1))
    found = pieces.get((step.road, there, step.lane))
    return [] if found is None or found == pieces[index, k, name] else [found]
