"""Score tests of all candidates at all lags at once, and at all circular shifts: the shifts far from zero are the null.

For rows r that are white under "no effect", the covariance with a column shifted by L is one point of a circular
cross-correlation, so a Fourier transform gives it for every L. Small |L| are lags that a driver may have; large ones
put the column beside a stretch of driving that it has nothing to do with, and keep its spectrum and the noise's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.loop.noise import moving_sum

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
ComplexArray = NDArray[np.complex64]

SMALLEST_SHARE = 0.05
"""A column that at some shift varies less than this share of its usual is taken to vary so much. [-]"""

LAGS = np.arange(-4, 5)
"""Lags looked at, in samples of the coarse grid (1 s); the response time adds to them."""

GUARD_S = 40
"""Circular shifts closer to zero than this are not used as null. [s]"""

TYPICAL_RANGE = (0.9, 50.0)
"""A calibration beyond this is not believed. [-]"""

SMOOTHING = (8, 0.3)
"""The rows' spectrum is averaged over so many frequencies to each side at least, and this share of the frequency.
Without it a slow column would be calibrated by the one or two frequencies that it holds. [-]"""

FAR = 200.0
"""Chi-square beyond which tails are taken from their expansions."""

N_SHIFTS = 400
"""Circular shifts drawn for the null."""


@dataclass(frozen=True, eq=False, slots=True)
class Rows:
    """What the candidates are tested against.

    Parameters
    ----------
    response : array, shape (n,)
        g: covariance with an answer x is g . x; already free of everything in the model.
    weight : array, shape (n,)
        The answer's variance is sum of weight * (filtered x)^2, less what the model's own terms take.
    taken : array, shape (q, n)
        The same transform of each orthonormal term in the model.
    polynomial : array
        Filter that whitens an answer.
    white : array, shape (n,)
        The rows themselves, white if the model is right: their spectrum says at which frequencies it is not.
    """

    response: FloatArray
    weight: FloatArray
    taken: FloatArray
    polynomial: FloatArray
    white: FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class Scan:
    """Result for candidates 0..m-1.

    Parameters
    ----------
    statistic : array, shape (m,)
        Best chi-square over the lags, calibrated, as of one degree of freedom, less the candidate's cost.
    chi_square : array, shape (m,)
        The same before calibration, degrees of freedom and cost.
    calibrations : list of Calibration
        What chance gives at each candidate's frequencies.
    lag : int array, shape (m,)
        Where. [coarse samples]
    null : array, shape (m, number of shifts)
        The same at circular shifts.
    """

    statistic: FloatArray
    chi_square: FloatArray
    calibrations: list[Calibration]
    lag: IntArray
    null: FloatArray


def draw_shifts(n: int, rng: np.random.Generator, number: int = N_SHIFTS) -> IntArray:
    """Circular shifts well away from zero, shape (number,) or fewer on a short timeline."""
    guard = min(GUARD_S, n // 4)
    possible = np.arange(guard, n - guard)
    if len(possible) <= number:
        return possible
    return np.sort(rng.choice(possible, size=number, replace=False))


def transform_answers(answers: Sequence[FloatArray]) -> list[ComplexArray]:
    """Fourier transforms of answers, shape (k, n // 2 + 1) each: the same in every look and round."""
    from scipy import fft

    return [
        fft.rfft(np.ascontiguousarray(answer.T, dtype=np.float32), axis=1).astype(np.complex64) for answer in answers
    ]


def scan(
    rows: Rows,
    answers: Sequence[FloatArray],
    transforms: Sequence[ComplexArray],
    costs: FloatArray,
    shifts: IntArray,
    lags: IntArray = LAGS,
) -> Scan:
    """Score every candidate.

    Parameters
    ----------
    rows : Rows
    answers : sequence of array, shape (n, k)
        Each candidate's answer at no lag, on the coarse grid.
    transforms : sequence of array
        `transform_answers` of them.
    costs : array, shape (m,)
    shifts, lags : int array
        [coarse samples]
    """
    n = len(rows.response)
    at_lags = lags % n
    at_shifts = (shifts[:, None] + lags[None, :]) % n
    prepared = _Prepared(rows, n)
    statistic, raw = np.empty((2, len(answers)))
    calibrations: list[Calibration] = []
    lag = np.empty(len(answers), dtype=np.intp)
    null = np.empty((len(answers), len(shifts)))
    for index, (answer, transform) in enumerate(zip(answers, transforms, strict=True)):
        chi_square, degrees = prepared.chi_square(answer, transform), answer.shape[1]
        elsewhere = chi_square[at_shifts]
        calibration = prepared.calibration(transform)
        calibrations.append(calibration)
        best = int(np.argmax(chi_square[at_lags]))
        raw[index], lag[index] = chi_square[at_lags][best], lags[best]
        statistic[index] = float(calibration.without(raw[index]).apply(raw[index], degrees)) - costs[index]
        null[index] = calibration.apply(elsewhere.max(axis=1), degrees) - costs[index]
    return Scan(statistic, raw, calibrations, lag, null)


@dataclass(frozen=True, slots=True)
class Calibration:
    """What chance gives a candidate, judged by the rows' spectrum at the candidate's frequencies.

    Parameters
    ----------
    typical : float
        Mean chi-square per degree of freedom: 1 if the rows are white there.
    freedom : float
        Degrees of freedom that this is known with: few for a slow column, which rests on few frequencies.
    own : float
        What a chi-square of 1 of the candidate itself adds to `typical`.
    """

    typical: float
    freedom: float
    own: float

    def without(self, chi_square: float) -> Calibration:
        """The same if what the candidate explains is not counted as noise."""
        left = (self.typical - self.own * chi_square) * self.freedom / max(self.freedom - 1.0, 1.0)
        return Calibration(float(np.clip(left, *TYPICAL_RANGE)), max(self.freedom - 1.0, 1.0), self.own)

    def apply(self, chi_square: FloatArray | float, degrees: int) -> FloatArray:
        """Chi-square of one degree of freedom and known noise with the same tail probability (Wallace's formula)."""
        relative = as_one_degree(np.asarray(chi_square, dtype=np.float64) / self.typical, degrees)
        v = self.freedom
        return np.asarray(((8.0 * v + 1.0) / (8.0 * v + 3.0)) ** 2 * v * np.log1p(relative / v))


def as_one_degree(chi_square: FloatArray, degrees: int) -> FloatArray:
    """Chi-square of one degree of freedom with the same tail probability as one of `degrees`."""
    if degrees == 1:
        return np.asarray(chi_square)
    from scipy.special import chdtrc, chdtri, gammaln

    chi_square = np.asarray(chi_square, dtype=np.float64)
    half, x = 0.5 * degrees, np.maximum(chi_square, 1e-12)
    # far out, where tail probabilities leave double precision: leading terms of both tails' expansions
    tail = -0.5 * x + (half - 1.0) * np.log(0.5 * x) - gammaln(half) + np.log1p((half - 1.0) / np.maximum(0.5 * x, 1.0))
    far = np.maximum(-2.0 * tail, 1.0)
    for _ in range(4):
        far = np.maximum(-2.0 * tail - np.log(0.5 * np.pi * far), 1.0)
    near = chdtri(1.0, np.maximum(chdtrc(float(degrees), np.minimum(x, FAR)), 1e-300))
    return np.asarray(np.where(x > FAR, far, near))


class _Prepared:
    """Fourier transforms of what stays the same for all candidates; single precision is plenty for a score."""

    def __init__(self, rows: Rows, n: int) -> None:
        from scipy import fft

        self._fft, self._n, self._polynomial = fft, n, rows.polynomial
        against = np.concatenate([rows.response[None, :], rows.taken]).astype(np.float32)
        self._against = np.conj(fft.rfft(against, axis=1))
        self._weight = np.conj(fft.rfft(rows.weight.astype(np.float32)))
        power = np.square(np.abs(np.fft.rfft(rows.white)))
        self._power = power / max(float(power[1:].mean()), 1e-30)
        self._valid_share = float(np.mean(rows.white != 0.0))
        index = np.arange(len(power))
        half = np.maximum(SMOOTHING[0], (SMOOTHING[1] * index).astype(np.intp))
        self._low, self._high = np.maximum(index - half, 1), np.minimum(index + half, len(power) - 1)
        self._width = self._high + 1 - self._low
        self._gain = np.square(np.abs(fft.rfft(rows.polynomial, n)))

    def chi_square(self, answer: FloatArray, transform: ComplexArray) -> FloatArray:
        """Chi-square of the answer moved by 0..n-1 samples to the right, shape (n,); index -1 is one to the left."""
        fft, n = self._fft, self._n
        white = self._filtered(answer)
        if answer.shape[1] > 1:
            mix = _decorrelating(white)
            white, transform = white @ mix, (mix.T @ transform).astype(transform.dtype)
        squares = np.ascontiguousarray(white.T**2, dtype=np.float32)
        powers = fft.irfft(self._weight * fft.rfft(squares, axis=1), n, axis=1)
        total = np.zeros(n)
        for column, power in zip(transform, powers, strict=True):
            # conj(F g) F x is the correlation sum_t g(t) x(t + s); moving right by L is s = -L
            products = fft.irfft(self._against * column, n, axis=1)
            left = power - np.square(products[1:]).sum(axis=0)
            total += products[0] ** 2 / np.maximum(left, SMALLEST_SHARE * power.mean())
        return np.concatenate([total[:1], total[:0:-1]])

    def calibration(self, transform: ComplexArray) -> Calibration:
        """Weigh the rows' smoothed spectrum with the candidate's."""
        power = np.square(np.abs(transform)).sum(axis=0) * self._gain
        power[0] = 0.0
        share = power / max(float(power.sum()), 1e-30)
        # transpose of the smoothing: the weight that every single frequency of the rows has in the mean
        spread = np.zeros(len(share) + 1)
        np.add.at(spread, self._low, share / self._width)
        np.add.at(spread, self._high + 1, -share / self._width)
        weight = np.cumsum(spread)[:-1]
        typical = float(np.clip(weight @ self._power, *TYPICAL_RANGE))
        return Calibration(typical, 2.0 / float(weight @ weight), 0.5 * float(weight @ share) / self._valid_share)

    def _filtered(self, answer: FloatArray) -> FloatArray:
        memory = len(self._polynomial) - 1
        if memory == 0:
            return np.asarray(answer * self._polynomial[0], dtype=np.float64)
        wrapped = np.concatenate([answer[-memory:], answer])
        return moving_sum(self._polynomial, wrapped)[memory:]


def _decorrelating(white: FloatArray) -> FloatArray:
    """Mix of the components that is uncorrelated once whitened, shape (k, k)."""
    gram = white.T @ white / len(white)
    gram[np.diag_indices(len(gram))] += 1e-9 * max(float(np.trace(gram)), 1e-12)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(gram)).T)
