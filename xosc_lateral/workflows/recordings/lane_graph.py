"""How pieces of lanes hang together, and who drives ahead and beside in them."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
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
                    put = waiting.appendleft if where == 0 else waiting.append  # what lies beside, before what follows
                    put((other, other_line, level + side))
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


SLOPE_LENGTH = 10.0  # to each side: over which metres of a lane are compared with those of its neighbour [m]


def follow(values: FloatArray, line: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Values through a line of (from, to), which goes on beyond its ends with slope 1. Shape as `values`."""
    low, high = line[0][0], line[0][-1]
    beyond = np.minimum(values - low, 0.0) + np.maximum(values - high, 0.0)
    return np.asarray(np.interp(values, *line) + beyond)


def neighbour_columns(
    graph: LaneGraph,
    piece: IntArray,
    middle: FloatArray,
    time: FloatArray,
    vehicle: IntArray,
    step: float,
    speed: FloatArray,
    length: FloatArray,
    is_truck: BoolArray,
    *,
    scale: FloatArray | float = 1.0,
) -> dict[str, FloatArray]:
    """Columns of leader and neighbours, shape (n,) each, see `find_neighbours`; rows sorted by vehicle and time.

    At every instant of the recording everybody is where it is then, whoever is missing in a frame included.

    `piece`: -1: in no lane. `middle`: of the vehicle, along its piece. [m] `time`, `step`: usual from row to row. [s]
    `speed`: [m/s] `length`: [m] `scale`: metres along the lane per metre of `middle`. [-]
    """
    inside, piece = piece >= 0, np.maximum(piece, 0)
    part, station, rank, own_scale = graph.stations(piece, middle)
    scale = own_scale * scale
    pool = pool_of(time, vehicle, step)
    row = pool.row
    is_left = np.bincount(graph.left[graph.left >= 0], minlength=len(graph.left)) > 0  # of another piece
    near = find_neighbours(
        pool.instant * (int(part.max()) + 1) + part[row],
        np.where(inside, rank - int(rank.min()), -1)[row],
        pool.moved(station, np.where(inside, part, -1), speed / scale),
        length[row],
        is_truck[row],
        lane_on_left=(graph.left[piece] >= 0)[row],
        lane_on_right=is_left[piece][row],
        scale=scale[row],
    )
    return {name: values[pool.of_row] for name, values in near.items()}
