"""Lane centres out of the traffic that uses the lanes: a smooth line per lane, with its standard error.

What every vehicle does at the same place is the lane (and the camera's calibration error); what single vehicles do is
driving. So the centre is the mean over vehicles as a function of s. Rows of one vehicle are no independent
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

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import MAD_TO_SD, FloatArray, IntArray, true_slices
from xosc_lateral.base.errors import NotEnoughDataError

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
        from scipy.interpolate import BSpline

        inside = (s >= self.start) & (s <= self.end)
        both = BSpline(self.knots, np.column_stack([self.coefficients, self.tilt]), 3)(np.clip(s, self.start, self.end))
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
    from scipy.interpolate import BSpline

    return np.asarray(BSpline.design_matrix(s, knots, 3).toarray(), dtype=np.float64)


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
