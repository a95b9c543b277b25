"""Lanes where traffic drives: mean paths of vehicles that follow one another, split where they part and meet."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray, true_slices
from xosc_lateral.extras.recordings.importers.tracks import Strip

SPACING = 1.0  # of points on a path [m]
DRIVING = 0.5  # who is slower stands, and only seems to go on a way [m/s]
LEAST_LENGTH = 20.0  # of a path, or a lane where streams part: less says nothing about who drives where [m]
LANE_DISTANCE = 1.5  # farther from a path's line is another lane's: half a narrow one [m]
ALONG = np.cos(np.radians(20.0))  # who goes another way by more is of another stream [-]
WITHIN = 0.9  # of a path's points that have to lie so along a stream [-]
LEAST_OTHERS = 6  # so many vehicles make a lane [-]
ROUNDS, SMOOTHING = 3, 6.0  # of moving a line to the mean of its vehicles, and the window by which it follows that [m]


@dataclass(eq=False)
class _Stream:
    points: FloatArray  # shape (n, 2) [m]
    paths: list[FloatArray] = field(default_factory=list)

    def beside(self, path: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Distance of a path's points from the line [m], and whether they lie along it."""
        from scipy.spatial import cKDTree

        away, k = cKDTree(self.points).query(path)
        agreement = (_tangents(path) * _tangents(self.points)[k]).sum(axis=1)
        return np.asarray(away), np.asarray((away < LANE_DISTANCE) & (agreement > ALONG))


def _tangents(points: FloatArray) -> FloatArray:
    step = np.gradient(points, axis=0)
    return np.asarray(step / np.maximum(np.hypot(*step.T), 1e-9)[:, None])


def streams(x: FloatArray, y: FloatArray, speed: FloatArray, vehicle: IntArray) -> list[FloatArray]:
    """Mean paths, shape (n, 2) each, of `LEAST_OTHERS` vehicles and more, the busiest first; rows by vehicle, time."""
    paths = list[FloatArray]()
    for rows in np.split(np.arange(len(x)), np.flatnonzero(np.diff(vehicle)) + 1):
        moving = rows[speed[rows] > DRIVING]
        if len(moving) > 1:
            way = np.r_[0.0, np.cumsum(np.hypot(np.diff(x[moving]), np.diff(y[moving])))]
            at = np.arange(0.0, way[-1], SPACING)
            if len(at) * SPACING >= LEAST_LENGTH:
                paths.append(np.stack([np.interp(at, way, x[moving]), np.interp(at, way, y[moving])], axis=1))
    bundles = list[_Stream]()
    for path in sorted(paths, key=len, reverse=True):
        best, nearest = None, np.inf
        for stream in bundles:
            away, along = stream.beside(path)
            if along.mean() >= WITHIN and away[along].mean() < nearest:
                best, nearest = stream, float(away[along].mean())
        if best is None:
            best = _Stream(path)
            bundles.append(best)
        best.paths.append(path)
    busy = sorted(
        (stream for stream in bundles if len(stream.paths) >= LEAST_OTHERS), key=lambda stream: -len(stream.paths)
    )
    return [line for stream in busy if len(line := _mean_path(stream)) * SPACING >= LEAST_LENGTH]


def _mean_path(stream: _Stream) -> FloatArray:
    """The longest part of a stream's line on which enough vehicles drive, moved to where they do on average."""
    from scipy.ndimage import gaussian_filter1d

    points = stream.points
    for _ in range(ROUNDS):
        strip = strip_about(points, 2.0 * LANE_DISTANCE)
        count, total = np.zeros(len(points)), np.zeros(len(points))
        for path in stream.paths:
            way, aside, *_ = strip.place(*path.T)
            near = np.isfinite(way) & (np.abs(aside) < LANE_DISTANCE)
            at = np.clip(np.round(way[near] / strip.length * (len(points) - 1)).astype(np.int64), 0, len(points) - 1)
            at, first = np.unique(at, return_index=True)
            count[at] += 1.0
            total[at] += aside[near][first]
        width = SMOOTHING / SPACING
        shift = gaussian_filter1d(total, width) / np.maximum(gaussian_filter1d(count, width), 1e-9)
        tangent = _tangents(points)
        points = points + shift[:, None] * np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
        points = np.stack([gaussian_filter1d(column, 2.0, mode="nearest") for column in points.T], axis=1)
    parts = true_slices(gaussian_filter1d(count, width) >= LEAST_OTHERS)
    longest = max(parts, key=lambda part: part.stop - part.start, default=slice(0, 0))
    return points[longest]


