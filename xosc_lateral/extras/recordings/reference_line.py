"""A line between the two carriageways of a recorded road, from everybody's tracks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import NotEnoughDataError

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

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
