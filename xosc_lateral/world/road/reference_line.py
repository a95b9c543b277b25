"""Reference lines of all roads, for arrays of places.

Lines, arcs and spirals are one kind (clothoid pieces with a power series), paramPoly3 and poly3 the other. Arrays are
laid out coefficient by coefficient, so that a whole chunk of places is a handful of gathers and multiply-adds.

The series of a clothoid about its middle is derived in docs/design/clothoids.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.world.road.geometry import SERIES_TERMS, ClothoidPiece, ParamCubic, pieces_of
from xosc_lateral.world.road.piecewise import IndexLike, Lookup
from xosc_lateral.world.road.road import Road


class Frame(NamedTuple):
    """Reference lines at some places: position, tangent, heading; where asked for, curvature and speed |d(x, y)/ds|."""

    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray
    heading: FloatArray
    curvature: FloatArray
    speed: FloatArray


class ReferenceLines:
    """All reference lines of a network."""

    def __init__(self, roads: Sequence[Road]) -> None:
        starts: list[list[float]] = []
        pieces: list[tuple[float, bool, int]] = []  # s of what it is expanded about, whether a cubic, row of its table
        clothoids: list[ClothoidPiece] = []
        cubics: list[tuple[float, ...]] = []
        for road in roads:
            curvatures: list[float] = []
            for start, element in zip(road.starts, road.elements, strict=True):
                if isinstance(element, ParamCubic):
                    for i, parameter in enumerate(element.parameter):
                        curvatures.append(start + i * element.step)
                        pieces.append((curvatures[-1], True, len(cubics)))
                        cubics.append((*parameter, *element.x, *element.y))
                else:
                    for piece in pieces_of(element):
                        curvatures.append(start + piece.start)
                        pieces.append((start + piece.middle, False, len(clothoids)))
                        clothoids.append(piece)
            starts.append(curvatures)
        self._lookup = Lookup(starts)
        self._origin = np.array([origin for origin, _, _ in pieces])
        self._is_cubic = np.array([is_cubic for _, is_cubic, _ in pieces])
        self._row = np.array([row for _, _, row in pieces], dtype=np.intp)
        self._clothoid = np.array([(p.heading, p.curvature, p.sharpness) for p in clothoids]).reshape(-1, 3).T.copy()
        self._x_series = np.array([p.x_series for p in clothoids]).reshape(-1, SERIES_TERMS + 1).T.copy()
        self._y_series = np.array([p.y_series for p in clothoids]).reshape(-1, SERIES_TERMS + 1).T.copy()
        # Straight roads need no power series at all: the highest power that any piece uses.
        used = np.flatnonzero((self._x_series != 0.0).any(axis=1) | (self._y_series != 0.0).any(axis=1))
        self._powers = int(used[-1]) if len(used) else 0
        self._cubic = np.array(cubics).reshape(-1, 12).T.copy()

    def at(self, road: IndexLike, s: FloatArray, *, derivatives: bool = False) -> Frame:
        """The reference lines at s, curvature and speed only with `derivatives`. Shape as `s`. [m], [rad], [1/m]"""
        piece = self._lookup.find(road, s)
        ds = s - self._origin[piece]
        row = self._row[piece]
        is_cubic = self._is_cubic[piece]
        if isinstance(piece, int) or is_cubic.all() or not is_cubic.any():
            return (self._cubic_frame if np.any(is_cubic) else self._clothoid_frame)(row, ds, derivatives)
        return self._mixed(row, ds, is_cubic, derivatives)

    def _mixed(self, row: NDArray[np.intp], ds: FloatArray, is_cubic: NDArray[np.bool_], derivatives: bool) -> Frame:
        """Rows of either kind, evaluated apart."""
        frame = Frame(*(np.empty(len(ds)) for _ in Frame._fields))
        for evaluate, where in (
            (self._cubic_frame, np.flatnonzero(is_cubic)),
            (self._clothoid_frame, np.flatnonzero(~is_cubic)),
        ):
            for whole, part in zip(frame, evaluate(row[where], ds[where], derivatives), strict=True):
                if len(part):
                    whole[where] = part
        return frame

    def _clothoid_frame(self, row: NDArray[np.intp], ds: FloatArray, derivatives: bool) -> Frame:
        heading, curvature, sharpness = (values.take(row) for values in self._clothoid)
        turned = heading + ds * (curvature + (0.5 * ds) * sharpness)
        x, y = (_polynomial(series[: self._powers + 1], row, ds) for series in (self._x_series, self._y_series))
        if not derivatives:
            return Frame(x, y, np.cos(turned), np.sin(turned), turned, _EMPTY, _EMPTY)
        return Frame(x, y, np.cos(turned), np.sin(turned), turned, curvature + ds * sharpness, np.ones_like(ds))

    def _cubic_frame(self, row: NDArray[np.intp], ds: FloatArray, derivatives: bool) -> Frame:
        p0, p1, p2, p3, x0, x1, x2, x3, y0, y1, y2, y3 = (values.take(row) for values in self._cubic)
        p = p0 + ds * (p1 + ds * (p2 + ds * p3))
        dx = x1 + p * (2.0 * x2 + (3.0 * p) * x3)
        dy = y1 + p * (2.0 * y2 + (3.0 * p) * y3)
        norm = np.sqrt(dx * dx + dy * dy)
        norm = np.where(norm > 0.0, norm, 1.0)
        x = x0 + p * (x1 + p * (x2 + p * x3))
        y = y0 + p * (y1 + p * (y2 + p * y3))
        heading = np.arctan2(dy, dx)
        if not derivatives:
            return Frame(x, y, dx / norm, dy / norm, heading, _EMPTY, _EMPTY)
        ddx, ddy = 2.0 * x2 + 6.0 * p * x3, 2.0 * y2 + 6.0 * p * y3
        curvature = (dx * ddy - dy * ddx) / norm**3
        speed = norm * (p1 + ds * (2.0 * p2 + 3.0 * ds * p3))
        return Frame(x, y, dx / norm, dy / norm, heading, curvature, speed)


_EMPTY: NDArray[np.float64] = np.empty(0)


def _polynomial(coefficients: FloatArray, row: NDArray[np.intp], at: FloatArray) -> FloatArray:
    """Horner, lowest power first."""
    value = coefficients[-1].take(row)
    for series in coefficients[-2::-1]:
        value *= at
        value += series.take(row)
    return np.asarray(np.broadcast_to(value, at.shape))
