"""Tracks that have found their lanes, made into the standard drive table."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.arrays import FloatArray, IntArray
from xosc_lateral.drives.cleaning import RUN
from xosc_lateral.formats.importers.cuts import CutSettings, lane_changes, name_states, number_runs
from xosc_lateral.formats.importers.neighbours import find_neighbours
from xosc_lateral.formats.importers.table import Imported, finished, hash_files, without_cut
from xosc_lateral.lazy import pd


@dataclass(frozen=True, eq=False)
class LaneGraph:
    """Pieces of lanes and how they hang together."""

    length: FloatArray  # of each piece, along the road, shape (n,) [m]
    left: IntArray  # piece beside it on the left that is driven the same way; -1: none, shape (n,)
    following: Sequence[Sequence[int]]  # pieces that it leads to

    def layout(self) -> tuple[IntArray, FloatArray, IntArray]:
        """Part of the network, way along it to the piece's start [m], and rank (growing to the left) of each piece.

        Breadth first from the first piece of each part. Where ways meet that are of different length, as in a ring or
        beyond a junction, the first one found counts; pieces that come to lie on one another there (two ways into one
        place of a layout) get parts of their own.
        """
        n = len(self.length)
        part, station, rank = np.full(n, -1), np.zeros(n), np.zeros(n, dtype=np.int64)
        steps = self._steps()
        taken: dict[tuple[int, int], list[tuple[float, float]]] = {}
        count = 0
        for first in range(n):
            if part[first] >= 0:
                continue
            waiting = deque([(first, 0.0, 0)])
            while waiting:
                piece, at, level = waiting.popleft()
                if part[piece] >= 0 or _overlaps(taken.get((count, level), []), at, at + self.length[piece]):
                    continue
                part[piece], station[piece], rank[piece] = count, at, level
                taken.setdefault((count, level), []).append((at, at + float(self.length[piece])))
                for other, side, where in steps[piece]:
                    ahead = {0: 0.0, 1: float(self.length[piece]), -1: -float(self.length[other])}[where]
                    waiting.append((other, at + ahead, level + side))
            count += 1
        return part, station, rank

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


def _overlaps(spans: Sequence[tuple[float, float]], low: float, high: float) -> bool:
    return any(low < end - 1e-3 and high > begin + 1e-3 for begin, end in spans)


TRUCKS = ("truck", "bus", "trailer", "semitrailer", "lorry", "van_trailer", "truck_trailer")

SPEED_WINDOW = 0.4
"""Positions are differenced over this where no speed was recorded. [s]"""


@dataclass(frozen=True, eq=False)
class PlacedTracks:
    """Rows of all vehicles, sorted by vehicle and time."""

    names: Sequence[str]  # of the vehicles
    vehicle: IntArray  # index into `names`, shape (n,)
    time: FloatArray  # shape (n,) [s]
    step: float  # between two rows [s]
    piece: IntArray  # of the lane graph; -1: in no lane, shape (n,)
    along: FloatArray  # way from the piece's start, in the direction of travel, shape (n,) [m]
    offset: FloatArray  # offset, lane_width: NaN in no lane, shape (n,) [m]
    lane_width: FloatArray
    speed: FloatArray  # shape (n,) [m/s]
    length: FloatArray  # of the vehicle, shape (n,) [m]
    kind: NDArray[np.str_]  # class of the vehicle in lower case; empty where not known, shape (n,)
    # road: what the road is like there: curvature, lane_index ..., shape (n,)
    road: Mapping[str, FloatArray] = field(default_factory=dict)


def import_placed(
    tracks: PlacedTracks,
    graph: LaneGraph,
    settings: CutSettings,
    *,
    only: Collection[str] | None = None,
    **about: Any,
) -> Imported:
    """Neighbours, cuts and the record of the import; of the vehicles in `only` alone, if it is given.

    Raises `NotEnoughDataError` if nothing is left; further parameters are those of `table.finished`.
    """
    table = placed_table(tracks, graph, settings)
    if only is not None:
        table = table[table["drive"].isin(only)].reset_index(drop=True)
    return finished(table, settings=asdict(settings), step=tracks.step, **about)


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


def placed_table(tracks: PlacedTracks, graph: LaneGraph, settings: CutSettings) -> pd.DataFrame:
    """The drive table with its column `state`."""
    part, station, rank = graph.layout()
    piece, inside = np.maximum(tracks.piece, 0), tracks.piece >= 0
    s = station[piece] + tracks.along
    level = rank[piece] - int(rank.min())
    instant = np.round(tracks.time / tracks.step).astype(np.int64)
    is_truck = np.isin(tracks.kind, TRUCKS)
    group = instant * (int(part.max()) + 1) + part[piece]
    is_left = np.bincount(graph.left[graph.left >= 0], minlength=len(graph.left)) > 0  # of another piece
    near = find_neighbours(
        group,
        np.where(inside, level, -1),
        s,
        tracks.length,
        is_truck,
        lane_on_left=graph.left[piece] >= 0,
        lane_on_right=is_left[piece],
    )
    lane, sideways = _own_lanes(tracks, inside)
    reasons = {
        "no lane": ~inside,
        "lane change": lane_changes(sideways, tracks.offset, lane, tracks.vehicle, tracks.step, settings),
    }
    state = name_states(reasons, lane, tracks.vehicle, instant, tracks.step, settings)
    return pd.DataFrame(
        {
            "drive": np.array(tracks.names, dtype=object)[tracks.vehicle],
            "time": np.round(tracks.time, 4),
            "offset": tracks.offset,
            "lane_width": tracks.lane_width,
            "speed": tracks.speed,
            "acceleration": _rate(tracks.speed, tracks.vehicle, tracks.step, 1.0),
            **tracks.road,
            **near,
            "vehicle_class": tracks.kind,
            "is_truck": is_truck.astype(np.float64),
            RUN: number_runs(state, lane, tracks.vehicle, instant),
            "state": state,
        }
    )


def _own_lanes(tracks: PlacedTracks, inside: NDArray[np.bool_]) -> tuple[IntArray, FloatArray]:
    """A number that changes with the lane, and lateral position without the jumps: a new piece ahead is no new lane."""
    step = np.diff(tracks.offset, prepend=tracks.offset[:1])
    same = np.r_[False, tracks.vehicle[1:] == tracks.vehicle[:-1]]
    entered = np.r_[False, inside[1:] != inside[:-1]] & same
    jump = same & (np.abs(step) > 0.5 * tracks.lane_width)
    lane = np.cumsum(jump | entered | ~same)
    sideways = np.cumsum(np.where(jump | ~same | ~np.isfinite(step), 0.0, step))
    return lane.astype(np.int64), sideways


def ground_speed(x: FloatArray, y: FloatArray, vehicle: IntArray, step: float) -> FloatArray:
    """Speed from positions, shape (n,). [m/s]"""
    return np.hypot(_rate(x, vehicle, step, SPEED_WINDOW), _rate(y, vehicle, step, SPEED_WINDOW))


def travel_heading(x: FloatArray, y: FloatArray, vehicle: IntArray, step: float) -> FloatArray:
    """Heading from positions, shape (n,). [rad]"""
    return np.arctan2(_rate(y, vehicle, step, SPEED_WINDOW), _rate(x, vehicle, step, SPEED_WINDOW))


def _rate(values: FloatArray, vehicle: IntArray, step: float, window: float) -> FloatArray:
    """Difference over a window about each row, within a vehicle's rows."""
    first = np.searchsorted(vehicle, vehicle, side="left")
    last = np.searchsorted(vehicle, vehicle, side="right") - 1
    half = max(1, round(0.5 * window / step))
    rows = np.arange(len(values))
    low, high = np.maximum(rows - half, first), np.minimum(rows + half, last)
    return np.asarray((values[high] - values[low]) / (np.maximum(high - low, 1) * step))
