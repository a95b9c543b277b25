"""Quantised measurements: the step that values come in, and the spectrum of what rounding adds, in closed form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from xosc_lateral.base.arrays import FloatArray

LEAST_STEP = 0.004
"""Finer steps add less than 2e-6 m2, below any sensor's own noise. [m]"""

COARSEST = 2.0
"""Steps of so many standard deviations of the rows show the driver's variance within 10 %, wider ones do not: where
values come in such, driver and rounding are not separated (docs/design/sensor.md). [-]"""


def quantisation_step(values: FloatArray) -> float:
    """Step of the lattice that all values, shape (n,), lie on, 0 if there is none of at least `LEAST_STEP`. [m]"""
    levels = np.unique(np.round(values, 7))
    if len(levels) < 2 or len(levels) > 0.2 * len(values):
        return 0.0
    step = float(np.diff(levels).min())
    if step < LEAST_STEP:
        return 0.0
    count = np.diff(levels) / step
    return step if bool(np.all(np.abs(count - np.round(count)) < 1e-3)) else 0.0


def uniform_variance(step: float) -> float:
    """Of the error of rounding to a lattice of this step [m], where many steps are crossed. [m2]"""
    return step**2 / 12.0


LAGS = 60.0
"""Beyond it the error of rounding has forgotten: drivers have moved by many steps, or stood still throughout. [s]"""

DENSE = 20.0
"""What drivers do hardly shows between lags of this rate: of faster rows it is interpolated. [Hz]"""

ORDERS = 59
"""Terms of the closed form, whose squares fall: what is left is 0.3 % of the variance. [-]"""


def rounding_density(
    step: float,
    driver: Callable[[FloatArray], FloatArray],
    variance: float,
    *,
    rate: float,
    noise: float = 0.0,
) -> Callable[[FloatArray], FloatArray]:
    """Power density of the error of rounding a Gaussian signal to steps of q, as its rows have it. [m2/Hz]

    The error's autocovariance follows from the signal's structure function D(tau) = E[(x(t + tau) - x(t))^2] [1]_:
    ``q^2 / (2 pi^2) sum_k exp(-2 pi^2 k^2 D(tau) / q^2) / k^2``. Noise that is new in every row adds twice its variance
    to D between different rows: beside enough of it the error is new in every row, too.

    Parameters
    ----------
    step : float
        q. [m]
    driver, variance : callable, float
        Density of what is rounded, at frequencies [m2/Hz], and what it is scaled to: the variance less the noise [m2].
    rate : float
        Rows per second. [Hz]
    noise : float
        Variance of white noise before rounding. [m2]

    References
    ----------
    .. [1] A. B. Sripad, D. L. Snyder, "A necessary and sufficient condition for quantization errors to be uniform and
       white", IEEE Trans. ASSP 25, 1977.
    """
    frequency = np.linspace(0.0025, 1.5, 600)
    spacing = float(frequency[1] - frequency[0])
    power = driver(frequency) * spacing
    power *= variance / power.sum()
    lag = np.arange(1, max(round(LAGS * rate), 1) + 1) / rate
    known = np.arange(round(LAGS * min(rate, DENSE)) + 2) / min(rate, DENSE)
    moved = np.sqrt(2.0 * (1.0 - np.cos(2.0 * np.pi * np.outer(known, frequency))) @ power)
    structure = np.interp(lag, known, moved) ** 2 + 2.0 * noise
    order = np.arange(1, ORDERS + 1)[:, None]
    terms = np.exp(-2.0 * (np.pi * order) ** 2 * structure / step**2) / order**2
    covariance = step**2 / (2.0 * np.pi**2) * terms.sum(axis=0)
    at = np.concatenate([[0.005], np.geomspace(0.01, 3.0, 90)])
    found = 2.0 / rate * (uniform_variance(step) + 2.0 * np.cos(2.0 * np.pi * np.outer(at, lag)) @ covariance)
    log = np.log(np.maximum(found, 1e-9 * found.max()))
    return lambda where: np.exp(np.interp(where, at, log))
