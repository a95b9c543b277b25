"""What a sensor's error looks like in runs: its density as measured, and how its level varies.

The parametric split (`separation`) says how much of each frequency is the sensor's. The measured density, times that
share, is what the error has in runs: with bumps of a provider's smoothing, and with what resampling leaves above
1.5 Hz. And a camera is not equally noisy everywhere: the log of the density varies, smoothly, as a critically damped
autoregression of second order (one of first order has corners, which show up to half the sampling rate).

Derived here: a critically damped level has the double root k = exp(-step / time constant); its coefficients are then
2 k and -k^2, and its variance (1 + k^2) / (1 - k^2)^3 times that of its kicks.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.recursion import recur
from xosc_lateral.drives.filters import kaiser_design, low_pass

FloatArray = NDArray[np.float64]

LOWEST, BANDS = 0.1, 36
"""Lowest edge of the table's bands [Hz], and their number up to half the sampling rate: eight an octave."""

FAST = 0.9
"""Above it the level is looked at: there a sensor that shows at all outweighs the driver (docs/real_data.md). [Hz]"""

LEAST_SHARE = 0.5
"""Of the power above `FAST` that is the sensor's; below, a level that varies may be the driver's. [-]"""

TRANSITION, ATTENUATION = 0.3, 40.0
"""Of the high-pass: from 0.75 to 1.05 Hz; of 30 cm of slow movement 3 mm would be left, and it is steep. [Hz], [dB]"""

PIECE = 2.4
"""Pieces whose log power is compared: several periods, and shorter than a vehicle takes through a noisy zone. [s]"""

LAG_PIECES = 4
"""Pieces between those whose covariance gives how long a level lasts: the high-pass is shorter than that. [-]"""

LONGEST = 60.0
"""Levels that last longer are taken to last so long: runs are hardly longer. [s]"""

TIMES_TO_1_E = 2.146
"""Time constants after which a critically damped level's correlation, (1 + u) exp(-u), has fallen to 1/e. [-]"""

WARM_UP = 5.0
"""Levels' lasting times before the first row: the level is then one as any. [-]"""

FAINTEST = 1e-16
"""Added to mean squares, so that none at all has a logarithm. [m2]"""

MANY = 50_000
"""Rows of stationary noise that the measured spread is held against: an error of 2 %. [-]"""


def measured_density(
    frequency: FloatArray, windows: FloatArray, share: FloatArray
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Density of the error in runs, in bands.

    Parameters
    ----------
    frequency : array, shape (m,)
        [Hz]
    windows : array, shape (k, m)
        Periodograms of the runs. [m2/Hz]
    share : array, shape (m,)
        Of the sensor at each frequency. [-]

    Returns
    -------
    tuple of float, tuple of float
        Middle of each band [Hz] and density there [m2/Hz].
    """
    density = windows.mean(axis=0) * share
    edges = np.geomspace(LOWEST, frequency[-1] * (1.0 + 1e-9), BANDS + 1)
    rows = [np.flatnonzero((frequency >= low) & (frequency < high)) for low, high in pairwise(edges.tolist())]
    rows = [inside for inside in rows if len(inside)]
    middles = tuple(float(frequency[inside].mean()) for inside in rows)
    return middles, tuple(float(density[inside].mean()) for inside in rows)


def level_variation(runs: Sequence[FloatArray], noise: FloatArray, step: float) -> tuple[float, float]:
    """How the level of fast movement varies, beyond what chance does to stationary noise.

    Parameters
    ----------
    runs : sequence of array
        Measured offsets. [m]
    noise : array, shape (n,)
        Stationary noise with the same density above `FAST`. [m]
    step : float
        [s]

    Returns
    -------
    float, float
        Variance of the log of the density [-] and how long a level lasts [s]; 0 where it doesn't vary.
    """
    rows = round(PIECE / step)
    return _variation([_log_power(run, rows, step) for run in runs], _log_power(noise, rows, step))


def _variation(levels: Sequence[FloatArray], steady: FloatArray) -> tuple[float, float]:
    """Of log powers of pieces, beyond those of steady noise."""
    levels = [one for one in levels if len(one) > LAG_PIECES]
    if not levels:
        return 0.0, LONGEST
    mean = float(np.concatenate(levels).mean())
    variance = float(np.concatenate(levels).var() - steady.var())
    if variance <= 0.0:
        return 0.0, LONGEST
    products = np.concatenate([(one[LAG_PIECES:] - mean) * (one[:-LAG_PIECES] - mean) for one in levels])
    kept = np.clip(products.mean() / variance, 1e-3, np.exp(-LAG_PIECES * PIECE / LONGEST))
    return variance, float(-LAG_PIECES * PIECE / np.log(kept))


def amplitude_factor(variance: float, duration: float, n: int, step: float, rng: np.random.Generator) -> FloatArray:
    """Factor on the error's amplitude, shape (n,), whose square has the mean 1. [-]"""
    keep = float(np.exp(-step / (duration / TIMES_TO_1_E)))
    before = round(WARM_UP * duration / step)
    kicks = np.sqrt(variance * (1.0 - keep**2) ** 3 / (1.0 + keep**2)) * rng.normal(size=before + n)
    level = recur(np.zeros(2), kicks, np.array([2.0 * keep, -(keep**2)]))[2 + before :]
    return np.asarray(np.exp(0.5 * (level - 0.5 * variance)))


def _log_power(path: FloatArray, rows: int, step: float) -> FloatArray:
    return _of_pieces(_fast(path, step), rows)


def _of_pieces(fast: FloatArray, rows: int) -> FloatArray:
    count = len(fast) // rows
    return np.asarray(np.log((fast[: count * rows].reshape(count, rows) ** 2).mean(axis=1) + FAINTEST))


def _fast(path: FloatArray, step: float) -> FloatArray:
    """Movement above `FAST` but for the ends, where the filter needs more; empty where less than a piece is left."""
    nyquist = 0.5 / step
    half, beta = kaiser_design(ATTENUATION, TRANSITION / nyquist)
    kernel = -low_pass(half, FAST / nyquist, beta)
    kernel[half] += 1.0
    if len(path) < len(kernel) + round(PIECE / step):
        return np.empty(0)
    return np.convolve(path, kernel, mode="valid")
