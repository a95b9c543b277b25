"""What is compared in a set of windows, computed once and then for any choice of rows.

A sampled window that starts where its real one starts knows something that a random real window does not. So it stands
beside real windows of *other* drivers whose start is the same, and windows that know no start beside any windows of
other drivers (A. Ramdas, N. García Trillos, M. Cuturi, "On Wasserstein two-sample testing", Entropy 19, 2017).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.filters import tapered_powers, without_line
from xosc_lateral.drivers.evaluation.lane_keeping import INDICATORS, lane_keeping_indicators
from xosc_lateral.drivers.evaluation.metrics import METRICS, column_distances, snippet_metrics

LAGS = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0)  # Of the autocorrelation; those that fit into half a window are used. [s]
BANDS = np.geomspace(0.03, 1.0, 13)  # Edges of the spectrum's bands, eight a decade. [Hz]


@dataclass(frozen=True, eq=False)
class Features:
    """Of n windows."""

    metrics: FloatArray  # shape (n, 10)
    indicators: FloatArray  # shape (n, 7)
    power: FloatArray  # shape (n, bands): Power density in bands. [m2/Hz]
    products: FloatArray  # shape (n, lags): Mean product of offsets that far apart. [m2]
    moments: FloatArray  # shape (n, 2): Mean offset and mean square. [m], [m2]

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
    return np.array([power[:, inside].mean(axis=1) for inside in bands]).reshape(len(bands), len(offset)).T


def resolved_bands(seconds: float, highest: float = float(BANDS[-1])) -> list[tuple[float, float]]:
    """Bands up to `highest` whose lower edge a window of that length goes through at least once. [Hz]"""
    bands = [(float(low), float(high)) for low, high in pairwise(BANDS)]
    return [(low, high) for low, high in bands if low * seconds >= 1.0 and high <= highest]


MINIMUM_POWER = 1e-9  # Added to power densities, so that no movement is a number too: 0.03 mm in 1 Hz. [m2/Hz]
FAMILIES = ("metrics", "lane_keeping", "spectrum", "memory")  # Kinds of difference.
UNITS = {"metrics": "sd", "lane_keeping": "sd", "spectrum": "dB", "memory": "-"}


def differences(real: Features, other: Features, rows: IntArray, other_rows: IntArray) -> dict[str, float]:
    """How far apart two sets of windows are, by family; `rows`: windows that count, and how often.

    `metrics`, `lane_keeping`: mean Wasserstein distance in standard deviations of the real ones [sd]; `spectrum`: rms
    difference over the bands [dB]; `memory`: rms difference of the autocorrelation [-].
    """
    families = {
        "metrics": float(np.mean(column_distances(real.metrics[rows], other.metrics[other_rows]))),
        "lane_keeping": float(np.mean(column_distances(real.indicators[rows], other.indicators[other_rows]))),
    }
    if real.power.shape[1]:  # else too short for any band
        level = real.power[rows].mean(axis=0) + MINIMUM_POWER
        beside = other.power[other_rows].mean(axis=0) + MINIMUM_POWER
        families["spectrum"] = float(np.sqrt(np.mean((10.0 * np.log10(beside / level)) ** 2)))
    reference, others = autocorrelation_of(real, rows), autocorrelation_of(other, other_rows)
    return families | {"memory": float(np.sqrt(np.mean((reference - others) ** 2)))}


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


NEIGHBOUR_COUNT = 20  # A stand-in is drawn among so many windows of other drivers whose starts are nearest.
FLOOR_DRAWS = 4  # Sets of stand-ins with the same start that are averaged over.


def windows_with_the_same_start(
    starts: FloatArray,
    drivers: NDArray[np.generic],
    donor_starts: FloatArray,
    donor_drivers: NDArray[np.generic],
    rng: np.random.Generator,
    *,
    count: int = 1,
) -> IntArray:
    """For each window `count` others by other drivers that start at nearly the same offset: rows, shape (n, count).

    Drawn among the nearest `NEIGHBOUR_COUNT`; a driver's own windows are never taken. Raises `NotEnoughDataError` when
    other drivers have fewer than `count` windows.
    """
    chosen = np.empty((len(starts), count), dtype=np.int64)
    for row, (start, driver) in enumerate(zip(starts.tolist(), drivers.tolist(), strict=True)):
        others = np.flatnonzero(donor_drivers != driver)
        if len(others) < count:
            raise NotEnoughDataError(f"{len(others)} windows of other drivers than {driver}; {count} are needed")
        gaps = np.abs(donor_starts[others] - start)
        pool = others[np.argpartition(gaps, min(NEIGHBOUR_COUNT, len(others)) - 1)[:NEIGHBOUR_COUNT]]
        chosen[row] = rng.permutation(pool)[:count]
    return chosen


def real_against_real(
    real: Features, donors: Features, rows: IntArray, donor_rows: IntArray, stand_ins: IntArray | None
) -> dict[str, float]:
    """`differences` of real windows of other drivers; `stand_ins`, shape (n, draws): donors with the same starts."""
    if stand_ins is None:
        return differences(real, donors, rows, donor_rows)
    draws = [differences(real, donors, rows, stand_ins[:, draw]) for draw in range(stand_ins.shape[1])]
    return {name: float(np.mean([draw[name] for draw in draws])) for name in draws[0]}
