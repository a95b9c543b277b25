"""``planView``: the elements of a reference line."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import cos, sin

import numpy as np
from msgspec import Struct

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.opendrive.document import RoadFile, XmlElement
from xosc_lateral.road.arc_length import end_parameter, parameter_pieces
from xosc_lateral.road.geometry import MAX_TURN, Arc, Line, ParamCubic, ReferenceElement, Spiral
from xosc_lateral.road.piecewise import Cubic

# Shorter elements are left out: rounding in the file, no road. [m]
SHORTEST = 1e-9


class CubicRecord(Struct, frozen=True):
    """A paramPoly3 or poly3, before its arc length is known."""

    x: float
    y: float
    heading: float
    length: float
    u: Cubic
    v: Cubic
    p_end: float


Record = tuple[float, float, ReferenceElement | CubicRecord]
"""s and length of an element, and the element."""


def read_plan_view(road: XmlElement, source: RoadFile) -> list[Record]:
    """Elements of one road in order of s."""
    records: list[Record] = []
    for geometry in road.iterfind("planView/geometry"):
        length = source.number(geometry, "length")
        if length < SHORTEST:
            source.note(f"geometry of length {length:g} m left out", geometry)
            continue
        records.append((source.number(geometry, "s"), length, _element(geometry, length, source)))
    if not records:
        raise source.error("no planView/geometry with a length: a road needs a reference line", road)
    return sorted(records, key=lambda record: record[0])


def _element(geometry: XmlElement, length: float, source: RoadFile) -> ReferenceElement | CubicRecord:
    x, y, heading = (source.number(geometry, name) for name in ("x", "y", "hdg"))
    for shape in geometry:
        match shape.tag:
            case "line":
                return Line.of(x, y, heading, length)
            case "arc":
                curvature = source.number(shape, "curvature")
                _check_turn(curvature, length, shape, source)
                return Arc(x, y, heading, length, curvature)
            case "spiral":
                start, end = source.number(shape, "curvStart"), source.number(shape, "curvEnd")
                _check_turn(max(abs(start), abs(end)), length, shape, source)
                return Spiral.of(x, y, heading, length, start, end)
            case "poly3":
                v = source.cubic(shape)
                return CubicRecord(x, y, heading, length, (0.0, 1.0, 0.0, 0.0), v, end_parameter(v, length))
            case "paramPoly3":
                u, v = (_coefficients(shape, axis, source) for axis in "UV")
                p_end = length if shape.get("pRange") == "arcLength" else 1.0
                return CubicRecord(x, y, heading, length, u, v, p_end)
    raise _unknown(geometry, source)


def _unknown(geometry: XmlElement, source: RoadFile) -> FormatError:
    known = "line, arc, spiral, poly3, paramPoly3"
    found = ", ".join(str(child.tag) for child in geometry) or "nothing"
    return source.error(f"no shape that is known ({known}); found {found}", geometry)


def _coefficients(shape: XmlElement, axis: str, source: RoadFile) -> Cubic:
    a, b, c, d = (source.number(shape, letter + axis, 0.0) for letter in "abcd")
    return (a, b, c, d)


def _check_turn(curvature: float, length: float, shape: XmlElement, source: RoadFile) -> None:
    turn = abs(curvature) * length
    if turn > MAX_TURN:
        raise source.error(
            f"curvature {curvature:g} 1/m over {length:g} m turns by {turn:g} rad; limit {MAX_TURN:g}", shape
        )


def finish_elements(records: Iterable[Sequence[Record]]) -> list[tuple[ReferenceElement, ...]]:
    """Elements of all roads, cubics run through by arc length (computed for all of them at once)."""
    roads = [[element for _, _, element in road] for road in records]
    cubics = [element for road in roads for element in road if isinstance(element, CubicRecord)]
    done = iter(_finish_cubics(cubics))
    return [tuple(next(done) if isinstance(e, CubicRecord) else e for e in road) for road in roads]


def _finish_cubics(cubics: Sequence[CubicRecord]) -> list[ParamCubic]:
    if not cubics:
        return []
    length = np.array([c.length for c in cubics])
    u, v = np.array([c.u for c in cubics]), np.array([c.v for c in cubics])
    pieces = parameter_pieces(u, v, np.array([c.p_end for c in cubics]), length)
    return [_world(cubic, parameter.tolist()) for cubic, parameter in zip(cubics, pieces, strict=True)]


def _world(cubic: CubicRecord, parameter: list[list[float]]) -> ParamCubic:
    """Turn u, v into world x, y."""
    c, s = cos(cubic.heading), sin(cubic.heading)
    x = [c * u - s * v for u, v in zip(cubic.u, cubic.v, strict=True)]
    y = [s * u + c * v for u, v in zip(cubic.u, cubic.v, strict=True)]
    x[0] += cubic.x
    y[0] += cubic.y
    return ParamCubic(
        tuple(x), tuple(y), cubic.length, cubic.length / len(parameter), tuple(tuple(piece) for piece in parameter)
    )
