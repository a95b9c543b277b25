"""Reference lines of all roads, for arrays of places.

Lines, arcs and spirals are one kind (clothoid pieces with a power series), paramPoly3 and poly3 the other. Arrays are
laid out coefficient by coefficient, so that a whole chunk of places is a handful of gathers and multiply-adds.

The series of a clothoid about its middle is derived in docs/design/clothoids.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.world.road.geometry import SERIES_TERMS, ClothoidPiece, ParamCubic, pieces_of
from xosc_lateral.world.road.piecewise import IndexLike, Lookup
from xosc_lateral.world.road.road import Road

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


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


# ---- a line through the places that vehicles of a recording have been at ----
BIN_LENGTH = 20.0  # [m] along the road; short beside any motorway curve, long enough for tens of vehicles
KNOT_SPACING = 300.0  # [m]; camera calibration bends the tracks at 100-300 m, the road itself only more slowly
CURVATURE_KNOT_SPACING = 900.0  # [m]; a 0.3 m camera wave of 200 m would look like a curve of 3 km radius
INNER_QUANTILE = 0.9  # of the lateral position in a bin: lies in the innermost lane, whatever ramps do on the outside


@dataclass(frozen=True, eq=False)
class ReferenceLine:
    """A smooth line between the two carriageways, `s` [m] growing along the first direction of travel."""

    length: float  # [m]
    place: Callable[[FloatArray, int], FloatArray]  # s, order of derivative -> x, y [m], derived by s, shape (n, 2)
    curvature: Callable[[FloatArray], FloatArray]  # of s, positive to the left of growing s [1/m]

    def project(self, xy: FloatArray, guess: FloatArray) -> tuple[FloatArray, FloatArray]:
        """`s` and lateral distance `d` [m] of points, `d` positive to the left of growing `s`.

        Newton steps on the foot point; four give 1e-9 m on lines that bend as little as a motorway.
        """
        s = guess
        for _ in range(4):
            away, tangent = xy - self.place(s, 0), self.place(s, 1)
            s = s + (away * tangent).sum(axis=1) / (tangent**2).sum(axis=1)
        away, tangent = xy - self.place(s, 0), self.place(s, 1)
        tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
        return s, tangent[:, 0] * away[:, 1] - tangent[:, 1] * away[:, 0]


def fit_reference_line(xy: FloatArray, forward: NDArray[np.bool_]) -> tuple[ReferenceLine, FloatArray, FloatArray]:
    """Line midway between the innermost lanes of both directions, and every point's (s, d) on it.

    Raises `NotEnoughDataError` if the tracks don't cover at least 1 km in both directions. The road has to be a
    function of its principal axis: true for a few kilometres of motorway, not for a loop.

    `xy`: positions of all vehicles, sorted by vehicle and time, shape (n, 2). [m] `forward`: where the vehicle travels
    in the first direction (`s` grows with it), shape (n,).
    """
    from scipy.interpolate import CubicSpline

    middle = xy.mean(axis=0)
    axis = np.linalg.svd(xy[:: max(1, len(xy) // 20_000)] - middle, full_matrices=False)[2][0]
    # Most rows follow one of the same vehicle, so the median step gives the direction of travel.
    if forward.any() and np.median(np.diff(xy[forward] @ axis)) < 0.0:
        axis = -axis
    along, across = (xy - middle) @ axis, (xy - middle) @ np.array([-axis[1], axis[0]])
    u, v = _bin_middles(along, across, forward)
    line = _smooth(u, v, KNOT_SPACING)
    fine = np.arange(along.min() - 50.0, along.max() + 50.0, 0.5)
    inside = np.clip(fine, u[0], u[-1])
    curve = line(inside) + line.derivative()(inside) * (fine - inside)  # straight beyond both ends
    s_fine = np.r_[0.0, np.cumsum(np.hypot(np.diff(fine), np.diff(curve)))]
    rotation = np.array([axis, [-axis[1], axis[0]]])
    places = CubicSpline(s_fine, np.column_stack([fine, curve]) @ rotation + middle)
    slow = _smooth(u, v, CURVATURE_KNOT_SPACING)
    bend = slow.derivative(2)(inside) / (1.0 + slow.derivative(1)(inside) ** 2) ** 1.5

    reference = ReferenceLine(
        length=float(s_fine[-1]),
        place=lambda s, order: np.asarray(places(s, order)),
        curvature=lambda s: np.interp(s, s_fine, bend),
    )
    s, d = reference.project(xy, np.interp(along, fine, s_fine))
    return reference, s, d


def _bin_middles(along: FloatArray, across: FloatArray, forward: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    """Midway between the innermost traffic of both directions, per bin along the road."""
    number = np.floor((along - along.min()) / BIN_LENGTH).astype(np.int64)
    n_bins = int(number.max()) + 1
    inner = np.full((2, n_bins), np.nan)
    for row, (mine, quantile) in enumerate(((forward, INNER_QUANTILE), (~forward, 1.0 - INNER_QUANTILE))):
        order = np.argsort(number[mine], kind="stable")
        starts = np.searchsorted(number[mine][order], np.arange(n_bins + 1))
        values = across[mine][order]
        for k in range(n_bins):
            if starts[k + 1] - starts[k] >= 50:
                inner[row, k] = np.quantile(values[starts[k] : starts[k + 1]], quantile)
    middle = inner.mean(axis=0)
    known = np.isfinite(middle)
    if known.sum() * BIN_LENGTH < 1000.0:
        raise NotEnoughDataError(
            f"traffic in both directions on {known.sum() * BIN_LENGTH:.0f} m of road; 1000 m are needed"
        )
    return along.min() + BIN_LENGTH * (np.flatnonzero(known) + 0.5), middle[known]


def _smooth(u: FloatArray, v: FloatArray, spacing: float) -> BSpline[np.float64]:
    """Cubic least-squares spline with evenly spaced knots."""
    from scipy.interpolate import make_lsq_spline

    inner = np.linspace(u[0], u[-1], max(2, round((u[-1] - u[0]) / spacing) + 1))[1:-1]
    return make_lsq_spline(u, v, np.r_[[u[0]] * 4, inner, [u[-1]] * 4], 3)
