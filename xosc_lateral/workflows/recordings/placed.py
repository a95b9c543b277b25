"""Tracks that have found their lanes, made into the standard drive table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.workflows.recordings.cuts import CutSettings, Rows, cut_table
from xosc_lateral.workflows.recordings.gate import MOVING_SPEED, require_lane_direction
from xosc_lateral.workflows.recordings.importers.table import Imported, finished, hash_files, without_cut
from xosc_lateral.workflows.recordings.importers.track_table import Tracks, rate
from xosc_lateral.workflows.recordings.lane_graph import LaneGraph, neighbour_columns

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
) -> Imported:
    """Neighbours, cuts and record, see `table.finished`; of the vehicles in `only` alone, if it is given."""
    table = _drive_table(placed, graph, settings)
    if only is not None:
        table = table[table["drive"].isin(only)].reset_index(drop=True)
    return finished(table, settings=asdict(settings), step=placed.tracks.step, **about)


def import_each(sources: Path | Sequence[Path], read: Callable[[Path], Imported], *, keep_cut: bool) -> Imported:
    """One table and one record of one or several files, each read with what would be cut."""
    files = [sources] if isinstance(sources, Path) else list(sources)
    parts = [read(file) for file in files]
    record = parts[0].provenance
    if len(parts) > 1:
        rows = Counter[str]()
        for part in parts:
            rows.update(part.provenance.rows)
        record = replace(
            record,
            source=", ".join(file.name for file in files),
            sha256=hash_files(files),
            rows=dict(rows),
            vehicles=sum(part.provenance.vehicles for part in parts),
            hours=round(sum(part.provenance.hours for part in parts), 3),
            notes=tuple(note for part in parts for note in part.provenance.notes),
        )
    table = pd.concat([part.table for part in parts], ignore_index=True)
    return without_cut(table, record, keep_cut, files[0])


def _drive_table(placed: PlacedTracks, graph: LaneGraph, settings: CutSettings) -> pd.DataFrame:
    """The drive table with its column `state`."""
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
