"""Coarse movement of a population: one autoregression, and drivers' own means about which it moves.

The autoregression is fitted to the low-passed offset, all moments of a driver counting the same, and then gets back
what the low-pass took near the border. Drivers' means are a random effect: their variance is the covariance of moments
far apart in a run, less what of it the autoregression itself still remembers. Each needs the other, so both are
fitted in turn.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.autoregressive.autoregression import FREQUENCIES, GRID, Autoregression, stabilise
from xosc_lateral.driver.models.autoregressive.filters import COARSE_EVERY, measuring_low_pass
from xosc_lateral.driver.models.autoregressive.fit_autoregression import RIDGE, fit_autoregression
from xosc_lateral.driver.models.autoregressive.fit_settings import FitSettings

FloatArray = NDArray[np.float64]

TURNS = 20
"""Of fitting both in turn at most: each leaves less than a third of the last one's error on runs of a minute. [-]"""

SETTLED = 1e-3
"""Change of the drivers' share of the variance at which they end. [-]"""

HALF_GAIN = 0.5
"""Of the measuring low-pass at its border. Beyond, most is not coarse, and the building low-pass takes it away. [-]"""


def fit_coarse(
    slow: Sequence[FloatArray], drives: Sequence[str], settings: FitSettings
) -> tuple[Autoregression, float]:
    """Autoregression at one step a second, and the variance between drivers.

    Parameters
    ----------
    slow : sequence of array, shape (n_i,)
        Low-passed runs at 5 Hz, the mean of all taken out. [lane widths]
    drives : sequence of str
        Whose each is.
    settings : FitSettings

    Returns
    -------
    Autoregression, float
        [lane widths], [lane widths squared]
    """
    longest = max(map(len, slow)) * settings.step
    order = max(2, min(settings.order, int(0.4 * longest)))
    several = len(set(drives)) > 1
    variance = float(np.mean(np.concatenate(slow) ** 2))
    covariance, lags, pairs = _far_covariance(slow, len(set(drives)), settings) if several else (0.0, [1], [1])
    between = float(np.clip(covariance, 0.0, 0.9 * variance))
    for _ in range(TURNS):
        coarse = fit_autoregression(slow, order, every=COARSE_EVERY, drivers=drives, between=between)
        if not several:
            break
        remembered = coarse.covariance(max(lags) + 1)
        share = float(np.average(remembered[lags] / remembered[0], weights=pairs))
        before, between = between, (covariance - share * variance) / (1.0 - share)
        between = float(np.clip(between, 0.0, 0.9 * variance))
        if abs(between - before) < SETTLED * variance:
            break
    return _restored(coarse, settings.step), between


def _far_covariance(
    slow: Sequence[FloatArray], drivers: int, settings: FitSettings
) -> tuple[float, list[int], list[int]]:
    """Covariance of moments far apart in one run; at which lags in coarse steps, and from how many pairs each."""
    lengths = np.array([len(run) for run in slow])
    order = np.argsort(lengths)
    typical = lengths[order][np.searchsorted(np.cumsum(lengths[order]), 0.5 * lengths.sum())]
    reach = min(float(typical), settings.farthest / settings.step) / COARSE_EVERY
    lags = list(range(max(1, int(settings.far[0] * reach)), max(2, int(settings.far[1] * reach))))
    total, pairs = np.zeros(len(lags)), np.zeros(len(lags), dtype=np.int64)
    for run in slow:
        for k, lag in enumerate(lags):
            if len(run) > lag * COARSE_EVERY:
                total[k] += run[lag * COARSE_EVERY :] @ run[: len(run) - lag * COARSE_EVERY]
                pairs[k] += len(run) - lag * COARSE_EVERY
    # The common mean was taken out, and with it a part of the differences between a few drivers.
    return float(total.sum() / max(pairs.sum(), 1) * drivers / (drivers - 1)), lags, pairs.tolist()


def _restored(coarse: Autoregression, step: float) -> Autoregression:
    """With what the measuring low-pass took below the border; `step` of the runs. [s]"""
    kernel = measuring_low_pass(step)
    gain = np.abs(np.exp(-2j * np.pi * np.outer(FREQUENCIES / COARSE_EVERY, np.arange(len(kernel)))) @ kernel)
    return scaled_spectrum(coarse, 1.0 / np.maximum(gain, HALF_GAIN))


def scaled_spectrum(coarse: Autoregression, gain: FloatArray) -> Autoregression:
    """One of the same order with the spectrum's amplitude times a gain, by the covariance of that spectrum.

    `gain` at `FREQUENCIES`. [-]
    """
    from scipy.linalg import solve_toeplitz

    power = coarse.power(FREQUENCIES) * gain**2
    covariance = np.fft.irfft(power, GRID)[: coarse.order + 1]
    row = covariance[:-1].copy()
    row[0] *= 1.0 + RIDGE
    coefficients = solve_toeplitz(row, covariance[1:])
    scale = float(np.sqrt(covariance[0] - coefficients @ covariance[1:]))
    return Autoregression(stabilise(coefficients), scale)
