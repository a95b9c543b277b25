"""A Gaussian process whose values are rounded to a lattice: its moments and its autocovariance in closed form.

Rounding is a staircase, g times the number of thresholds below a value, so by Price's theorem [1]_ the covariance of
two rounded values grows with their correlation r as ``dC/dr = g^2 sum_ij phi2(z_i, z_j; r)``: the bivariate normal
density at all pairs of thresholds, in standard deviations from the mean. With r = sin(a) it stays finite up to r = 1.
The same relation, read backwards, gives the correlation from rounded values ("polychoric", [2]_).

References
----------
.. [1] R. Price, "A useful theorem for nonlinear devices having Gaussian inputs", IRE Trans. Information Theory 4, 1958.
.. [2] K. Pearson, "On the correlation of characters not quantitatively measurable", Phil. Trans. A 195, 1900.
.. [3] H. Cramér, "Mathematical Methods of Statistics", Princeton 1946, section 17.7: Edgeworth's series.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

REACH = 6.0
"""Thresholds farther from the mean are never crossed: 1e-9 of the time. [standard deviations]"""

ANGLES = 721
"""Points of the integral over a quarter turn: an eighth of a degree. [-]"""

COARSER = 6
"""Negative correlations need so many times fewer: nothing is steep there. [-]"""


@dataclass(frozen=True)
class RoundedGaussian:
    """What is known of a normal variable, and of its values rounded to the nearest of a lattice.

    Parameters
    ----------
    mean : float
        Counted from a point of the lattice. [m]
    deviation : float
        Standard deviation before rounding. [m]
    step : float
        Of the lattice. [m]
    """

    mean: float
    deviation: float
    step: float

    @cached_property
    def _levels(self) -> FloatArray:
        """Numbers of the thresholds within reach, shape (k,); threshold j lies at (j + 1/2) steps."""
        reach = REACH * self.deviation
        first, last = (self.mean - reach) / self.step - 0.5, (self.mean + reach) / self.step - 0.5
        return np.arange(np.floor(first), np.ceil(last) + 1.0)

    @cached_property
    def _thresholds(self) -> FloatArray:
        """In standard deviations from the mean, shape (k,)."""
        return (self.step * (self._levels + 0.5) - self.mean) / self.deviation

    @cached_property
    def _above(self) -> FloatArray:
        """Probability to lie above each, shape (k,). [-]"""
        from scipy.special import ndtr

        return np.asarray(ndtr(-self._thresholds))

    @cached_property
    def moments(self) -> tuple[float, float]:
        """Mean [m] and variance [m2] of the rounded values."""
        mean, square = self._counted(self._above)
        return self.step * (float(self._levels[0]) + mean), self.step**2 * (square - mean**2)

    @cached_property
    def variance_per_kurtosis(self) -> float:
        """By how much the logarithm of the variance that follows from the rounded values' changes, if the variable
        has excess kurtosis, per unit of it (first term of Edgeworth's series [3]_). [-]
        """
        z = self._thresholds
        mean, _ = self._counted(self._above)
        more = (z**3 - 3.0 * z) * np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi) / 24.0
        shift, square = self._counted(more)
        wider = RoundedGaussian(self.mean, self.deviation * (1.0 + 0.5e-3), self.step).moments[1]
        return -1e-3 * self.step**2 * (square - 2.0 * mean * shift) / (wider - self.moments[1])

    @staticmethod
    def _counted(above: FloatArray) -> tuple[float, float]:
        """Mean and mean square of how many thresholds lie below, from the probability of each. [-]"""
        return float(above.sum()), float(((2.0 * np.arange(len(above)) + 1.0) * above).sum())

    @cached_property
    def covariance_with_cause(self) -> float:
        """Of a rounded value and of the standardised value that was rounded. [m]"""
        return float(self.step * np.exp(-0.5 * self._thresholds**2).sum() / np.sqrt(2.0 * np.pi))

    @cached_property
    def error(self) -> float:
        """Mean square of rounded less true values. [m2]"""
        mean, variance = self.moments
        both = self.deviation * self.covariance_with_cause
        return variance + self.deviation**2 - 2.0 * both + (mean - self.mean) ** 2

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Angles whose sine is the correlation, from -90 to 90 degrees, and covariance [m2] there."""
        angle = np.linspace(0.0, 0.5 * np.pi, ANGLES)
        coarse = angle[::COARSER]
        up, down = self._integral(angle, 1.0), self._integral(coarse, -1.0)
        return np.concatenate([-coarse[:0:-1], angle]), np.concatenate([-down[:0:-1], up])

    def _integral(self, angle: FloatArray, sign: float) -> FloatArray:
        z = self._thresholds
        cosine = np.maximum(np.cos(angle), 1e-9)
        density = np.zeros(len(angle))
        for one in z:
            squares = one**2 + z[:, None] ** 2 - 2.0 * sign * np.sin(angle) * one * z[:, None]
            density += np.exp(-0.5 * np.maximum(squares, 0.0) / cosine**2).sum(axis=0)
        met = np.abs(z[:, None] - sign * z[None, :]).min(axis=1) < 1e-9  # of a quarter turn only these are left
        density[-1] = np.exp(-0.5 * z[met] ** 2).sum()
        grown = np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(angle))
        return np.concatenate([[0.0], grown]) * self.step**2 / (2.0 * np.pi)

    def covariance(self, correlation: FloatArray) -> FloatArray:
        """Of two rounded values from the correlation of the true ones [-], same shape. [m2]"""
        angle, known = self._table
        return np.asarray(np.interp(np.arcsin(np.clip(correlation, -1.0, 1.0)), angle, known))

    def correlation(self, covariance: float) -> float:
        """Of the true values from the covariance of the rounded ones [m2]. [-]"""
        angle, known = self._table
        return float(np.sin(np.interp(covariance, known, angle)))


def gaussian_behind(values: FloatArray, step: float) -> RoundedGaussian:
    """The normal variable whose rounded values have the mean and the variance of these.

    Parameters
    ----------
    values : array, shape (n,)
        On a lattice that holds 0, three levels of it at least. [m]
    step : float
        [m]
    """
    from scipy.optimize import least_squares

    mean, variance = float(values.mean()), float(values.var())

    def lacking(point: FloatArray) -> FloatArray:
        found = RoundedGaussian(float(point[0]) * step, float(np.exp(point[1])) * step, step).moments
        return np.array([(found[0] - mean) / np.sqrt(variance), np.log((found[1] + 1e-300) / variance)])

    begin = np.log(np.sqrt(max(variance / step**2 - 1.0 / 12.0, 0.04)))
    found = least_squares(lacking, [mean / step, begin], bounds=([-np.inf, -6.0], [np.inf, np.inf]), x_scale=[0.1, 0.1])
    return RoundedGaussian(float(found.x[0]) * step, float(np.exp(found.x[1])) * step, step)
