"""Looks for what no column explains: growing spread, on/off regimes, a weave; drifts and steps are in `wander`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.loop.chance import LEAST, tail_probability
from xosc_lateral.loop.looks import slow_columns, slow_rows, standardised
from xosc_lateral.loop.movement import MIN_DRIFT_S, Coarse, Fitted, elapsed, squared_innovations

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MEMORIES = (6.0, 15.0, 40.0)
"""Lengths of regimes that are looked for. [s]"""

SHORTEST = 8
"""Loudness that comes and goes faster is how people steer, by a correction now and then, and no regime. [s]"""

PERIODS = (4.0, 60.0)
"""Weaves that are looked for. [s]"""

WIDTHS = (1, 3, 7)
"""Neighbouring frequencies taken together: a weave keeps its phase for the whole drive, or for a part. [-]"""

SURROUNDINGS = 60
"""Frequencies to each side that say how high the spectrum is without a weave. [-]"""

N_SHUFFLED = 400
"""Random orders of the seconds that the regimes' look is compared with."""


@dataclass(frozen=True, slots=True)
class Growth:
    """Steady change of the spread."""

    z: float
    p_value: float


@dataclass(frozen=True, slots=True)
class Clustering:
    """Loud seconds that come in clusters."""

    z: float
    memory_s: float
    p_value: float


@dataclass(frozen=True, slots=True)
class Peak:
    """A spectral line."""

    frequency: float
    width: int
    power: float
    p_value: float


def find_growth(coarse: Coarse, fitted: Fitted) -> Growth:
    """Regress the squared innovations on time; clustered seconds count for less (Newey-West over 2 min)."""
    return _growth(coarse, squared_innovations(fitted.rows, coarse.valid), coarse.valid)


def find_slow_growth(coarse: Coarse, fitted: Fitted) -> Growth:
    """The same for the slower movement."""
    slow = slow_rows(coarse, fitted)
    return _growth(coarse, standardised(slow.squares, slow.valid), slow.valid)


def _growth(coarse: Coarse, squares: FloatArray, valid: BoolArray) -> Growth:
    from scipy.stats import norm

    time = np.where(valid, elapsed(coarse), 0.0)
    time = time - np.where(valid, time[valid].mean(), 0.0)
    slope = float(time @ squares) / float(time @ time)
    left = np.where(valid, squares - slope * time, 0.0)
    inflation = 1.0 + 2.0 * sum((1.0 - lag / 121.0) * _correlation(left, valid, lag) for lag in range(1, 121))
    z = slope * np.sqrt(float(time @ time)) / np.sqrt(max(inflation, 1.0))
    return Growth(z, max(2.0 * float(norm.sf(abs(z))), LEAST))


def find_clustering(coarse: Coarse, fitted: Fitted, rng: np.random.Generator) -> Clustering:
    """Autocorrelation of the squared innovations, weighted by exponentials; null: the same seconds in random order."""
    squares = squared_innovations(fitted.rows, coarse.valid)
    known = slow_columns(coarse, fitted)
    if known.shape[1]:
        basis = np.linalg.qr((known - known[coarse.valid].mean(axis=0)) * coarse.valid[:, None])[0]
        squares = squares - basis @ (basis.T @ squares)
    observed = _clustering_scores(squares, coarse.valid)
    null = []
    rows = np.flatnonzero(coarse.valid)
    shuffled = np.zeros(len(squares))
    for _ in range(N_SHUFFLED):
        shuffled[rows] = rng.permutation(squares[rows])
        null.append(_clustering_scores(shuffled, coarse.valid).max())
    best = int(np.argmax(observed))
    return Clustering(
        float(observed[best]),
        MEMORIES[best],
        tail_probability(float(_signed_square(observed[best])), _signed_square(np.asarray(null))),
    )


def find_peak(coarse: Coarse, fitted: Fitted) -> Peak | None:
    """Highest spectral line of the whitened residual over its surroundings, per drive that is long enough."""
    best: Peak | None = None
    drives = int(coarse.drive.max()) + 1
    for index in range(drives):
        rows = coarse.drive == index
        if coarse.valid[rows].sum() < MIN_DRIFT_S:
            continue
        peak = _peak(fitted.rows[rows])
        if peak is not None and (best is None or peak.p_value < best.p_value):
            best = peak
    if best is None:
        return None
    return Peak(best.frequency, best.width, best.power, min(1.0, best.p_value * drives))


def _peak(rows: FloatArray) -> Peak | None:
    n = len(rows)
    power = np.abs(np.fft.rfft(rows)) ** 2 / max(float(rows @ rows), 1e-12)
    frequency = np.fft.rfftfreq(n)
    band = (frequency >= 1.0 / PERIODS[1]) & (frequency <= 1.0 / PERIODS[0])
    best: Peak | None = None
    for width in WIDTHS:
        together = np.convolve(power, np.ones(width), mode="same")
        around = np.convolve(power, np.ones(2 * SURROUNDINGS + 1), mode="same") - np.convolve(
            power, np.ones(2 * width + 11), "same"
        )
        level = around / (2 * SURROUNDINGS + 1 - 2 * width - 11)
        ratio = np.where(band, together / np.maximum(level, 1e-12), 0.0)
        at = int(np.argmax(ratio))
        p_value = _line_probability(float(ratio[at]), width, int(band.sum()))
        if best is None or p_value < best.p_value:
            best = Peak(float(frequency[at]), width, float(ratio[at]), p_value)
    return best


def _line_probability(ratio: float, width: int, n_frequencies: int) -> float:
    from scipy.stats import f

    # sum of `width` exponentials over the mean of about 100 others; every width pays for every frequency
    single = float(f.sf(ratio / width, 2 * width, 2 * (2 * SURROUNDINGS - 2 * width - 10)))
    return float(np.clip(single * n_frequencies * len(WIDTHS), LEAST, 1.0))


def _clustering_scores(squares: FloatArray, valid: BoolArray) -> FloatArray:
    n = int(valid.sum())
    longest = int(3 * max(MEMORIES))
    size = len(squares) + longest
    transform = np.fft.rfft(squares, size)
    lags = np.arange(SHORTEST, longest + 1)
    covariance = np.fft.irfft(np.abs(transform) ** 2, size)[lags] / np.sqrt(n)
    weights = np.exp(-lags[None, :] / np.asarray(MEMORIES)[:, None])
    return np.asarray(weights @ covariance / np.sqrt((weights**2).sum(axis=1)))


def _correlation(values: FloatArray, valid: BoolArray, lag: int) -> float:
    both = float(np.sum(valid[:-lag] & valid[lag:]))
    power = float(values @ values) / max(float(valid.sum()), 1.0)
    return float(values[:-lag] @ values[lag:]) / max(both, 1.0) / max(power, 1e-12)


def _signed_square(values: FloatArray) -> FloatArray:
    return np.asarray(np.sign(values) * np.square(values))
