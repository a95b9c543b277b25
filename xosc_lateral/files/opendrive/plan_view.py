"""``planView``: the elements of a reference line; of parametric cubics, from metres along the road to the parameter.

References
----------
.. [1] ASAM OpenDRIVE 1.8, chapter 9, "Parametric cubic curve": p runs with the arc length, or from 0 to 1.
.. [2] M. Abramowitz, I. A. Stegun, "Handbook of Mathematical Functions", 1964, table 25.4: Gauss-Legendre nodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import cos, sin

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.files.opendrive.document import RoadFile, XmlElement
from xosc_lateral.world.road.geometry import MAX_TURN, Arc, Line, ParamCubic, Placed, ReferenceElement, Spiral
from xosc_lateral.world.road.piecewise import Cubic

PIECES_PER_ELEMENT = 32
"""Pieces of p(ds) per element. Field junctions: ds is then true to 1e-6 m, and p(ds) has no corner."""

# Gauss-Legendre nodes and weights on [0, 1], 5 points: exact for polynomials of degree 9.
_NODES, _WEIGHTS = (
    part * 0.5 + shift for part, shift in zip(np.polynomial.legendre.leggauss(5), (0.5, 0.0), strict=True)
)


def parameter_pieces(u: FloatArray, v: FloatArray, p_end: FloatArray, length: FloatArray) -> FloatArray:
    """p as a function of ds: piecewise cubic over `PIECES_PER_ELEMENT` equal pieces of each element.

    The curve's arc length over [0, p_end] is scaled to `length`, as the reference player does: files whose length
    attribute differs from it by rounding stay continuous.

    `u`, `v`: coefficients of the two coordinates, lowest power first, shape (n, 4). `p_end`, `length`: parameter at the
    end and length attribute [m], shape (n,). The result: cubics of ds about each piece's start, shape (n, PIECES, 4).
    """

    def integral(begin: FloatArray, reach: FloatArray) -> FloatArray:
        """Mean of |dx/dp| over [begin, begin + reach]."""
        total = np.zeros_like(begin)
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            total += weight * _speed(u, v, begin + node * reach)
        return total

    grid = np.linspace(0.0, 1.0, PIECES_PER_ELEMENT + 1)
    p, rows = p_end[:, None] * grid, np.arange(len(p_end))[:, None]
    step = (p_end / PIECES_PER_ELEMENT)[:, None]
    arc = np.concatenate([np.zeros((len(p_end), 1)), np.cumsum(integral(p[:, :-1], step) * step, axis=1)], axis=1)
    total = arc[:, -1].copy()
    straight = ~(total > 0.0)[:, None]  # degenerate: the parameter runs evenly
    scale = np.where(straight[:, 0], 1.0, length / np.where(straight[:, 0], 1.0, total))[:, None]
    target = length[:, None] * grid
    arc = np.where(straight, target, arc * scale)
    value = np.stack([np.interp(target[i], arc[i], p[i]) for i in range(len(p_end))])
    if not straight.all():  # Newton steps on arc(p) = target, from the nearest grid point below
        below = np.clip(np.floor(value / step).astype(int), 0, PIECES_PER_ELEMENT - 1)
        origin, base = p[rows, below], arc[rows, below]
        for _ in range(4):
            reach = value - origin
            speed = np.maximum(_speed(u, v, value), 1e-9) * scale
            miss = target - base - integral(origin, reach) * reach * scale
            value = np.where(straight, value, np.clip(value + miss / speed, 0.0, p_end[:, None]))
        value = np.maximum.accumulate(value, axis=1)
    value[:, 0], value[:, -1] = 0.0, p_end
    # dp/ds at the nodes, at most three times the neighbouring secants: p(ds) never runs back (Fritsch-Carlson)
    slope = 1.0 / (np.maximum(_speed(u, v, value), 1e-9) * scale)
    secant = np.diff(value, axis=1) / (length / PIECES_PER_ELEMENT)[:, None]
    slope[:, :-1] = np.minimum(slope[:, :-1], 3.0 * secant)
    slope[:, 1:] = np.minimum(slope[:, 1:], 3.0 * secant)
    # Hermite's cubics
    h, a, b = (length / PIECES_PER_ELEMENT)[:, None], value[:, :-1], slope[:, :-1]
    rise, end = value[:, 1:] - a - b * h, slope[:, 1:] - b
    return np.stack([a, b, (3.0 * rise - end * h) / h**2, (end * h - 2.0 * rise) / h**3], axis=-1)


def _speed(u: FloatArray, v: FloatArray, p: FloatArray) -> FloatArray:
    du = u[:, 1:2] + p * (2.0 * u[:, 2:3] + 3.0 * p * u[:, 3:4])
    dv = v[:, 1:2] + p * (2.0 * v[:, 2:3] + 3.0 * p * v[:, 3:4])
    return np.asarray(np.hypot(du, dv))


def end_parameter(v: tuple[float, float, float, float], length: float) -> float:
    """Parameter u at which v(u) = a + b u + c u^2 + d u^3 has run `length` metres (poly3)."""
    coefficients = np.array([v]), np.array([[0.0, 1.0, 0.0, 0.0]])
    low, high = 0.0, length  # the curve is at least as long as u
    for _ in range(200):
        middle = 0.5 * (low + high)
        nodes = (np.arange(64)[:, None] + _NODES[None, :]).ravel()[None, :] * (middle / 64)
        arc = float((_speed(coefficients[1], coefficients[0], nodes) * np.tile(_WEIGHTS, 64)).sum() * middle / 64)
        low, high = (middle, high) if arc < length else (low, middle)
        if high - low < 1e-13 * length:
            break
    return 0.5 * (low + high)


# Shorter elements are left out: rounding in the file, no road. [m]
MINIMUM_ELEMENT_LENGTH = 1e-9


class CubicRecord(Placed, frozen=True):
    """A paramPoly3 or poly3, before its arc length is known."""

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
        if length < MINIMUM_ELEMENT_LENGTH:
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
                u, v = (source.cubic(shape, axis) for axis in "UV")
                p_end = length if shape.get("pRange") == "arcLength" else 1.0
                return CubicRecord(x, y, heading, length, u, v, p_end)
    known = "line, arc, spiral, poly3, paramPoly3"
    children = ", ".join(str(child.tag) for child in geometry) or "nothing"
    raise source.error(f"no shape that is known ({known}); found {children}", geometry)


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
    pieces = iter(())
    if cubics:
        u, v, p_end, length = (np.array([getattr(c, name) for c in cubics]) for name in ("u", "v", "p_end", "length"))
        pieces = iter(parameter_pieces(u, v, p_end, length).tolist())
    return [tuple(_world(e, next(pieces)) if isinstance(e, CubicRecord) else e for e in road) for road in roads]


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
