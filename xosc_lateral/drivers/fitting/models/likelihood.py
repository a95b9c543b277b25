"""Memory of drivers who each move about a mean of their own, by restricted maximum likelihood.

A driver's mean is never subtracted as if it were known: it is a random effect, integrated out, and so is the common
mean of all [1]_. The likelihood is exact from a run's first value on [2]_, or short runs would forget too fast: they
lose a third and more of their moments where these only condition what follows.

References
----------
.. [1] H. D. Patterson, R. Thompson, "Recovery of inter-block information when block sizes are unequal", Biometrika 58,
   1971.
.. [2] M. M. Siddiqui, "On the inversion of the sample covariance matrix in a stationary autoregressive process",
   Annals of Mathematical Statistics 29, 1958: the inverse covariance of the first values in closed form.
.. [3] O. Barndorff-Nielsen, G. Schou, "On the parametrization of autoregressive models by partial autocorrelations",
   J. Multivariate Analysis 3, 1973: any of them within -1 and 1 are stable. Here they are those of a model whose roots
   are divided by `MAX_ROOT`, the longest memory that a model may have.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.core.autoregressive.parameters import MAX_ROOT, Autoregression, stabilise

WILD_SQUARE_RATIO = 9.0
"""Mean square residual over the median driver's beyond which a driver is wild: three times as far. Drivers on a
motorway differ by less (standard deviation of the logarithm 0.3, so that 1 in 10 000 is). [-]"""

RIDGE = 1e-7
"""Share of the mean square that counts as noise of its own: nothing is foreseen to the last digit. [-]"""

PASSES = 2
"""The first finds the drivers' sizes, the second is weighted by them. [-]"""

IMPOSSIBLE_COST = 1e6
"""Of parameters whose likelihood can't be told: beyond any other, so that the search turns back. [-]"""

MAXIMUM_TURNS = 1000
"""Of the search for the largest likelihood: a pure sine takes 400, where most drives take 20. [-]"""

OUT_OF_TURNS = 1
"""Scipy's status of a search that was stopped; one that no step takes further, or that came to an edge, has ended."""

NUDGE = 1e-4
"""Of a parameter, to measure slopes by: what is left of the third derivative and of rounding is 1e-8. [-]"""

FLATNESS = 1e-6
"""Slope of the log likelihood per moment at which the search ends: flatter, rounding hides which way is up. [-]"""

LAST_STEPS = 3
"""Of Newton's method on the slopes, which rounding hides far later: another processor finds the same digits. [-]"""

FARTHEST = 18.0
"""Of the logarithms that are searched: of a partial autocorrelation 3e-16 from one, and of the variance between drivers
in units of the residual's. [-]"""


def fit_autoregression(
    runs: Sequence[FloatArray], order: int, *, every: int, drivers: Sequence[str]
) -> tuple[Autoregression, float]:
    """Autoregression about the drivers' means, and the variance between these, 0 of one driver [square of the unit].

    All moments count alike but those of wild drivers, who are measured by their own size: what a calm driver's short
    run shows of his memory is biased by what made it calm, and weights by how calm a moment is would drop the return of
    whoever drifts calmly and corrects briskly. The scale is the geometric mean of the drivers' residuals.

    `runs`, shape (n_i,) [any unit]; `drivers`: whose each is; `every`: one step of the model in samples of the runs.
    Warns where the likelihood still rises when turns run out.
    """
    sums = DriverSums.of(runs, order, every=every, drivers=drivers)
    sizes, parameters = np.ones(len(sums.count)), sums.start()
    for _ in range(PASSES):
        parameters, ended = _maximise_likelihood(sums, parameters, sizes)
        coefficients, ratio = sums.unpack(parameters)
        residual = sums.residuals(coefficients)
        usual, weights = float(np.median(residual)), sums.weighted(sizes)
        sizes = np.where(residual > WILD_SQUARE_RATIO * usual, residual / usual, 1.0)
    if not ended:
        warnings.warn(f"slow movement is not sure: its fit had not ended after {MAXIMUM_TURNS} turns", stacklevel=2)
    scale = float(np.exp(0.5 * np.average(np.log(residual), weights=sums.count)))
    return Autoregression(coefficients, scale), float(ratio * sums.terms(parameters, weights)[0])


