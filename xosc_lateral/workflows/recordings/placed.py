"""Tracks that have found their lanes, made into the standard drive table."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.workflows.recordings.cuts import CutSettings, Rows, cut_table
from xosc_lateral.workflows.recordings.gate import MOVING, require_lane_direction
from xosc_lateral.workflows.recordings.importers.table import Imported, finished, hash_files, without_cut
from xosc_lateral.workflows.recordings.importers.track_table import Tracks, rate
from xosc_lateral.workflows.recordings.instants import pool_of
from xosc_lateral.workflows.recordings.neighbours import find_neighbours


@dataclass(frozen=True, eq=False)
class LaneGraph:
    """Pieces of lanes and how they hang together."""

    length: FloatArray  # of each piece, along the road, shape (n,) [m]
    left: IntArray  # piece beside it on the left that is driven the same way; -1: none, shape (n,)
    following: Sequence[Sequence[int]]  # pieces that it leads to
    # facing: of two pieces beside each other, ways along the first and those along the second that face them [m];
    # without it they are of one length
    facing: Mapping[tuple[int, int], tuple[FloatArray, FloatArray]] = field(default_factory=dict)

    def layout(self) -> tuple[IntArray, list[tuple[FloatArray, FloatArray]], IntArray]:
        """Part of the network, ways along each piece with the stations that they lie at [m], and its rank (growing to
        the left).

        Breadth first from the first piece of each part. Where ways meet that are of different length, as in a ring or
        beyond a junction, the first one found counts; pieces that come to lie on one another there (two ways into one
        place of a layout) get parts of their own.
        """
        n = len(self.length)
        part, rank = np.full(n, -1), np.zeros(n, dtype=np.int64)
        lines = [(np.zeros(1), np.zeros(1))] * n
        steps = self._steps()
        taken: dict[tuple[int, int], list[tuple[float, float]]] = {}
        count = 0
        for first in range(n):
            if part[first] >= 0:
                continue
            waiting = deque([(first, self._straight(first, 0.0), 0)])
            while waiting:
                piece, line, level = waiting.popleft()
                (at, end), here = (float(line[1][k]) for k in (0, -1)), taken.setdefault((count, level), [])
                if part[piece] >= 0 or any(at < other - 1e-3 and end > begin + 1e-3 for begin, other in here):
                    continue
                part[piece], lines[piece], rank[piece] = count, line, level
                here.append((at, end))
                for other, side, where in steps[piece]:
                    start = {0: at, 1: end, -1: at - float(self.length[other])}[where]
                    faced = self.facing.get((other, piece)) if where == 0 else None
                    other_line = self._straight(other, start) if faced is None else (faced[0], follow(faced[1], line))
                    waiting.append((other, other_line, level + side))
            count += 1
        return part, lines, rank

    def _straight(self, piece: int, start: float) -> tuple[FloatArray, FloatArray]:
        return np.array([0.0, self.length[piece]]), np.array([start, start + self.length[piece]])

    def stations(self, piece: IntArray, along: FloatArray) -> tuple[IntArray, FloatArray, IntArray, FloatArray]:
        """Part, station [m] and rank of places in pieces, and metres along the piece per metre of station [-].

        Shape (n,) each; `along`: from the piece's start. [m]
        """
        part, lines, rank = self.layout()
        station, scale = np.array(along, dtype=np.float64), np.ones(len(along))
        for number in np.unique(piece):
            mine = piece == number
            here = along[mine]
            station[mine] = follow(here, lines[number])
            ends = follow(here - SLOPE_LENGTH, lines[number]), follow(here + SLOPE_LENGTH, lines[number])
            scale[mine] = 2.0 * SLOPE_LENGTH / np.maximum(ends[1] - ends[0], SLOPE_LENGTH)
        return part[piece], station, rank[piece], scale

    def _steps(self) -> list[list[tuple[int, int, int]]]:
        """From each piece to the pieces about it: (piece, lanes to the left, +1 ahead or -1 behind)."""
        steps: list[list[tuple[int, int, int]]] = [[] for _ in self.length]
        for piece, left in enumerate(self.left):
            if left >= 0:
                steps[piece].append((int(left), 1, 0))
                steps[int(left)].append((piece, -1, 0))
        for piece, after in enumerate(self.following):
            for other in after:
                steps[piece].append((other, 0, 1))
                steps[other].append((piece, 0, -1))
        return steps


SLOPE_LENGTH = 10.0
"""To each side: over which metres of a lane are compared with those of its neighbour. [m]"""


def follow(values: FloatArray, line: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Values through a line of (from, to), which goes on beyond its ends with slope 1. Shape as `values`."""
    low, high = line[0][0], line[0][-1]
    beyond = np.minimum(values - low, 0.0) + np.maximum(values - high, 0.0)
    return np.asarray(np.interp(values, *line) + beyond)


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
    """Neighbours, cuts and the record of the import; of the vehicles in `only` alone, if it is given.

    Raises `NotEnoughDataError` if nothing is left; further parameters are those of `table.finished`.
    """
    table = _drive_table(placed, graph, settings)
    if only is not None:
        table = table[table["drive"].isin(only)].reset_index(drop=True)
    return finished(table, settings=asdict(settings), step=placed.tracks.step, **about)


def import_each(sources: Path | Sequence[Path], read: Callable[[Path], Imported], *, keep_cut: bool) -> Imported:
    """One table and one record of one or several files, each read with what would be cut.

    Raises `NotEnoughDataError` if nothing is left.
    """
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
    near = _neighbours(placed, graph, is_truck)
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
    against = (tracks.speed > MOVING) & (placed.agreement < 0.0)
    rows = Rows(tracks.vehicle, tracks.time, lane, tracks.step)
    reasons = {"no lane": ~inside, **({"against the lane": against & inside} if against.any() else {})}
    return cut_table(columns, rows, settings, sideways=sideways, reasons=reasons, kind=tracks.kind, is_truck=is_truck)


def _neighbours(placed: PlacedTracks, graph: LaneGraph, is_truck: BoolArray) -> dict[str, FloatArray]:
    """Columns of leader and neighbours, shape (n,) each: where everybody is at the instants of the recording, whoever
    is missing in a frame included."""
    tracks, inside = placed.tracks, placed.piece >= 0
    piece = np.maximum(placed.piece, 0)
    middle = placed.along if tracks.rear is None else placed.along + tracks.rear  # gaps count from there
    part, station, rank, scale = graph.stations(piece, middle)
    scale = scale * placed.scale
    pool = pool_of(tracks.time, tracks.vehicle, tracks.step)
    row = pool.row
    is_left = np.bincount(graph.left[graph.left >= 0], minlength=len(graph.left)) > 0  # of another piece
    near = find_neighbours(
        pool.instant * (int(part.max()) + 1) + part[row],
        np.where(inside, rank - int(rank.min()), -1)[row],
        pool.moved(station, np.where(inside, part, -1), tracks.speed / scale),
        tracks.length[row],
        is_truck[row],
        lane_on_left=(graph.left[piece] >= 0)[row],
        lane_on_right=is_left[piece][row],
        scale=scale[row],
    )
    return {name: values[pool.of_row] for name, values in near.items()}
