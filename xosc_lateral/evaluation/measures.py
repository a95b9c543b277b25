"""What is compared in a set of windows, computed once and then for any choice of rows.

References
----------
.. [1] A. Ramdas, N. García Trillos, M. Cuturi, "On Wasserstein two-sample testing and related families of
       nonparametric tests", Entropy 19, 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drives.periodogram import tapered_powers, without_line
from xosc_lateral.evaluation.lane_keeping import lane_keeping_indicators
from xosc_lateral.evaluation.metrics import snippet_metrics

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LAGS = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0)
"""Of the autocorrelation; those that fit into half a window are used. [s]"""

BANDS = np.geomspace(0.03, 1.0, 13)
"""Edges of the spectrum's bands, eight a decade. [Hz]"""


@dataclass(frozen=True, eq=False)
class Features:
    """Of n windows.

    Parameters
    ----------
    metrics : array, shape (n, 10)
    indicators : array, shape (n, 7)
    power : array, shape (n, bands)
        Power density in bands. [m2/Hz]
    products : array, shape (n, lags)
        Mean product of offsets that far apart. [m2]
    moments : array, shape (n, 2)
        Mean offset and mean square. [m], [m2]
    """

    metrics: FloatArray
    indicators: FloatArray
    power: FloatArray
    products: FloatArray
    moments: FloatArray

    def __len__(self) -> int:
        return len(self.metrics)

    def take(self, rows: IntArray) -> Features:
        """Of some of the windows. `rows` of shape (k,). [-]"""
        return Features(
            self.metrics[rows], self.indicators[rows], self.power[rows], self.products[rows], self.moments[rows]
        )


def features_of(
    offset: FloatArray, lane_width: FloatArray, step: float, *, highest: float = float(BANDS[-1])
) -> Features:
    """Everything that `differences` needs of windows, shape (n, m); bands of the spectrum up to `highest` [Hz]."""
    m = offset.shape[1]
    lags = [round(lag / step) for lag in LAGS if round(lag / step) <= m // 2]
    products = [(offset[:, lag:] * offset[:, : m - lag]).mean(axis=1) for lag in lags]
    return Features(
        snippet_metrics(offset),
        lane_keeping_indicators(offset, lane_width, step),
        band_power(offset, step, highest=highest),
        np.array(products).reshape(len(lags), len(offset)).T,
        np.column_stack([offset.mean(axis=1), (offset**2).mean(axis=1)]),
    )


def band_power(offset: FloatArray, step: float, *, highest: float = float(BANDS[-1])) -> FloatArray:
    """Power density of each window in the bands that it can resolve (straight line removed, Hann window). [m2/Hz]

    Shape (n, bands).
    """
    m = offset.shape[1]
    window = np.hanning(m)
    power = tapered_powers(without_line(offset), window, size=4 * m) * 2.0 * step / (window**2).sum()
    frequency = np.fft.rfftfreq(4 * m, step)
    bands = [(frequency >= low) & (frequency < high) for low, high in resolved_bands(m * step, highest)]
    return np.column_stack([power[:, inside].mean(axis=1) for inside in bands])


def resolved_bands(seconds: float, highest: float = float(BANDS[-1])) -> list[tuple[float, float]]:
    """Bands up to `highest` whose lower edge a window of that length goes through at least once. [Hz]"""
    bands = [(float(low), float(high)) for low, high in pairwise(BANDS)]
    return [(low, high) for low, high in bands if low * seconds >= 1.0 and high <= highest]
