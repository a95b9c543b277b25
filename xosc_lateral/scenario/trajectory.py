"""Trajectories and their shapes."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.enums import ReferenceContext
from xosc_lateral.scenario.place import Place, Unsupported
from xosc_lateral.scenario.position import Position


@dataclass(frozen=True, slots=True)
class Vertex:
    """Corner of a polyline; `time` [s] or None."""

    position: Position
    time: float | None


@dataclass(frozen=True, slots=True)
class Polyline:
    """Straight pieces between vertices."""

    vertices: tuple[Vertex, ...]


@dataclass(frozen=True, slots=True)
class Clothoid:
    """Curvature changes linearly: start [1/m], change per length [1/m2], length [m], times [s]."""

    position: Position
    curvature: float
    curvature_prime: float
    length: float
    start_time: float | None = None
    stop_time: float | None = None


@dataclass(frozen=True, slots=True)
class ClothoidSplineSegment:
    """Piece of a clothoid spline; without a position it goes on from the one before, turned by `h_offset` [rad]."""

    curvature_start: float
    curvature_end: float
    length: float
    h_offset: float = 0.0
    time_start: float | None = None
    position_start: Position | None = None


@dataclass(frozen=True, slots=True)
class ClothoidSpline:
    """Clothoid pieces one after another."""

    segments: tuple[ClothoidSplineSegment, ...]
    time_end: float | None = None


@dataclass(frozen=True, slots=True)
class ControlPoint:
    """Of a NURBS curve."""

    position: Position
    time: float | None = None
    weight: float = 1.0


@dataclass(frozen=True, slots=True)
class Nurbs:
    """Rational B-spline; `order` is degree + 1."""

    order: int
    control_points: tuple[ControlPoint, ...]
    knots: tuple[float, ...]


Shape = Polyline | Clothoid | ClothoidSpline | Nurbs | Unsupported


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A named path, with or without times."""

    name: str
    shape: Shape
    closed: bool
    place: Place


@dataclass(frozen=True, slots=True)
class Timing:
    """Trajectory times to scenario time: ``time * scale + offset`` [s], absolute or from the action's start."""

    domain: ReferenceContext
    scale: float
    offset: float