@dataclass(frozen=True, eq=False, slots=True)
class DriverSums:
    """Of n drivers' moments all that the likelihood asks for, in steps of the model: `every` samples count as one."""

    order: int
    products: FloatArray  # Of a moment and its past, latest first, summed, shape (n, order + 1, order + 1).
    totals: FloatArray  # Of a moment and its past, shape (n, order + 1).
    count: FloatArray  # Moments that have a past, shape (n,).
    first_products: FloatArray  # Of the runs' first moments, which have none, shape (n, order, order).
    first_totals: FloatArray  # Shape (n, order).
    runs: FloatArray  # Shape (n,).

    @classmethod
    def of(cls, runs: Sequence[FloatArray], order: int, *, every: int, drivers: Sequence[str]) -> DriverSums:
        """Of the runs that are longer than the memory."""
        long = [(run, driver) for run, driver in zip(runs, drivers, strict=True) if len(run) > every * (order + 1)]
        number = {driver: k for k, driver in enumerate(dict.fromkeys(driver for _, driver in long))}
        n = len(number)
        products, totals, count = np.zeros((n, order + 1, order + 1)), np.zeros((n, order + 1)), np.zeros(n)
        firsts, first_totals, starts = np.zeros((n, order, order)), np.zeros((n, order)), np.zeros(n)
        for run, driver in long:
            k, rows = number[driver], len(run) - every * order
            moments = np.stack([run[every * (order - lag) :][:rows] for lag in range(order + 1)], axis=1)
            first = moments[:every, 1:]
            products[k] += moments.T @ moments / every
            totals[k] += moments.sum(axis=0) / every
            count[k] += rows / every
            firsts[k] += first.T @ first / every
            first_totals[k] += first.sum(axis=0) / every
            starts[k] += 1.0
        return cls(order, products, totals, count, firsts, first_totals, starts)

    def start(self) -> FloatArray:
        """Parameters of least squares about each driver's own mean: partial autocorrelations and ratio, transformed."""
        mean = self.totals / self.count[:, None]
        within = (self.products - self.count[:, None, None] * mean[:, :, None] * mean[:, None, :]).sum(axis=0)
        within += RIDGE * within[0, 0] * np.eye(len(within))
        coefficients = stabilise(np.linalg.solve(within[1:, 1:], within[1:, 0]))
        residual = (within[0, 0] - coefficients @ within[1:, 0]) / self.count.sum()
        start = np.arctanh(partial_autocorrelations(coefficients))
        return np.append(start, np.log(mean[:, 0].var() / residual + np.exp(-FARTHEST))) if len(mean) > 1 else start

    def unpack(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coefficients, shape (..., order), and the variance between drivers in units of the residual's, (...)."""
        partial = np.tanh(parameters[..., : self.order])
        coefficients = np.zeros_like(partial)
        for k in range(self.order):
            coefficients[..., :k] -= partial[..., k, None] * coefficients[..., :k][..., ::-1]
            coefficients[..., k] = partial[..., k]
        coefficients *= MAX_ROOT ** np.arange(1.0, self.order + 1)
        return coefficients, np.exp(parameters[..., self.order :]).sum(axis=-1)

    def weighted(self, sizes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Sums of products over drivers of so large squared residuals in units of the usual, shape (n,), and these."""
        products, first = (np.tensordot(1.0 / sizes, one, 1) for one in (self.products, self.first_products))
        return products + RIDGE * products[0, 0] * np.eye(self.order + 1), first, sizes

    def about_means(self, coefficients: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Of models, shape (..., order): each driver's precision about his mean, that times its estimate, both of shape
        (..., n) in units of one over the residual's variance, and the inverse covariance of the first moments."""
        inverse = first_precision(coefficients)
        weights, gone = inverse.sum(axis=-2), 1.0 - coefficients.sum(axis=-1, keepdims=True)
        shocks = self.totals[:, 0] - coefficients @ self.totals[:, 1:].T
        # at least what its terms are rounded to: where a model hardly forgets, they cancel
        rounded = np.finfo(np.float64).eps * self.runs * np.abs(weights).sum(axis=-1, keepdims=True)
        precision = np.maximum(self.runs * weights.sum(axis=-1, keepdims=True) + self.count * gone**2, rounded)
        return precision, weights @ self.first_totals.T + gone * shocks, inverse

    def cost(self, parameters: FloatArray, weighted: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
        """Minus twice the restricted log likelihood per moment and a constant, the residual's variance at its best.

        Of parameters of shape (..., order or order + 1), shape (...).
        """
        with np.errstate(all="ignore"):  # at the edge of what is stationary, sums of rounded numbers may be negative
            variance, logs, moments = self.terms(parameters, weighted)
            cost = np.log(moments * variance / weighted[0][0, 0]) + logs / moments
        return np.where(np.isfinite(cost), cost, IMPOSSIBLE_COST)

    def terms(
        self, parameters: FloatArray, weighted: tuple[FloatArray, FloatArray, FloatArray]
    ) -> tuple[FloatArray, FloatArray, float]:
        """Variance of the usual driver's residual [square of the unit], log determinants, and how many moments."""
        coefficients, ratio = self.unpack(parameters)
        products, first_products, sizes = weighted
        precision, pulled, inverse = self.about_means(coefficients)
        precision, pulled = precision / sizes, pulled / sizes
        shock = np.concatenate([np.ones_like(coefficients[..., :1]), -coefficients], axis=-1)
        inflated = 1.0 + ratio[..., None] * precision
        weight, common = (precision / inflated).sum(axis=-1), (pulled / inflated).sum(axis=-1)
        squares = (shock @ products * shock).sum(axis=-1) + (inverse * first_products).sum(axis=(-2, -1))
        squares = squares - ratio * (pulled**2 / inflated).sum(axis=-1) - common**2 / weight
        moments = float((self.count + self.order * self.runs).sum()) - 1.0
        first = np.log1p(-(partial_autocorrelations(coefficients) ** 2)) @ np.arange(1.0, self.order + 1)
        logs = np.log(inflated).sum(axis=-1) + np.log(weight) - float(self.runs.sum()) * first
        return squares / moments, logs, moments

    def residuals(self, coefficients: FloatArray) -> FloatArray:
        """Each driver's mean squared residual about his own mean, shape (n,). [square of the unit]"""
        precision, pulled, _ = self.about_means(coefficients)
        shock, gone = np.append(1.0, -coefficients), (1.0 - float(coefficients.sum())) * pulled / precision
        squares = np.einsum("i,kij,j->k", shock, self.products, shock) - 2.0 * gone * (self.totals @ shock)
        return np.asarray(np.maximum(squares / self.count + gone**2, 1e-300))


def _maximise_likelihood(sums: DriverSums, start: FloatArray, sizes: FloatArray) -> tuple[FloatArray, bool]:
    """Parameters of the largest likelihood near those, and whether it was found."""
    from scipy.optimize import minimize

    weighted, steps = sums.weighted(sizes), NUDGE * np.eye(len(start))

    def cost(parameters: FloatArray) -> float:
        return float(sums.cost(parameters, weighted))

    def slope(parameters: FloatArray) -> FloatArray:
        there = parameters[..., None, :]
        ahead, behind = np.split(
            sums.cost(np.concatenate([there + steps, there - steps], axis=-2), weighted), 2, axis=-1
        )
        return np.asarray((ahead - behind) / (2.0 * NUDGE))

    optimum = minimize(
        cost,
        start,
        method="L-BFGS-B",
        jac=slope,
        bounds=[(-FARTHEST, FARTHEST)] * len(start),
        options={"maxiter": MAXIMUM_TURNS, "gtol": FLATNESS, "ftol": 0.0},
    )
    best = np.asarray(optimum.x)
    bends = (slope(best + 10.0 * steps) - slope(best - 10.0 * steps)) / (20.0 * NUDGE)
    inverse = np.linalg.pinv(bends + bends.T, rcond=FLATNESS, hermitian=True)
    for _ in range(LAST_STEPS if optimum.success else 0):
        nearer = best - 2.0 * inverse @ slope(best)
        if np.abs(nearer).max() > FARTHEST:  # the search ended at an edge: beyond it there is nothing to be exact about
            break
        best = nearer
    return best, optimum.status != OUT_OF_TURNS


def partial_autocorrelations(coefficients: FloatArray) -> FloatArray:
    """Of stable autoregressions, shape (..., order). [-]"""
    reflections = np.empty_like(coefficients)
    for k in reversed(range(coefficients.shape[-1])):
        last = coefficients[..., k, None]
        reflections[..., k] = coefficients[..., k]
        coefficients = (coefficients[..., :k] + last * coefficients[..., :k][..., ::-1]) / (1.0 - last**2)
    return reflections


def first_precision(coefficients: FloatArray) -> FloatArray:
    """Inverse covariance of as many values of an autoregression as it has coefficients, times its residual's variance.

    Of coefficients of shape (..., order), shape (..., order, order) [2]_. [-]
    """
    order = coefficients.shape[-1]
    lags = np.arange(order)[:, None] - np.arange(order)
    shock = np.concatenate([np.ones_like(coefficients[..., :1]), -coefficients], axis=-1)
    ahead, behind = (np.where(lags < 0, 0.0, values[..., lags]) for values in (shock, shock[..., :0:-1]))
    return np.asarray(ahead @ ahead.swapaxes(-2, -1) - behind @ behind.swapaxes(-2, -1))
