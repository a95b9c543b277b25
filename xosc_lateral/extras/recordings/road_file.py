"""A road of our own as OpenDRIVE: a reference line in pieces, lanes whose widths are cubic pieces.

Written with lxml, as scenarios are (`files/openscenario/write/build.py` says why).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from lxml import etree

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.lazy import interpolate
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
