"""A recording's own lanes as OpenDRIVE: lanes side by side make a road, and roads are linked as the lanes are.

All lanes of a road are driven along it. Where roads part or meet there is a direct junction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.lazy import interpolate, spatial
from xosc_lateral.extras.recordings.lines_from_tracks import ReferenceLine
from xosc_lateral.extras.recordings.road_file import Connections, WrittenLane, WrittenRoad, curved_plan, roads_xml

PIECE_LENGTH = 5.0  # of a curved reference line: a cubic is off by 2 mm on a radius of 10 m, see `curved_plan` [m]
SAMPLE_LENGTH = 0.5  # between points that widths are measured at: a chord is off by 3 mm on a radius of 10 m [m]
WIDTH_TOLERANCE = 1e-3  # widths go in straight pieces that are within this [m]
WHOLE_LENGTH = 0.8  # a line of this share of the longest runs along the whole road: it lacks what corners it cuts [-]
ABSENCE_LENGTH = 2.0  # a lane that ends so much before its neighbours is none from there; less is how it was cut [m]


@dataclass(frozen=True, eq=False, slots=True)
class DrivenLane:
    """A lane between two lines in the direction of travel."""

    left: FloatArray  # left, right: shape (n, 2 or 3) [m]
    right: FloatArray
    beside: int  # number of the lane on its left that is driven the same way; -1: none
    following: Sequence[int]  # numbers of the lanes that it leads to


def roads_of_lanes(lanes: Sequence[DrivenLane], name: str, *, left_handed: bool = False) -> str:
    """The OpenDRIVE document; the same lanes give the same bytes. `left_handed`: traffic keeps to the left."""
    if left_handed:  # as in a mirror along x, and back again when it is written
        flip = np.array([1.0, -1.0])
        on_right = {lane.beside: number for number, lane in enumerate(lanes)}
        lanes = [
            DrivenLane(lane.right[:, :2] * flip, lane.left[:, :2] * flip, on_right.get(number, -1), lane.following)
            for number, lane in enumerate(lanes)
        ]
    groups = _groups(lanes)
    places = {lane: (road, -1 - k) for road, group in enumerate(groups) for k, lane in enumerate(group)}
    ways = sorted(
        {(places[place], places[other]) for place in places for other in lanes[place].following if other in places}
    )
    links, junctions = _links(ways, len(groups))
    successors, predecessors = dict[Place, int](), dict[Place, int]()
    for place, other in ways:
        if links[place[0]]["successor"][0] == "road":
            successors[place], predecessors[other] = other[1], place[1]
    written = list[WrittenRoad]()
    for number, group in enumerate(groups):
        road = _road(number, [lanes[place] for place in group], name)
        linked = [
            replace(lane, predecessor=predecessors.get((number, k)), successor=successors.get((number, k)))
            for k, lane in zip(range(-1, -len(group) - 1, -1), road.right, strict=True)
        ]
        written.append(replace(road, right=linked, links=links[number]))
    if left_handed:
        written = [_mirrored(road) for road in written]
        junctions = {
            number: [(place, other, [(-a, -b) for a, b in pairs]) for place, other, pairs in connections]
            for number, connections in junctions.items()
        }
    return roads_xml(name, written, junctions=junctions)


def _groups(lanes: Sequence[DrivenLane]) -> list[list[int]]:
    has_right = {lane.beside for lane in lanes}
    groups, grouped = list[list[int]](), set[int]()
    for first in [*(k for k in range(len(lanes)) if k not in has_right), *range(len(lanes))]:  # then rings, if any
        group, lane = list[int](), first
        while lane >= 0 and lane not in grouped:
            grouped.add(lane)
            group.insert(0, lane)
            lane = lanes[lane].beside
        groups += [group] if group else []
    return groups


Place = tuple[int, int]  # number of a road, and lane


def _links(
    ways: Sequence[tuple[Place, Place]], count: int
) -> tuple[list[dict[str, tuple[str, int]]], dict[int, Connections]]:
    """Links of each road; junctions where it leads to several, or several lead to where it leads."""
    onward: list[set[int]] = [set() for _ in range(count)]
    back: list[set[int]] = [set() for _ in range(count)]
    for (road, _), (other, _) in ways:
        onward[road].add(other)
        back[other].add(road)
    links: list[dict[str, tuple[str, int]]] = [{} for _ in range(count)]
    junctions: dict[int, Connections] = {}
    done = set[int]()
    for road in range(count):
        if road in done or not onward[road]:
            continue
        incoming, linked = {road}, set[int]()
        # all that meet at the same place
        while (more := set().union(*(onward[before] for before in incoming))) != linked:
            linked = more
            incoming = set().union(*(back[before] for before in linked))
        done |= incoming
        if len(incoming) == len(linked) == 1:
            (other,) = linked
            links[road]["successor"], links[other]["predecessor"] = ("road", other + 1), ("road", road + 1)
            continue
        junction = count + len(junctions) + 1
        pairs = [(before, other) for before in sorted(incoming) for other in sorted(onward[before])]
        junctions[junction] = [
            (before + 1, other + 1, [(a[1], b[1]) for a, b in ways if (a[0], b[0]) == (before, other)])
            for before, other in pairs
        ]
        for before in incoming:
            links[before]["successor"] = ("junction", junction)
        for other in linked:
            links[other]["predecessor"] = ("junction", junction)
    return links, junctions


def _road(road_number: int, lanes: Sequence[DrivenLane], name: str) -> WrittenRoad:
    """Lanes from left to right along the straightest of their left lines that is about as long as the longest."""
    lengths = [float(np.hypot(*np.diff(lane.left[:, :2], axis=0).T).sum()) for lane in lanes]
    whole = [lane.left for lane, size in zip(lanes, lengths, strict=True) if size > WHOLE_LENGTH * max(lengths)]
    line = smooth_line(min(whole, key=_turning))
    s = np.linspace(0.0, line.length, max(2, int(np.ceil(line.length / SAMPLE_LENGTH)) + 1))
    samples = line.place(s, 0)
    sides = [(_aside(lane.left, line, s, samples), _aside(lane.right, line, s, samples)) for lane in lanes]
    borders = [np.full(len(s), np.nan)]
    for left, _ in sides:  # that of the leftmost lane which is there
        borders[0] = np.where(np.isnan(borders[0]), left, borders[0])
    for (_, right), (beyond, _) in pairwise([*sides, (np.full(len(s), np.nan),) * 2]):
        shared = np.where(np.isnan(beyond), right, 0.5 * (right + beyond))
        borders.append(np.where(np.isnan(right), borders[-1], shared))
    widths = [np.maximum(left - right, 0.0) for left, right in pairwise(borders)]
    written = [WrittenLane("driving", _straight_pieces(s, width)) for width in widths]
    offset = _straight_pieces(s, np.nan_to_num(borders[0]))
    plan = curved_plan(line, piece=PIECE_LENGTH)
    chord = samples[-1] - samples[0]
    away = np.abs(chord[0] * (samples - samples[0])[:, 1] - chord[1] * (samples - samples[0])[:, 0]) / np.hypot(*chord)
    if away.max() < WIDTH_TOLERANCE:
        plan = np.array([[0.0, *samples[0], np.arctan2(chord[1], chord[0]), line.length]])
    known = offset if np.abs(offset[:, 1:]).max() > WIDTH_TOLERANCE else None
    return WrittenRoad(name, plan, [], written, number=road_number + 1, kind="unknown", offset=known)


def _mirrored(road: WrittenRoad) -> WrittenRoad:
    """As in a mirror along x: lanes that are driven along it lie on its left, as in left-hand traffic."""
    plan = road.plan.copy()
    plan[:, [2, 3, *range(8, plan.shape[1])]] *= -1.0  # y, heading, and v of curves
    offset = None if road.offset is None else road.offset * [1.0, -1.0, -1.0, -1.0, -1.0]
    lanes = [
        replace(
            lane,
            predecessor=None if lane.predecessor is None else -lane.predecessor,
            successor=None if lane.successor is None else -lane.successor,
        )
        for lane in road.right
    ]
    return replace(road, plan=plan, offset=offset, left=lanes, right=[], rule="LHT")


def smooth_line(points: FloatArray) -> ReferenceLine:
    """A line through points whose direction does not jump (Akima's cubics), by its own length."""
    points = np.asarray(points[:, :2], dtype=np.float64)
    points = points[np.r_[True, np.hypot(*np.diff(points, axis=0).T) > 1e-6]]
    chord = np.r_[0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T))]
    fine = np.linspace(0.0, chord[-1], max(3, int(np.ceil(chord[-1] / SAMPLE_LENGTH)) + 1))
    if len(points) > 2:
        curve = interpolate.Akima1DInterpolator(chord, points)(fine)
    else:
        curve = np.stack([np.interp(fine, chord, points[:, axis]) for axis in (0, 1)], axis=1)
    s = np.r_[0.0, np.cumsum(np.hypot(*np.diff(curve, axis=0).T))]
    places = interpolate.CubicSpline(s, curve)
    return ReferenceLine(float(s[-1]), lambda at, order: np.asarray(places(at, order)), lambda at: 0.0 * at)


