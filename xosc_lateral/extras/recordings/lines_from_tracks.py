"""Lines out of everybody's tracks: between the carriageways of a road, and a lane's centre with its standard error.

What every vehicle does at the same place is the lane (and the camera's calibration error); what single vehicles do is
driving. So a lane's centre is the mean over vehicles as a function of s. Rows of one vehicle are no independent
measurements, so the fit is weighted as if its residual were a first-order autoregression (generalised least squares),
and the standard error is computed from whole passages (sandwich estimator), which holds whatever the correlation is.

A camera that looks along the road sees tall vehicles displaced (parallax), by an amount that varies with the place: a
second line, the tilt, per metre of height above the lane's mean. Its own mean along the road is not taken out: it can't
be separated from trucks that really keep to another side than cars.

References
----------
.. [1] D. Cochrane, G. H. Orcutt, "Application of least squares regression to relationships containing auto-correlated
       error terms", J. American Statistical Association 44, 1949.
.. [2] K.-Y. Liang, S. L. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986: the
       sandwich over whole passages.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import MAD_TO_SD, FloatArray, IntArray, true_slices
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.lazy import interpolate

# ---- a line between both carriageways ----
BIN_LENGTH = 20.0  # [m] along the road; short beside any motorway curve, long enough for tens of vehicles
ROAD_KNOT_SPACING = 300.0  # [m]; camera calibration bends the tracks at 100-300 m, the road itself only more slowly
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
    middle = xy.mean(axis=0)
    axis = np.linalg.svd(xy[:: max(1, len(xy) // 20_000)] - middle, full_matrices=False)[2][0]
    # Most rows follow one of the same vehicle, so the median step gives the direction of travel.
    if forward.any() and np.median(np.diff(xy[forward] @ axis)) < 0.0:
        axis = -axis
    along, across = (xy - middle) @ axis, (xy - middle) @ np.array([-axis[1], axis[0]])
    u, v = _bin_middles(along, across, forward)
    line = _smooth(u, v, ROAD_KNOT_SPACING)
    fine = np.arange(along.min() - 50.0, along.max() + 50.0, 0.5)
    inside = np.clip(fine, u[0], u[-1])
    curve = line(inside) + line.derivative()(inside) * (fine - inside)  # straight beyond both ends
    s_fine = np.r_[0.0, np.cumsum(np.hypot(np.diff(fine), np.diff(curve)))]
    rotation = np.array([axis, [-axis[1], axis[0]]])
    places = interpolate.CubicSpline(s_fine, np.column_stack([fine, curve]) @ rotation + middle)
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


def _smooth(u: FloatArray, v: FloatArray, spacing: float) -> interpolate.BSpline[np.float64]:
    """Cubic least-squares spline with evenly spaced knots."""
    inner = np.linspace(u[0], u[-1], max(2, round((u[-1] - u[0]) / spacing) + 1))[1:-1]
    return interpolate.make_lsq_spline(u, v, np.r_[[u[0]] * 4, inner, [u[-1]] * 4], 3)


# ---- lane centres out of the traffic that uses the lanes ----
KNOT_SPACING = 50.0  # [m]; chosen by leave-vehicles-out error on DLR HT (docs/real_data.md)
MAX_ERROR = 0.15  # [m]; where the centre's standard error is larger (ends of the road), rows are cut
TILT_PENALTY = 4.0  # ridge on the tilt's coefficients [-]; chosen likewise, 1 to 10 give the same within 1 %
CORRELATION = 0.9  # correlation of a driver's offset after 1 s, as assumed by the weights; 1 would let the level drift
ROUNDS = 4  # of reweighting; the line moves by under 1 mm after three
HUBER_LIMIT = 2.0  # residuals beyond this many standard deviations count less: undetected lane changes
BEND_PENALTY = 0.1  # [-]
COUNT_WINDOW = 100.0  # of road, in which passages are counted [m]
MIN_PASSAGES = 10  # per window, below which the lane ends


@dataclass(frozen=True, eq=False)
class LaneCentreLine:
    """Lateral position of a lane's centre along a reference line, as used by its traffic."""

    start: float  # start, end: range of `s` with enough vehicles [m]
    end: float
    knots: FloatArray  # of the cubic spline, shape (n + 4,) [m]
    coefficients: FloatArray  # shape (n,) [m]
    # tilt: coefficients of the displacement per metre of height above the mean, about its own mean along the
    # road, shape (n,) [-]
    tilt: FloatArray
    height: float  # mean height of the vehicles in this lane [m]
    covariance: FloatArray  # of `coefficients`, shape (n, n) [m²]
    passages: int  # how many the estimate rests on

    def at(self, s: FloatArray, height: FloatArray) -> FloatArray:
        """Lateral position of the centre as seen on a vehicle of that height [m]; NaN outside of start..end."""
        inside = (s >= self.start) & (s <= self.end)
        both = interpolate.BSpline(self.knots, np.column_stack([self.coefficients, self.tilt]), 3)(
            np.clip(s, self.start, self.end)
        )
        return np.asarray(np.where(inside, both[:, 0] + (height - self.height) * both[:, 1], np.nan), dtype=np.float64)

    def standard_error(self, s: FloatArray) -> FloatArray:
        """Standard error of `at` from the finite number of vehicles [m]."""
        basis = _basis(np.clip(s, self.start, self.end), self.knots)
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", basis, self.covariance, basis)))


