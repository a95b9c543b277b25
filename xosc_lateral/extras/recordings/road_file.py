"""A road of our own as OpenDRIVE: a reference line in pieces, lanes whose widths are cubic pieces.

Written with lxml, as scenarios are (`files/openscenario/write/build.py` says why).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from lxml import etree

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.lazy import interpolate, spatial
from xosc_lateral.extras.recordings.lines_from_tracks import ReferenceLine
from xosc_lateral.files.openscenario.write.build import decimal, sub
from xosc_lateral.files.output_paths import template_mark

PIECE_LENGTH = 50.0
"""Of a curved reference line: a cubic through both ends with their directions is off by less than a millimetre on a
radius of 300 m (error of Hermite's cubic, PIECE^4 / (384 R^3)). [m]"""
WIDTH_PIECE_LENGTH = 25.0
"""Of a width that follows the traffic, half the import's spacing of knots. [m]"""
SHOULDER = 3.0
"""Hard shoulder [m]; RAA 2008 (guidelines for motorways), cross-section RQ 31."""


@dataclass(frozen=True, eq=False, slots=True)
class WrittenLane:
    """A lane: its type and width."""

    kind: str  # OpenDRIVE lane type
    width: FloatArray  # start s [m] and the polynomial's a, b, c, d of each piece, shape (n, 5)
    predecessor: int | None = None  # predecessor, successor: lanes of the linked roads
    successor: int | None = None

    @classmethod
    def even(cls, kind: str, width: float) -> WrittenLane:
        """The same width everywhere. [m]"""
        return cls(kind, np.array([[0.0, width, 0.0, 0.0, 0.0]]))

    @classmethod
    def through(cls, kind: str, s: FloatArray, width: FloatArray) -> WrittenLane:
        """A smooth width through values at some s, shape (n,) each. [m]"""
        spline = interpolate.CubicSpline(s, np.maximum(width, 0.0))
        return cls(kind, np.column_stack([s[:-1], spline.c[::-1].T]))


@dataclass(frozen=True, eq=False, slots=True)
class WrittenRoad:
    """One road; lanes from the reference line outwards, the right ones driven along it."""

    name: str
    # plan: pieces: s, x, y [m], heading [rad], length [m]; and, of curves, aV .. dV behind bU .. dU: bU, cU, dU,
    # cV, dV, shape (n, 5) or (n, 10)
    plan: FloatArray
    left: Sequence[WrittenLane]
    right: Sequence[WrittenLane]
    origin: tuple[float, float] = (0.0, 0.0)  # of its coordinates in the recording's [m]
    number: int = 1
    rule: str = "RHT"
    kind: str = "motorway"
    offset: FloatArray | None = None  # of its lanes, laid out as a lane's width
    links: Mapping[str, tuple[str, int]] = field(default_factory=dict)
    """Of "predecessor" and "successor": "road" or "junction", and its number. A road is entered at its start."""

    def to_xml(self) -> str:
        """The document of this road alone, the same bytes each time."""
        return roads_xml(self.name, [self], origin=self.origin)

    def add_to(self, root: etree._Element) -> None:
        """Write it into a document."""
        about = {"name": self.name, "length": decimal(float(self.plan[-1, 0] + self.plan[-1, 4]), 6)}
        road = sub(root, "road", **about, id=str(self.number), junction="-1", rule=self.rule)
        for end, (element, number) in sorted(self.links.items()):  # in the schema's order
            touched = {"contactPoint": "start" if end == "successor" else "end"} if element == "road" else {}
            owner = road[0] if len(road) else sub(road, "link")
            sub(owner, end, elementType=element, elementId=str(number), **touched)
        sub(road, "type", s="0", type=self.kind)
        plan = sub(road, "planView")
        for piece in self.plan:
            _geometry(plan, piece)
        lanes_element = sub(road, "lanes")
        for s, *cubic in [] if self.offset is None else self.offset:
            sub(lanes_element, "laneOffset", s=decimal(s, 6), **_cubic(cubic))
        section = sub(lanes_element, "laneSection", s="0")
        for tag, lanes, sign in (("left", self.left, 1), ("center", (), 0), ("right", self.right, -1)):
            side = sub(section, tag) if lanes or not sign else None
            if side is not None and not sign:
                sub(side, "lane", id="0", type="none", level="false")
            numbered = [(sign * (k + 1), lane) for k, lane in enumerate(lanes)]
            for number, lane in numbered[::-1] if sign > 0 else numbered:  # from left to right
                assert side is not None
                outer = lanes[abs(number)].kind if abs(number) < len(lanes) else ""
                _lane(side, number, lane, outer)


Connections = Sequence[tuple[int, int, Sequence[tuple[int, int]]]]
"""From a road's end to another's start, by their numbers, and lanes from and to."""


def roads_xml(
    name: str,
    roads: Sequence[WrittenRoad],
    *,
    junctions: Mapping[int, Connections] | None = None,
    origin: tuple[float, float] = (0.0, 0.0),
) -> str:
    """A document of several roads, the same bytes each time.

    `junctions`: where roads part or meet, by number: direct ones, which are new in OpenDRIVE 1.7. `origin`: of the
    coordinates in the recording's. [m]
    """
    root = etree.Element("OpenDRIVE")
    header = sub(root, "header", revMajor="1", revMinor="7" if junctions else "6", name=name, vendor="xosc-lateral")
    if origin != (0.0, 0.0):
        x, y = (decimal(value, 3) for value in origin)
        sub(header, "offset", x=x, y=y, z="0", hdg="0")
    for road in roads:
        road.add_to(root)
    for junction, connections in (junctions or {}).items():
        element = sub(root, "junction", name="", id=str(junction), type="direct")
        for number, (incoming, linked, lanes) in enumerate(connections):
            ends = {"incomingRoad": str(incoming), "linkedRoad": str(linked), "contactPoint": "start"}
            connection = sub(element, "connection", id=str(number), **ends)
            for lane, other in lanes:
                sub(connection, "laneLink", **{"from": str(lane), "to": str(other)})
    etree.indent(root, "  ")
    text = f"<?xml version='1.0' encoding='UTF-8'?>\n{etree.tostring(root, encoding='unicode')}\n"
    return text + template_mark(text)


def _geometry(plan: etree._Element, piece: FloatArray) -> None:
    digits = {"s": 6, "x": 6, "y": 6, "hdg": 9, "length": 6}
    item = sub(
        plan, "geometry", **{name: decimal(value, digits[name]) for name, value in zip(digits, piece, strict=False)}
    )
    if len(piece) == 5:
        sub(item, "line")
        return
    names = ("bU", "cU", "dU", "cV", "dV")
    values = {name: f"{value:.12g}" for name, value in zip(names, piece[5:], strict=True)}
    sub(item, "paramPoly3", aU="0", aV="0", bV="0", **values, pRange="arcLength")


def _lane(side: etree._Element, number: int, lane: WrittenLane, outer: str) -> None:
    item = sub(side, "lane", id=str(number), type=lane.kind, level="false")
    for tag, linked in (("predecessor", lane.predecessor), ("successor", lane.successor)):
        if linked is not None:
            sub(item[0] if len(item) else sub(item, "link"), tag, id=str(linked))
    for s, *cubic in lane.width:
        sub(item, "width", sOffset=decimal(s, 6), **_cubic(cubic))
    if lane.kind == "driving":
        mark = "broken" if outer == "driving" else "solid"
        sub(item, "roadMark", sOffset="0", type=mark, weight="standard", color="white", width="0.15")


def _cubic(values: Sequence[float]) -> dict[str, str]:
    return {name: f"{value:.9g}" for name, value in zip("abcd", values, strict=True)}


def curved_plan(
    line: ReferenceLine, origin: tuple[float, float] = (0.0, 0.0), piece: float = PIECE_LENGTH
) -> FloatArray:
    """A smooth line as cubic pieces of about that length [m], shape (n, 10); see `WrittenRoad.plan`."""
    edges = np.linspace(0.0, line.length, max(1, round(line.length / piece)) + 1)
    place, way = line.place(edges, 0) - np.array(origin), line.place(edges, 1)
    way = way / np.linalg.norm(way, axis=1, keepdims=True)
    heading = np.arctan2(way[:-1, 1], way[:-1, 0])
    length = np.diff(edges)
    along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    step, ahead = np.diff(place, axis=0), way[1:]
    u, v = (step * along).sum(axis=1), (step * across).sum(axis=1)
    du, dv = (ahead * along).sum(axis=1), (ahead * across).sum(axis=1)
    # Hermite's cubic over the length: at 0 the place 0 and the direction (1, 0), at the end (u, v) and (du, dv)
    c_u, d_u = (3 * u / length - 2 - du) / length, (1 + du - 2 * u / length) / length**2
    c_v, d_v = (3 * v / length - dv) / length, (dv - 2 * v / length) / length**2
    return np.column_stack([edges[:-1], place[:-1], heading, length, np.ones(len(length)), c_u, d_u, c_v, d_v])


# ---- a recording's own lanes: lanes side by side make a road, and roads are linked as the lanes are ----
# All lanes of a road are driven along it. Where roads part or meet there is a direct junction.
LANE_PIECE_LENGTH = 5.0  # of a curved reference line: a cubic is off by 2 mm on a radius of 10 m, see `curved_plan` [m]
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
    plan = curved_plan(line, piece=LANE_PIECE_LENGTH)
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