def strip_about(points: FloatArray, width: float) -> Strip:
    """A lane of even width about its centre, shape (n, 2). [m]"""
    tangent = _tangents(points)
    normal = 0.5 * width * np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    flat = np.zeros((len(points), 1))
    return Strip(*(np.hstack([line, flat]) for line in (points, points + normal, points - normal)))


def lanes_of_streams(lines: list[FloatArray]) -> tuple[list[FloatArray], list[list[int]]]:
    """Lanes, shape (n, 2) each, and those that each leads to; streams that go along one another are one lane there."""
    parts = list[FloatArray]()  # of each stream what no earlier one has
    cuts: list[set[int]] = []
    links = list[tuple[tuple[int, int], tuple[int, int]]]()  # from a lane's point to another's
    from scipy.spatial import cKDTree

    for line in lines:
        owner, place = np.full(len(line), -1), np.zeros(len(line), dtype=np.int64)
        nearest = np.full(len(line), np.inf)
        for number, other in enumerate(parts):
            away, along = _Stream(other).beside(line)
            better = along & (away < nearest)
            owner[better], nearest[better] = number, away[better]
            place[better] = cKDTree(other).query(line[better])[1]
        before: tuple[int, int] | None = None
        for number, part in _runs(owner):
            if number < 0:
                parts.append(line[part])
                cuts.append({0, part.stop - part.start - 1})
                begin, end = (len(parts) - 1, 0), (len(parts) - 1, part.stop - part.start - 1)
            else:
                begin, end = (number, int(place[part.start])), (number, int(place[part.stop - 1]))
            if before is not None and before[0] != begin[0]:
                links.append((before, begin))
                cuts[before[0]].add(before[1])
                cuts[begin[0]].add(begin[1])
            before = end
    lanes, following = list[FloatArray](), list[list[int]]()
    ends, starts = dict[tuple[int, int], int](), dict[tuple[int, int], int]()
    for number, line in enumerate(parts):
        ordered = _without_close_cuts(sorted(cuts[number]), len(line) - 1)
        for first, last in pairwise(ordered):
            starts[number, first] = ends[number, last] = len(lanes)
            lanes.append(line[first : last + 1])
            following.append([])
    for (number, last), lane in ends.items():
        if (after := starts.get((number, last))) is not None:
            following[lane].append(after)
    for (number, end_of), (target, first) in links:
        lane = min((abs(at - end_of), k) for (n, at), k in ends.items() if n == number)[1]
        onward = min((abs(at - first), k) for (n, at), k in starts.items() if n == target)[1]
        if onward not in following[lane]:
            following[lane].append(onward)
    return lanes, following


def _without_close_cuts(places: list[int], last: int) -> list[int]:
    """Cuts of a line that are far enough from each other and from its ends."""
    kept = [0]
    for place in places:
        if place - kept[-1] >= 0.5 * LEAST_LENGTH and last - place >= 0.5 * LEAST_LENGTH:
            kept.append(place)
    return [*kept, last]


def _runs(owner: IntArray) -> list[tuple[int, slice]]:
    """Stretches of one owner (-1: none), those under `LEAST_LENGTH` taken as part of what is before them."""
    edges = np.r_[0, np.flatnonzero(np.diff(owner)) + 1, len(owner)]
    runs = list[tuple[int, slice]]()
    for first, last in pairwise(edges.tolist()):
        if last - first < LEAST_LENGTH / SPACING and (runs or last < len(owner)):
            if runs:
                runs[-1] = runs[-1][0], slice(runs[-1][1].start, last)
            continue
        number = int(owner[first])
        if runs and runs[-1][0] == number:
            runs[-1] = number, slice(runs[-1][1].start, last)
        else:
            runs.append((number, slice(first, last)))
    return runs