def fit_lane_centre(
    s: FloatArray, d: FloatArray, height: FloatArray, passage: IntArray, *, knot_spacing: float = KNOT_SPACING
) -> LaneCentreLine:
    """Fit one lane's centre to rows of vehicles that keep to it, one a second, by passage and time, shape (n,). [m]

    `passage`: uninterrupted, of one vehicle. `knot_spacing`: longer is blind to the bends that camera calibration puts
    into the tracks, shorter follows single drivers. [m]
    """
    start, end = _covered(s, passage)
    keep = (s >= start) & (s <= end)
    mean_height = float(height[keep].mean())
    s, d, taller, passage = s[keep], d[keep], height[keep] - mean_height, passage[keep]
    inner = np.linspace(start, end, max(2, round((end - start) / knot_spacing) + 1))
    knots = np.r_[[start] * 3, inner, [end] * 3]
    basis = _basis(s, knots)
    size = basis.shape[1]
    design = np.hstack([basis, basis * taller[:, None], taller[:, None]])
    # The penalty on bends carries the line over places where nobody was measured; the tilt is small, its mean free.
    bend = BEND_PENALTY * np.diff(np.eye(size), n=2, axis=0)
    penalty = np.zeros((2 * size + 1, 2 * size + 1))
    penalty[:size, :size] = bend.T @ bend
    penalty[size : 2 * size, size : 2 * size] = TILT_PENALTY * np.eye(size)
    penalty[-1, -1] = 1e-6  # where all vehicles are equally tall it is anything: then 0
    follows = np.r_[False, passage[1:] == passage[:-1]]
    rows, values = _whiten(design, follows), _whiten(d, follows)
    coefficients, covariance = _robust_least_squares(rows, values, penalty, passage)
    tilt, passages = coefficients[size : 2 * size], len(np.unique(passage))
    of_centre = coefficients[:size], tilt, mean_height, covariance[:size, :size]
    lane = LaneCentreLine(start, end, knots, *of_centre, passages)
    # the longest part in which the centre is known well enough
    s = np.arange(lane.start, lane.end, 10.0)
    first, last = _longest_run(lane.standard_error(s) <= MAX_ERROR)
    if last <= first:
        raise NotEnoughDataError(f"no lane centre is known anywhere to within {MAX_ERROR:g} m (standard error)")
    return replace(lane, start=float(s[first]), end=float(s[last - 1]))


def _robust_least_squares(
    rows: FloatArray, values: FloatArray, penalty: FloatArray, cluster: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Huber's M-estimate, and its covariance from whole clusters."""
    weight = np.ones(len(values))
    for _ in range(ROUNDS):
        normal = rows.T @ (rows * weight[:, None]) + penalty
        coefficients = np.linalg.solve(normal, rows.T @ (weight * values))
        innovation = values - rows @ coefficients
        spread = MAD_TO_SD * np.median(np.abs(innovation))
        weight = np.minimum(1.0, HUBER_LIMIT * spread / np.maximum(np.abs(innovation), 1e-12))
    names, number = np.unique(cluster, return_inverse=True)
    scores = np.zeros((len(names), rows.shape[1]))
    np.add.at(scores, number, rows * (weight * innovation)[:, None])
    inverse = np.linalg.inv(normal)
    return np.asarray(coefficients), np.asarray(inverse @ (scores.T @ scores) @ inverse)


def _basis(s: FloatArray, knots: FloatArray) -> FloatArray:
    return np.asarray(interpolate.BSpline.design_matrix(s, knots, 3).toarray(), dtype=np.float64)


def _whiten(values: FloatArray, follows: NDArray[np.bool_]) -> FloatArray:
    """Innovations of a first-order autoregression; a passage's first row is scaled to the same variance."""
    innovation = values * np.sqrt(1.0 - CORRELATION**2)
    later = np.flatnonzero(follows)
    innovation[later] = values[later] - CORRELATION * values[later - 1]
    return np.asarray(innovation, dtype=np.float64)


def _covered(s: FloatArray, passage: IntArray) -> tuple[float, float]:
    """Longest range of s in which every window has enough passages."""
    number = np.floor(s / COUNT_WINDOW).astype(np.int64)
    pairs = np.unique(np.column_stack([number, passage]), axis=0)
    if len(pairs) == 0:
        raise NotEnoughDataError("no vehicle keeps to this lane")
    count = np.bincount(pairs[:, 0] - pairs[0, 0])
    first, last = _longest_run(count >= MIN_PASSAGES)
    if last <= first:
        what = f"at most {count.max()} drives share {COUNT_WINDOW:.0f} m of a lane"
        raise NotEnoughDataError(f"{what}; {MIN_PASSAGES} are needed")
    return float((pairs[0, 0] + first + 0.5) * COUNT_WINDOW), float((pairs[0, 0] + last - 0.5) * COUNT_WINDOW)


def _longest_run(good: NDArray[np.bool_]) -> tuple[int, int]:
    """First index and one past the last of the longest slice of True; (0, 0) if there is none."""
    longest = max(true_slices(good), key=lambda part: part.stop - part.start, default=slice(0, 0))
    return longest.start, longest.stop
