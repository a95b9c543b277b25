"""A slow drift or a step of the mean that no column explains.

People drift about what they take for the middle within a minute or two; that is memory, and any core model's business.
So the whitened rows' spectrum between 50 s and 10 min says how likely each drift of up to 160 s is, and only what goes
beyond their continuation to longer periods counts. Everything is scored at low frequencies, where sums over time are
sums over frequencies, weighted by that spectrum.

Two nulls, and the less convinced one is believed: simulated rows with such a drift, and the drive's own rows with
the sign of whole minutes drawn anew. The first knows how a drift goes on from minute to minute; the second knows how
large a single odd minute may be (a driver who sits on the marking for a while is no drift).

References
----------
.. [1] U. K. Müller, M. W. Watson, "Testing models of low-frequency variability", Econometrica 76, 2008.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.time_smooth import half_cosines
from xosc_lateral.identification.autocorrelation import Whitener, fit_autoregression
from xosc_lateral.identification.innovations import ORDER
from xosc_lateral.identification.regression import Coarse, Fitted
from xosc_lateral.identification.significance import as_one_degree, upper_tail

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

DRIFT_TERMS = 8
"""Half cosines over a drive that stand for a slow drift."""

STEP_COST = 5.0
"""A step has a free moment. [chi-square]"""

DRIFT_COST = 2.0
"""A drift may take one to eight half cosines. [chi-square]"""

EDGE_S, STEP_GRID_S = 60, 15
"""Least time on either side of a step, and between the moments that are tried. [s]"""

NEAR_S = 90
"""A step is dated to the second within so much of where slow movement has it. [s]"""

UNREMARKABLE = 6.0
"""A drift with a lower score is not compared with chance: chance gives it in every few. [chi-square]"""

N_NULL = 600
"""Samples of either null: a mixture's tail takes many."""

N_FIRST, HOPELESS = 200, 0.05
"""After so many samples a score is given up that chance reaches in more than this share of them. [-]"""

SIGN_S = 60
"""Length of the windows whose sign is drawn anew. [s]"""

SLOW_BAND = (50.0, 600.0)
"""Periods that are slow, but no drift yet. [s]"""

SHORTEST_S = 12.0
"""Drifts and steps are scored at periods from here on. [s]"""

ORDINARY_S = np.array([20.0, 40.0, 70.0, 110.0, 160.0])
"""Correlation times of a drift that counts as ordinary. [s]"""

DRIFT_SIZES = (1, 2, 4, 8)
"""Numbers of half cosines tried for a drift."""


@dataclass(frozen=True, slots=True)
class LowFrequency:
    """Slow change of the mean: which of drift and step, and how sure.

    Parameters
    ----------
    drift, step : float
        Score of either. [chi-square]
    size : int
        Half cosines that the drift takes.
    at : int
        Coarse row of the best step.
    p_value : float
        Of the better of the two, against the less convinced null.
    """

    drift: float
    size: int
    step: float
    at: int
    p_value: float

    @property
    def is_step(self) -> bool:
        """Whether one step explains more than a slow drift."""
        return self.step >= self.drift


def find_low_frequency(coarse: Coarse, fitted: Fitted, rng: np.random.Generator) -> LowFrequency | None:
    """Drift and step at once; None when no drive is long enough."""
    if not coarse.lasts:
        return None
    drift = half_cosines_of(coarse, DRIFT_TERMS)
    left = np.where(coarse.valid, fitted.movement * fitted.scale, 0.0)
    basis = np.linalg.qr(np.column_stack([np.ones(len(left)), drift]) * coarse.valid[:, None])[0]
    movement = np.where(coarse.valid, (left - basis @ (basis.T @ left)) / fitted.scale, 0.0)
    process = fit_autoregression(movement, coarse.valid, ORDER)
    whitener = Whitener(process, coarse.valid, coarse.drive, fitted.scale)
    rows = whitener.rows(left)
    rows = rows / float(np.sqrt(np.mean(rows[coarse.valid] ** 2)))
    steps, moments = _steps(coarse, whitener)
    scores = _Scores(whitener.rows(drift), steps)
    drift_score, size, step_score, best = scores(rows)
    at = int(moments[best]) if len(moments) else 0
    score = max(drift_score, step_score)
    p_value = 1.0
    if score >= UNREMARKABLE:
        nulls = (_simulated(rows, whitener, rng), _resigned(rows, whitener, rng))
        p_value = max(_probability(score, (max(scores(one)[::2]) for one in null)) for null in nulls)
        at = _moment(coarse, whitener, rows, at)
    return LowFrequency(drift_score, size, step_score, at, p_value)


def _probability(score: float, null: Iterator[float]) -> float:
    sample = list(islice(null, N_FIRST))
    if upper_tail(score, np.array(sample)) <= HOPELESS:
        sample += null
    return upper_tail(score, np.array(sample))


