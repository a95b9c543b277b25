"""A recorded way over time as a speed of straight pieces, with as few corners as an error asks for.

A speed of straight pieces is a way of parabolas with a continuous slope: a quadratic spline whose knots are the
corners. With knots given, it is a linear least-squares problem.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.base.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

SPACING = 0.4  # rows are thinned to this: in that time, a change of acceleration of 1 m/s2 shows as 1 cm [s]
APART = 1.0  # corners are at least this far apart: a driver's foot needs about so long from one pedal to the other [s]
ROUNDS = 12  # of Gauss-Newton; corners move by less than 10 ms after eight


@dataclass(frozen=True, eq=False, slots=True)
class SpeedProfile:
    """Speed of straight pieces."""

    time: FloatArray  # time, speed: both ends and the corners between, shape (k,) [s], [m/s]
    speed: FloatArray
    start: float  # way at the first time [m]

    def way(self, time: FloatArray) -> FloatArray:
        """Way at times within the profile, shape as the argument. [m]"""
        step, change = np.diff(self.time), np.diff(self.speed)
        ways = self.start + np.r_[0.0, np.cumsum(step * (self.speed[:-1] + 0.5 * change))]
        k = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(step) - 1)
        u = time - self.time[k]
        return np.asarray(ways[k] + u * (self.speed[k] + 0.5 * u * change[k] / step[k]))


def fit_speed(time: FloatArray, way: FloatArray, *, error: float, apart: float = APART) -> SpeedProfile:
    """Speed with the fewest corners that a search finds for positions within `error` [m].

    Parameters
    ----------
    time, way : array, shape (n,), n >= 2
        Increasing times [s], distance driven by then [m].
    apart : float
        Between two corners, at least. [s]

    Notes
    -----
    Greedy: corners are added where the error is largest, taken out while the bound still holds, moved to where the
    squared error is least, and taken out once more. Where corners would have to be closer than `apart` the bound is
    given up.
    """
    grid = np.arange(time[0], time[-1], min(SPACING, 0.5 * apart))
    kept = np.unique(np.r_[np.minimum(np.searchsorted(time, grid), len(time) - 1), len(time) - 1])
    t, w = time[kept], way[kept]
    if len(t) < 4:
        speed = max((w[-1] - w[0]) / (t[-1] - t[0]), 0.0)
        return SpeedProfile(t[[0, -1]], np.array([speed, speed]), float(w[0]))
    knots = _moved(t, w, _thinned(t, w, _has_enough_rows(t, w, error, apart), error), apart)
    knots = _moved(t, w, _thinned(t, w, knots, error), apart)
    spline = _spline(t, w, knots)
    corners = np.r_[t[0], knots, t[-1]]
    speed = spline(corners, 1)
    if (speed < 0.0).any():
        return _without_reversing(t, w, corners, max(error, float(np.abs(w - spline(t)).max())), apart)
    return SpeedProfile(corners, speed, float(spline(t[0])))


def _without_reversing(t: FloatArray, w: FloatArray, corners: FloatArray, error: float, apart: float) -> SpeedProfile:
    """The least squared error of speeds that are not negative, with more corners where it is beyond the bound."""
    from scipy.optimize import lsq_linear

    while True:
        ways = [SpeedProfile(corners, one, 0.0).way(t) for one in np.eye(len(corners))]
        lowest = np.r_[-np.inf, np.zeros(len(corners))]
        start, *speed = lsq_linear(np.column_stack([np.ones(len(t)), *ways]), w, (lowest, np.inf)).x
        profile = SpeedProfile(corners, np.asarray(speed), float(start))
        residual, wide = np.abs(w - profile.way(t)), np.diff(corners) >= 2.0 * apart
        piece = np.clip(np.searchsorted(corners, t, side="right") - 1, 0, len(wide) - 1)
        worst = int(np.where(wide[piece], residual, 0.0).argmax())
        if residual[worst] <= error or not wide[piece[worst]]:
            return profile
        k = piece[worst] + 1
        corners = np.insert(corners, k, 0.5 * (corners[k - 1] + corners[k]))


def _spline(t: FloatArray, w: FloatArray, knots: FloatArray) -> BSpline[np.float64]:
    from scipy.interpolate import make_lsq_spline

    return make_lsq_spline(t, w, np.r_[[t[0]] * 3, knots, [t[-1]] * 3], 2)


def _has_enough_rows(t: FloatArray, w: FloatArray, error: float, apart: float) -> FloatArray:
    """Corners added in the middle of the worst piece until the bound holds."""
    knots = np.empty(0)
    while True:
        residual = np.abs(w - _spline(t, w, knots)(t))
        edges = np.r_[t[0], knots, t[-1]]
        piece = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, len(edges) - 2)
        residual[np.diff(edges)[piece] < 2.0 * apart] = 0.0  # can't be parted
        worst = int(residual.argmax())
        if residual[worst] <= error:
            return knots
        k = piece[worst]
        knots = np.insert(knots, k, 0.5 * (edges[k] + edges[k + 1]))


def _thinned(t: FloatArray, w: FloatArray, knots: FloatArray, error: float) -> FloatArray:
    """Without the corners that the bound does not need, the slightest first."""
    bound = max(error, float(np.abs(w - _spline(t, w, knots)(t)).max()))
    while len(knots):
        slope = np.diff(_spline(t, w, knots)(np.r_[t[0], knots, t[-1]], 1)) / np.diff(np.r_[t[0], knots, t[-1]])
        for k in np.argsort(np.abs(np.diff(slope)), kind="stable"):
            fewer = np.delete(knots, k)
            if np.abs(w - _spline(t, w, fewer)(t)).max() <= bound:
                knots = fewer
                break
        else:
            return knots
    return knots


def _moved(t: FloatArray, w: FloatArray, knots: FloatArray, apart: float) -> FloatArray:
    """Corners where the squared error is least (Gauss-Newton with halved steps), in order and apart."""
    if not len(knots):
        return knots
    from scipy.interpolate import BSpline

    spline = _spline(t, w, knots)
    residual = w - spline(t)
    for _ in range(ROUNDS):
        edges = np.r_[t[0], knots, t[-1]]
        bend = np.diff(np.diff(spline(edges, 1)) / np.diff(edges))
        basis = BSpline.design_matrix(t, np.r_[[t[0]] * 3, knots, [t[-1]] * 3], 2).toarray()
        moved = -bend * np.maximum(t[:, None] - knots, 0.0)  # what a later corner changes of the way
        step = np.linalg.lstsq(np.hstack([basis, moved]), residual, rcond=1e-10)[0][basis.shape[1] :]
        for _ in range(6):
            tried = np.clip(knots + step, knots - 2.0, knots + 2.0)
            if (np.diff(np.r_[t[0], tried, t[-1]]) >= 0.5 * apart).all():
                again = _spline(t, w, tried)
                left = w - again(t)
                if left @ left < residual @ residual:
                    break
            step = 0.5 * step
        else:
            return knots
        done = residual @ residual - left @ left < 1e-6 * (residual @ residual)
        knots, spline, residual = tried, again, left
        if done:
            break
    return knots
