"""Lane centres out of the traffic that uses the lanes: a smooth line per lane, with its standard error.

What every vehicle does at the same place is the lane (and the camera's calibration error); what single vehicles do is
driving. So the centre is the mean over vehicles as a function of s. Rows of one vehicle are no independent
measurements, so the fit is weighted as if its residual were a first-order autoregression (generalised least squares),
and the standard error is computed from whole stretches (sandwich estimator), which holds whatever the correlation is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.errors import NotEnoughDataError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

KNOT_SPACING = 40.0  # [m]; chosen by leave-vehicles-out error on DLR HT (docs/real_data.md)
MEMORY = 0.9  # correlation of a driver's offset after 1 s, as assumed by the weights; 1 would let the level drift
ROUNDS = 4  # of reweighting; the line moves by under 1 mm after three
HUBER = 2.0  # residuals beyond this many standard deviations count less: undetected lane changes
MIN_VEHICLES = 10  # per knot interval, below which the lane ends


@dataclass(frozen=True, eq=False)
class LaneCentre:
    """Lateral position of a lane's centre along a reference line, as used by its traffic.

    Parameters
    ----------
    start, end : float
        Range of `s` with enough vehicles. [m]
    knots : array, shape (n + 4,)
        Of the cubic spline. [m]
    coefficients : array, shape (n,)
        [m]
    covariance : array, shape (n, n)
        Of the coefficients. [m²]
    vehicles : int
        How many the estimate rests on.
    """

    start: float
    end: float
    knots: FloatArray
    coefficients: FloatArray
    covariance: FloatArray
    stretches: int

    def at(self, s: FloatArray) -> FloatArray:
        """Lateral position of the centre [m]; NaN outside of start..end."""
        from scipy.interpolate import BSpline

        inside = (s >= self.start) & (s <= self.end)
        values: FloatArray = BSpline(self.knots, self.coefficients, 3)(np.clip(s, self.start, self.end))
        return np.where(inside, values, np.nan)

    def standard_error(self, s: FloatArray) -> FloatArray:
        """Standard error of `at` from the finite number of vehicles [m]."""
        basis = _basis(np.clip(s, self.start, self.end), self.knots)
        return np.sqrt(np.einsum("ij,jk,ik->i", basis, self.covariance, basis))


def fit_lane_centre(
    s: FloatArray, d: FloatArray, stretch: IntArray, *, knot_spacing: float = KNOT_SPACING
) -> LaneCentre:
    """Fit one lane's centre.

    Parameters
    ----------
    s, d : array, shape (n,)
        Positions of vehicles that keep to this lane, one row a second, sorted by stretch and time. [m]
    stretch : array of int, shape (n,)
        Which uninterrupted stretch of which vehicle a row belongs to.
    knot_spacing : float
        Between the spline's knots. Longer: blind to the bends that camera calibration puts into the tracks; shorter:
        follows single drivers. [m]

    Raises
    ------
    NotEnoughDataError
        If fewer than `MIN_VEHICLES` vehicles share any 200 m.
    """
    start, end = _covered(s, stretch)
    keep = (s >= start) & (s <= end)
    s, d, stretch = s[keep], d[keep], stretch[keep]
    inner = np.linspace(start, end, max(2, round((end - start) / knot_spacing) + 1))
    knots = np.r_[[start] * 3, inner, [end] * 3]
    basis = _basis(s, knots)
    follows = np.r_[False, stretch[1:] == stretch[:-1]]
    rows, values = _whiten(basis, follows), _whiten(d, follows)
    # A weak pull to smoothness carries the line over places where nobody was measured.
    bend = 0.1 * np.diff(np.eye(basis.shape[1]), n=2, axis=0)
    weight = np.ones(len(s))
    for _ in range(ROUNDS):
        normal = rows.T @ (rows * weight[:, None]) + bend.T @ bend
        coefficients = np.linalg.solve(normal, rows.T @ (weight * values))
        innovation = values - rows @ coefficients
        spread = 1.4826 * np.median(np.abs(innovation))
        weight = np.minimum(1.0, HUBER * spread / np.maximum(np.abs(innovation), 1e-12))
    scores = np.zeros((len(np.unique(stretch)), basis.shape[1]))
    np.add.at(scores, np.unique(stretch, return_inverse=True)[1], rows * (weight * innovation)[:, None])
    inverse = np.linalg.inv(normal)
    return LaneCentre(start, end, knots, coefficients, inverse @ (scores.T @ scores) @ inverse, len(scores))


def _basis(s: FloatArray, knots: FloatArray) -> FloatArray:
    from scipy.interpolate import BSpline

    return np.asarray(BSpline.design_matrix(s, knots, 3).toarray())


def _whiten(values: FloatArray, follows: NDArray[np.bool_]) -> FloatArray:
    """Innovations of a first-order autoregression; a stretch's first row is scaled to the same variance."""
    shape = (-1,) + (1,) * (values.ndim - 1)
    innovation = values * np.sqrt(1.0 - MEMORY**2)
    innovation[1:] = np.where(follows[1:].reshape(shape), values[1:] - MEMORY * values[:-1], innovation[1:])
    return innovation


def _covered(s: FloatArray, stretch: IntArray, window: float = 100.0) -> tuple[float, float]:
    """Longest range of s in which every window has enough stretches."""
    number = np.floor(s / window).astype(np.int64)
    pairs = np.unique(np.column_stack([number, stretch]), axis=0)
    if len(pairs) == 0:
        raise NotEnoughDataError("no vehicle keeps to this lane")
    count = np.bincount(pairs[:, 0] - pairs[0, 0])
    enough = np.r_[False, count >= MIN_VEHICLES, False]
    edges = np.flatnonzero(np.diff(enough.astype(np.int8)))
    begins, ends = edges[::2], edges[1::2]
    if len(begins) == 0:
        raise NotEnoughDataError(
            f"at most {count.max()} vehicles share {window:.0f} m of a lane; {MIN_VEHICLES} are needed"
        )
    longest = int(np.argmax(ends - begins))
    return float((pairs[0, 0] + begins[longest] + 0.5) * window), float((pairs[0, 0] + ends[longest] - 0.5) * window)