class _Scores:
    """Best scores of drift and step for any rows, columns transformed once.

    Parameters
    ----------
    drift : array, shape (n, `DRIFT_TERMS`)
        Whitened.
    steps : array, shape (n, moments)
        Whitened.
    """

    def __init__(self, drift: FloatArray, steps: FloatArray) -> None:
        n = len(drift)
        frequency = np.fft.rfftfreq(n)
        self._n = n
        self._kept = (frequency > 0.0) & (frequency <= 1.0 / SHORTEST_S)
        self._drift, self._steps = self._transform(drift), self._transform(steps)

    def __call__(self, rows: FloatArray) -> tuple[float, int, float, int]:
        """Best score of a drift [chi-square] and of how many half cosines, best score of a step, and which."""
        observed = self._transform(rows)
        # each frequency stands for itself and its mirror image
        weight = 2.0 / self._n / _OrdinaryDrift.of(rows).typical()[self._kept]
        weighed = np.conj(self._drift) * weight[:, None]
        gram, moments = (weighed.T @ self._drift).real, (weighed.T @ observed).real
        best = (0.0, DRIFT_SIZES[0])
        for size in DRIFT_SIZES:
            gained = float(moments[:size] @ np.linalg.pinv(gram[:size, :size]) @ moments[:size])
            best = max(best, (float(as_one_degree(gained, size)) - DRIFT_COST, size))
        if self._steps.shape[1] == 0:
            return *best, 0.0, 0
        jumped = (np.conj(self._steps).T @ (weight * observed)).real
        chi_square = jumped**2 / np.maximum(np.square(np.abs(self._steps)).T @ weight, 1e-12)
        at = int(np.argmax(chi_square))
        return *best, float(chi_square[at]) - STEP_COST, at

    def _transform(self, values: FloatArray) -> ComplexArray:
        return np.asarray(np.fft.rfft(values, axis=0)[self._kept])


def _simulated(rows: FloatArray, whitener: Whitener, rng: np.random.Generator) -> Iterator[FloatArray]:
    """Rows with an ordinary drift, each with one drawn by how likely it is."""
    ordinary = _OrdinaryDrift.of(rows)
    for drawn in rng.choice(len(ordinary.share), size=N_NULL, p=ordinary.share):
        white = np.where(whitener.valid, rng.normal(size=len(rows)), 0.0)
        slow = np.fft.irfft(np.fft.rfft(white) * np.sqrt(ordinary.levels[drawn]), len(rows))
        yield whitener.without_levels(np.where(whitener.valid, slow, 0.0))


def _resigned(rows: FloatArray, whitener: Whitener, rng: np.random.Generator) -> Iterator[FloatArray]:
    """The same rows with the sign of whole windows drawn anew."""
    for _ in range(N_NULL):
        window = (np.arange(len(rows)) + rng.integers(SIGN_S)) // SIGN_S
        signs = rng.choice([-1.0, 1.0], size=int(window[-1]) + 1)
        yield whitener.without_levels(rows * signs[window])


@dataclass(frozen=True, eq=False)
class _OrdinaryDrift:
    """What ordinary drifts would add to the spectrum of rows, and how likely each of them is.

    Parameters
    ----------
    levels : array, shape (drifts, n // 2 + 1)
        Power of the rows with that drift, 1 without any.
    share : array, shape (drifts,)
        Probability of each, all being as likely beforehand.
    """

    levels: FloatArray
    share: FloatArray

    @classmethod
    def of(cls, rows: FloatArray) -> _OrdinaryDrift:
        """Judge by the rows' spectrum on `SLOW_BAND`."""
        frequency = np.fft.rfftfreq(len(rows))
        power = np.square(np.abs(np.fft.rfft(rows))) / max(float(rows @ rows), 1e-30)
        band = (frequency >= 1.0 / SLOW_BAND[1]) & (frequency <= 1.0 / SLOW_BAND[0])
        levels = _levels(len(rows))
        seen = levels[:, band]
        likelihood = -np.sum(power[band] / seen + np.log(seen), axis=1)
        share = np.exp(likelihood - likelihood.max())
        return cls(levels, share / share.sum())

    def typical(self) -> FloatArray:
        """Geometric mean of the levels, shape (n // 2 + 1,)."""
        return np.asarray(np.exp(self.share @ np.log(self.levels)))


@lru_cache(maxsize=2)
def _levels(n: int) -> FloatArray:
    shapes = 1.0 / (1.0 + np.square(2.0 * np.pi * np.outer(ORDINARY_S, np.fft.rfftfreq(n))))
    sizes = np.concatenate([[0.0], np.geomspace(0.1, 60.0, 40)])
    return np.asarray((1.0 + sizes[:, None, None] * shapes).reshape(len(sizes) * len(ORDINARY_S), -1))


def _moment(coarse: Coarse, whitener: Whitener, rows: FloatArray, at: int) -> int:
    """The second at which a step near `at` is likeliest: a jump leaves its mark in the movement of that very second."""
    near = np.arange(max(at - NEAR_S, 1), min(at + NEAR_S + 1, len(coarse)))
    jumps = whitener.rows((np.arange(len(coarse))[:, None] >= near).astype(np.float64))
    return int(near[np.argmax((jumps.T @ rows) ** 2 / np.maximum(np.square(jumps).sum(axis=0), 1e-12))])


def _steps(coarse: Coarse, whitener: Whitener) -> tuple[FloatArray, NDArray[np.intp]]:
    """Whitened jumps of the mean at moments 15 s apart, and these moments; for a single long drive only."""
    count = np.cumsum(coarse.valid)
    if int(coarse.drive.max()) > 0:
        return np.zeros((len(coarse), 0)), np.zeros(0, dtype=np.intp)
    inside = np.flatnonzero(coarse.valid & (count >= EDGE_S) & (count <= count[-1] - EDGE_S))[::STEP_GRID_S]
    jumps = (np.arange(len(coarse))[:, None] >= inside).astype(np.float64)
    return whitener.rows(jumps), inside


def clock_range(coarse: Coarse) -> tuple[float, float]:
    """First and last valid time of all drives, in their clocks. [s]"""
    seen = coarse.time[coarse.valid]
    return float(seen.min()), float(seen.max())


def half_cosines_of(coarse: Coarse, number: int) -> FloatArray:
    """Half cosines of the drives' clock, within -1..1, shape (n, number). [-]"""
    return half_cosines(coarse.time, *clock_range(coarse), number)
