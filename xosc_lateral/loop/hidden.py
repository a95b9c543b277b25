"""Looks for what no column explains: growing spread, on/off regimes, a weave, a slow drift, a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.loop.chance import LEAST, tail_probability
from xosc_lateral.loop.looks import slow_columns, slow_rows, standardised
from xosc_lateral.loop.movement import DRIFT_TERMS, MIN_DRIFT_S, Coarse, Fitted, elapsed, squared_innovations
from xosc_lateral.loop.noise import Whitener, fit_autoregression

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

STEP_COST = 5.0
"""A step has a free moment. [chi-square]"""

DRIFT_COST = 2.0
"""A drift may take one to eight half cosines. [chi-square]"""

EDGE_S, STEP_GRID_S = 60, 15
"""Least time on either side of a step, and between the moments that are tried. [s]"""

UNREMARKABLE = 6.0
"""A wander with a lower score is not compared with simulated drives: chance gives it in every few. [chi-square]"""

N_SIMULATED = 400
"""Drives without drift or step, of the same movement, that the drift look is compared with."""

SLOW_BAND = (50.0, 600.0)
"""Periods that are slow, but no drift yet. [s]"""

MOODS_S = np.array([20.0, 40.0, 70.0, 110.0, 160.0])
"""Correlation times of a wander that counts as ordinary. [s]"""

DRIFT_SIZES = (1, 2, 4, 8)
"""Numbers of half cosines tried for a drift."""


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


@dataclass(frozen=True, slots=True)
class Wander:
    """Slow change of the mean: which of drift and step, and how sure.

    Parameters
    ----------
    drift, step : float
        Score of either. [chi-square]
    at : int
        Coarse row of the best step.
    p_value : float
        Of the better of the two, against simulated drives.
    """

    drift: float
    step: float
    at: int
    p_value: float

    @property
    def is_step(self) -> bool:
        """Whether one step explains more than a slow wander."""
        return self.step >= self.drift


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
    for _ in range(N_SIMULATED):
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


def find_wander(coarse: Coarse, fitted: Fitted, rng: np.random.Generator) -> Wander | None:
    """Drift and step at once, against simulated rows of the same spectrum that go through the same procedure.

    People wander about what they take for the middle within a minute or two; that is memory, and any core model's
    business. So the whitened rows' spectrum is fitted between 50 s and 10 min with a wander of up to 160 s, and only
    what goes beyond its continuation to longer periods counts.
    """
    drift = coarse.drift_terms()
    if drift.shape[1] == 0 or fitted.terms.drift or fitted.terms.step_at is not None:
        return None
    left = np.where(coarse.valid, fitted.movement * fitted.scale, 0.0)
    basis = np.linalg.qr(np.column_stack([np.ones(len(left)), drift]) * coarse.valid[:, None])[0]
    movement = np.where(coarse.valid, (left - basis @ (basis.T @ left)) / fitted.scale, 0.0)
    process = fit_autoregression(movement, coarse.valid, fitted.terms.order)
    whitener = Whitener(process, coarse.valid, coarse.drive, fitted.scale)
    rows, columns = whitener.rows(left), whitener.rows(drift)
    level = float(np.sqrt(np.mean(rows[coarse.valid] ** 2)))
    steps, moments = _steps(coarse, whitener)
    drift_score, step_score, best = _wander_scores(rows / level, columns, steps)
    at = int(moments[best]) if len(moments) else 0
    if max(drift_score, step_score) < UNREMARKABLE:
        return Wander(drift_score, step_score, at, 1.0)
    excess = np.sqrt(_slow_excess(rows / level))
    null = []
    for _ in range(N_SIMULATED):
        white = np.where(coarse.valid, rng.normal(size=len(rows)), 0.0)
        simulated = np.where(coarse.valid, np.fft.irfft(np.fft.rfft(white) * excess, len(rows)), 0.0)
        null.append(max(_wander_scores(whitener.without_intercepts(simulated), columns, steps)[:2]))
    return Wander(drift_score, step_score, at, tail_probability(max(drift_score, step_score), np.asarray(null)))


def _wander_scores(rows: FloatArray, columns: FloatArray, steps: FloatArray) -> tuple[float, float, int]:
    """Best scores of a drift and of a step [chi-square], and which step."""
    from xosc_lateral.loop.scan import as_one_degree

    flat = 1.0 / np.sqrt(_slow_excess(rows))[:, None]

    def even(values: FloatArray) -> FloatArray:
        return np.asarray(np.fft.irfft(np.fft.rfft(values, axis=0) * flat, len(rows), axis=0))

    response, drift = even(rows[:, None])[:, 0], even(columns)
    best = 0.0
    per_drive = columns.shape[1] // DRIFT_TERMS
    for size in DRIFT_SIZES:
        chosen = np.concatenate([drift[:, DRIFT_TERMS * k : DRIFT_TERMS * k + size] for k in range(per_drive)], axis=1)
        moments = chosen.T @ response
        gained = float(moments @ np.linalg.pinv(chosen.T @ chosen) @ moments)
        best = max(best, float(as_one_degree(np.array([gained]), chosen.shape[1])[0]) - DRIFT_COST)
    if steps.shape[1] == 0:
        return best, 0.0, 0
    jumps = even(steps)
    chi_square = (jumps.T @ response) ** 2 / np.maximum(np.square(jumps).sum(axis=0), 1e-12)
    at = int(np.argmax(chi_square))
    return best, float(chi_square[at]) - STEP_COST, at


def _slow_excess(rows: FloatArray) -> FloatArray:
    """1 + what a wander of at most 160 s adds to the spectrum of rows, shape (n // 2 + 1,); fitted on `SLOW_BAND`."""
    n = len(rows)
    frequency = np.fft.rfftfreq(n)
    power = np.square(np.abs(np.fft.rfft(rows))) / max(float(rows @ rows), 1e-30)
    band = (frequency >= 1.0 / SLOW_BAND[1]) & (frequency <= 1.0 / SLOW_BAND[0])
    shapes = 1.0 / (1.0 + np.square(2.0 * np.pi * np.outer(MOODS_S, frequency)))
    size = np.concatenate([[0.0], np.geomspace(0.1, 60.0, 40)])
    level = 1.0 + size[:, None, None] * shapes[None, :, band]
    likelihood = -np.sum(power[band] / level + np.log(level), axis=2)
    best_size, best_shape = np.unravel_index(int(np.argmax(likelihood)), likelihood.shape)
    return np.asarray(1.0 + size[best_size] * shapes[best_shape])


def _steps(coarse: Coarse, whitener: Whitener) -> tuple[FloatArray, NDArray[np.intp]]:
    """Whitened jumps of the mean at moments 15 s apart, and these moments; for a single long drive only."""
    count = np.cumsum(coarse.valid)
    if int(coarse.drive.max()) > 0:
        return np.zeros((len(coarse), 0)), np.zeros(0, dtype=np.intp)
    inside = np.flatnonzero(coarse.valid & (count >= EDGE_S) & (count <= count[-1] - EDGE_S))[::STEP_GRID_S]
    jumps = (np.arange(len(coarse))[:, None] >= inside).astype(np.float64)
    return whitener.rows(jumps), inside


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
