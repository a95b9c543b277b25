"""The shape of a snippet in a dozen numbers, whatever its place and size: what classifiers of time series look at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.drives.filters import tapered_powers

# Columns of `shape_features`; most are features of catch22.
SHAPES = (
    "mode_5",
    "mode_10",
    "longest_above_mean",
    "longest_decrease",
    "decay",
    "first_minimum",
    "reversibility",
    "large_changes",
    "centroid",
    "low_power",
    "late_extremes_high",
    "late_extremes_low",
    "motifs",
    "forecast_error",
    "kurtosis",
    "change_kurtosis",
    "sign_changes",
)

LARGE_CHANGE = 0.04  # Of a change from row to row, in standard deviations (pNN40 of catch22). [-]
EXTREME_QUANTILE = 1.0  # Beyond it a value counts as extreme, in standard deviations. [-]


def shape_features(snippets: FloatArray) -> FloatArray:
    """Shape of each snippet, shape (n, m >= 8), mean and standard deviation taken out; columns as in `SHAPES`. [-]

    Centre of the fullest of 5 and of 10 bins; longest stretch above the mean, and of falling values; lag at which the
    autocorrelation falls below 1/e, and of its first minimum; mean cube of changes; share of changes beyond 0.04;
    centre of the power over frequency, and share in the lowest fifth; median place of values above 1 and below -1;
    entropy of three-letter words; error of the mean of the last three as a forecast; kurtosis of values and of changes;
    share of changes that turn round. After C. H. Lubba et al., "catch22: CAnonical Time-series CHaracteristics", Data
    Mining and Knowledge Discovery 33, 2019, for all rows at once; numbers differ from the reference code's.
    """
    x = np.asarray(snippets, dtype=np.float64)
    spread = x.std(axis=1, keepdims=True)
    z = (x - x.mean(axis=1, keepdims=True)) / np.where(spread > 0.0, spread, 1.0)
    change = np.diff(z, axis=1)
    lagged = _autocorrelation(z)
    return np.column_stack(
        [
            _mode(z, 5),
            _mode(z, 10),
            longest_true(z > 0.0),
            longest_true(change < 0.0),
            _first(lagged < np.exp(-1.0)),
            _first((lagged[:, 1:-1] < lagged[:, :-2]) & (lagged[:, 1:-1] < lagged[:, 2:])),
            (change**3).mean(axis=1),
            (np.abs(change) > LARGE_CHANGE).mean(axis=1),
            *_spectral(z),
            _median_place(z > EXTREME_QUANTILE),
            _median_place(z < -EXTREME_QUANTILE),
            _motif_entropy(z),
            _forecast_error(z),
            (z**4).mean(axis=1),
            _kurtosis(change),
            turns(change),
        ]
    )


def longest_true(flags: NDArray[np.bool_]) -> FloatArray:
    """Longest stretch of each row, as a share of the row, shape (n,). [-]"""
    run = np.zeros(len(flags))
    best = np.zeros(len(flags))
    for column in flags.T:
        run = np.where(column, run + 1.0, 0.0)
        best = np.maximum(best, run)
    return np.asarray(best / flags.shape[1])


def turns(values: FloatArray) -> FloatArray:
    """Share of each row's values that have another sign than the one before, shape (n,). [-]"""
    return np.asarray((values[:, 1:] * values[:, :-1] < 0.0).mean(axis=1))


def _mode(z: FloatArray, bins: int) -> FloatArray:
    low, high = z.min(axis=1, keepdims=True), z.max(axis=1, keepdims=True)
    width = np.where(high > low, (high - low) / bins, 1.0)
    place = np.minimum(((z - low) / width).astype(np.int64), bins - 1)
    counts = np.array([(place == k).sum(axis=1) for k in range(bins)])
    return np.asarray(low[:, 0] + (counts.argmax(axis=0) + 0.5) * width[:, 0])


def _autocorrelation(z: FloatArray) -> FloatArray:
    m = z.shape[1]
    power = tapered_powers(z, 1.0, size=2 * m)
    products = np.fft.irfft(power, axis=1)[:, : m // 2 + 1]
    return np.asarray(products / np.where(products[:, :1] > 0.0, products[:, :1], 1.0))


def _first(flags: NDArray[np.bool_]) -> FloatArray:
    """Place of the first True in each row, the row's length where there is none. [rows]"""
    return np.asarray(np.where(flags.any(axis=1), flags.argmax(axis=1), flags.shape[1]), dtype=np.float64)


def _spectral(z: FloatArray) -> tuple[FloatArray, FloatArray]:
    power = tapered_powers(z, np.hanning(z.shape[1]))[:, 1:] + 1e-12
    share = power / power.sum(axis=1, keepdims=True)
    fifth = max(1, share.shape[1] // 5)
    return share @ np.linspace(0.0, 1.0, share.shape[1]), share[:, :fifth].sum(axis=1)


def _median_place(flags: NDArray[np.bool_]) -> FloatArray:
    """Where half of the True values of a row have passed, -1 to 1; 0 where there are none. [-]"""
    passed = flags.cumsum(axis=1)
    half = (2 * passed >= passed[:, -1:]).argmax(axis=1)
    return np.where(flags.any(axis=1), 2.0 * half / (flags.shape[1] - 1) - 1.0, 0.0)


def _motif_entropy(z: FloatArray) -> FloatArray:
    """Entropy of words of three letters, each value being low, middle or high by the row's own thirds. [bit]"""
    ranks = z.argsort(axis=1, kind="stable").argsort(axis=1, kind="stable")
    letters = 3 * ranks // z.shape[1]
    words = 9 * letters[:, :-2] + 3 * letters[:, 1:-1] + letters[:, 2:]
    share = np.array([(words == k).mean(axis=1) for k in range(27)])
    return np.asarray(-(share * np.log2(np.where(share > 0.0, share, 1.0))).sum(axis=0))


def _forecast_error(z: FloatArray) -> FloatArray:
    forecast = (z[:, :-3] + z[:, 1:-2] + z[:, 2:-1]) / 3.0
    return np.asarray((z[:, 3:] - forecast).std(axis=1))


def _kurtosis(values: FloatArray) -> FloatArray:
    centred = values - values.mean(axis=1, keepdims=True)
    variance = (centred**2).mean(axis=1)
    return np.asarray((centred**4).mean(axis=1) / np.where(variance > 0.0, variance, 1.0) ** 2)