def _turning(points: FloatArray) -> float:
    steps = np.diff(points[:, :2], axis=0)
    steps = steps[np.hypot(*steps.T) > 0.0]
    turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    return float(np.round(np.abs(turns).sum(), 6))


def _aside(edge: FloatArray, line: ReferenceLine, s: FloatArray, samples: FloatArray) -> FloatArray:
    """How far to the left of a line an edge lies, at its samples, shape as `s`; NaN where the edge is not. [m]"""
    way = np.r_[0.0, np.cumsum(np.hypot(*np.diff(edge[:, :2], axis=0).T))]
    dense = np.linspace(0.0, way[-1], max(2, int(np.ceil(way[-1] / SAMPLE_LENGTH)) + 1))
    points = np.stack([np.interp(dense, way, edge[:, axis]) for axis in (0, 1)], axis=1)
    at, aside = line.project(points, s[spatial.cKDTree(samples).query(points)[1]])
    order = np.argsort(at, kind="stable")
    at, aside = at[order], aside[order]
    absent = (s < at[0] - ABSENCE_LENGTH) | (s > at[-1] + ABSENCE_LENGTH)
    return np.where(absent, np.nan, np.interp(s, at, aside))


def _straight_pieces(s: FloatArray, values: FloatArray) -> FloatArray:
    """Values along s in straight pieces, as few as halving finds: start, value, slope, 0, 0; shape (n, 5)."""
    pieces, waiting = list[tuple[float, ...]](), [(0, len(s) - 1)]
    while waiting:
        first, last = waiting.pop()
        slope = (values[last] - values[first]) / (s[last] - s[first])
        away = np.abs(values[first : last + 1] - values[first] - slope * (s[first : last + 1] - s[first]))
        if away.max() > WIDTH_TOLERANCE:
            split = first + int(away.argmax())
            waiting += [(split, last), (first, split)]
        else:
            pieces.append((s[first], values[first], slope, 0.0, 0.0))
    return np.array(pieces)
