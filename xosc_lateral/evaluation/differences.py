"""How far apart two sets of windows are, from what was computed of each."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.evaluation.distances import wasserstein
from xosc_lateral.evaluation.lane_keeping import INDICATORS
from xosc_lateral.evaluation.measures import Features
from xosc_lateral.evaluation.metrics import METRICS

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SILENCE = 1e-9
"""Added to power densities, so that no movement is a number too: 0.03 mm in 1 Hz. [m2/Hz]"""

FAMILIES = ("metrics", "lane_keeping", "spectrum", "memory")
"""Kinds of difference."""

UNITS = {"metrics": "sd", "lane_keeping": "sd", "spectrum": "dB", "memory": "-"}


def differences(real: Features, other: Features, rows: IntArray, other_rows: IntArray) -> dict[str, float]:
    """How far apart two sets of windows are, by family.

    Parameters
    ----------
    real, other : Features
    rows, other_rows : array of int
        Windows that count, and how often (a bootstrap repeats them).

    Returns
    -------
    dict
        `metrics`, `lane_keeping`: mean Wasserstein distance in standard deviations of the real ones [sd]; `spectrum`:
        rms difference over the bands [dB]; `memory`: rms difference of the autocorrelation [-].
    """
    found = {
        "metrics": float(np.mean(list(column_distances(real.metrics[rows], other.metrics[other_rows])))),
        "lane_keeping": float(np.mean(list(column_distances(real.indicators[rows], other.indicators[other_rows])))),
    }
    level, beside = real.power[rows].mean(axis=0) + SILENCE, other.power[other_rows].mean(axis=0) + SILENCE
    found["spectrum"] = float(np.sqrt(np.mean((10.0 * np.log10(beside / level)) ** 2)))
    own, others = autocorrelation_of(real, rows), autocorrelation_of(other, other_rows)
    found["memory"] = float(np.sqrt(np.mean((own - others) ** 2)))
    return found


def column_distances(real: FloatArray, other: FloatArray) -> list[float]:
    """Wasserstein distance of each column, in standard deviations of the real one. [sd] Shapes (n, k) and (m, k)."""
    spread = real.std(axis=0)
    spread = np.where(spread > 0.0, spread, 1.0)
    return [wasserstein(real[:, k], other[:, k]) / float(spread[k]) for k in range(real.shape[1])]


def autocorrelation_of(features: Features, rows: IntArray) -> FloatArray:
    """About the mean of all windows; no movement at all: 1, it stays as it is. Shape (lags,). [-]"""
    mean, square = features.moments[rows].mean(axis=0)
    variance = square - mean**2
    if variance < 1e-12:
        return np.ones(features.products.shape[1])
    return np.asarray((features.products[rows].mean(axis=0) - mean**2) / variance)


def named_distances(real: Features, other: Features) -> Mapping[str, float]:
    """Distance of each metric and indicator by its name. [sd]"""
    names = (*METRICS, *INDICATORS)
    values = [*column_distances(real.metrics, other.metrics), *column_distances(real.indicators, other.indicators)]
    return dict(zip(names, values, strict=True))


def named_means(real: Features, other: Features) -> Mapping[str, tuple[float, float]]:
    """Mean of each lane-keeping indicator, real and other; units in `lane_keeping.UNITS`. [m], [s], [-]"""
    means = real.indicators.mean(axis=0).tolist(), other.indicators.mean(axis=0).tolist()
    return {name: (means[0][k], means[1][k]) for k, name in enumerate(INDICATORS)}
