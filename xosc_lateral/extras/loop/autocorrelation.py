"""The movement that no effect explains as an autoregression, and whitening by it, for generalised least squares.

A heterogeneous autoregression [1]_: the last seconds one by one, and the means of longer and longer stretches before
them. It knows drifts of a minute with few parameters. Whitening is exact within each run: the first rows use the
lower-order predictors of the same process (the Levinson recursion stepped down [2]_), and runs are independent.

References
----------
.. [1] F. Corsi, "A simple approximate long-memory model of realized volatility", J. Financial Econometrics 7, 2009.
.. [2] P. Brockwell, R. Davis, "Time Series: Theory and Methods", 1991, section 5.2.
.. [3] C. Gourieroux, P. Phillips, J. Yu, "Indirect inference for dynamic panel models", J. Econometrics 157, 2010.
.. [4] A. C. Aitken, "On least squares and linear combination of observations", Proc. R. Soc. Edinburgh 55, 1936.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray, IntArray, true_slices

MAX_REFLECTION = 0.999  # Reflection coefficients are kept inside the unit circle: the process is stationary. [-]
ENOUGH_ROWS = 0.5  # The memory is the longest for which this share of the rows has so much past in its own run. [-]
# Fewer rows than this per coefficient shorten the memory; with 40 the same is named (laboratory.loop_ablation). [-]
ROWS_PER_COEFFICIENT = 20
START_ROWS = 10.0  # First rows of runs have errors of their own as far as there are more of them than this.
# Simulated tables that tell the bias of short drives: their scatter adds an eighth to the fit's own variance.
BIAS_DRAWS = 4
BIAS_SEED = 0  # The same numbers each time: fits with and without a term differ by the term alone.


@dataclass(frozen=True, eq=False)
class MovementProcess:
    """x_t = sum_k a_k x_{t-k} + sd * white."""

    # Coefficients of the best predictors from 0, 1, ... p past values; the last one is the process itself.
    lags: tuple[FloatArray, ...]
    deviations: FloatArray  # shape (p + 1,): Standard deviation of each predictor's error.

    @property
    def order(self) -> int:
        """Number of past values, p."""
        return len(self.lags) - 1

    @property
    def polynomial(self) -> FloatArray:
        """(1, -a_1, ..., -a_p) / sd, shape (p + 1,): turns the process into white noise of variance 1. [1/m]"""
        return np.asarray(np.concatenate([[1.0], -self.lags[-1]]) / self.deviations[-1], dtype=np.float64)

    @cached_property
    def start(self) -> FloatArray:
        """Whitening of the first p rows of a run, lower triangular, shape (p, p). [1/m]"""
        matrix = np.zeros((self.order, self.order))
        for row, lags in enumerate(self.lags[:-1]):
            matrix[row, : row + 1] = np.append(-lags[::-1], 1.0) / self.deviations[row]
        return matrix

    def simulate(self, n: int, rng: np.random.Generator, *, runs: int = 1) -> FloatArray:
        """Stationary sample paths, shape (runs, n). [m]"""
        from scipy.signal import lfilter

        warm = 20 * self.order + 200
        return np.asarray(lfilter([1.0], self.polynomial, rng.normal(size=(runs, n + warm)), axis=1)[:, warm:])


def positions_in_run(valid: BoolArray) -> IndexArray:
    """How many valid rows in a row came before each row, shape (n,); -1 where invalid. [-]"""
    rows = np.arange(len(valid))
    start = np.where(valid & ~np.concatenate([[False], valid[:-1]]), rows, 0)
    return np.where(valid, rows - np.maximum.accumulate(start), -1)


def moving_sum(weights: FloatArray, values: FloatArray) -> FloatArray:
    """sum_k weights[k] values[t - k], zeros before the start; shape and precision of `values`, (n,) or (n, k)."""
    from scipy.signal import oaconvolve

    weights = weights.astype(values.dtype)
    if values.ndim == 2 and values.shape[1] == 0:
        return np.zeros(values.shape)
    if len(weights) > 16 and len(values) > len(weights):
        series = np.ascontiguousarray(np.atleast_2d(values.T))
        return np.asarray(oaconvolve(series, weights[None], axes=1)[:, : len(values)].T.reshape(values.shape))
    result = weights[0] * values
    for lag, weight in enumerate(weights[1:], start=1):
        result[lag:] += weight * values[:-lag]
    return np.asarray(result)


def fit_autoregression(
    values: FloatArray, valid: BoolArray, order: int, *, longest: int | None = None, noise: float = 0.0
) -> MovementProcess:
    """Least squares over rows that have the whole memory in their run: `order` past values, means of doubling stretches
    up to `longest`, beside white `noise` of a standard deviation, which is a ridge."""
    position = positions_in_run(valid)
    rows_in_all = max(1, int(valid.sum()))
    order = max(1, order)
    while order > 1 and (position >= order).sum() < max(ROWS_PER_COEFFICIENT * order, 0.25 * rows_in_all):
        order -= 1
    edges = [order]
    while longest is not None and 2 * edges[-1] <= longest:
        if (position >= 2 * edges[-1]).sum() < ENOUGH_ROWS * rows_in_all:
            break
        edges.append(2 * edges[-1])
    rows = np.flatnonzero(position >= edges[-1])
    if len(rows) < 2 * order:
        return MovementProcess((np.zeros(0),), np.array([max(float(np.std(values[valid])), 1e-150)]))
    sums = np.concatenate([[0.0], np.cumsum(np.where(valid, values, 0.0))])
    past = [values[rows - lag] for lag in range(1, order + 1)]
    past += [(sums[rows - low] - sums[rows - high]) / (high - low) for low, high in pairwise(edges)]
    lengths: IntArray = np.diff(edges)
    design, now = np.stack(past, axis=1), values[rows]
    # the variance of that noise in each past value or mean
    shares = noise**2 / np.concatenate([np.ones(order), lengths.astype(np.float64)])
    gram = design.T @ design
    gram[np.diag_indices(len(gram))] *= 1.0 + 1e-9
    gram[np.diag_indices(len(gram))] += float(len(rows)) * shares
    sizes = np.linalg.lstsq(gram, design.T @ now, rcond=None)[0]
    variance = float(np.mean((now - design @ sizes) ** 2)) * len(rows) / max(1, len(rows) - len(sizes))
    variance += noise**2 + float(shares @ sizes**2)
    lags = np.append(sizes[:order], np.repeat(sizes[order:] / lengths, lengths))
    return _stepped_down(lags, max(variance, 1e-300))


def _reflections(lags: FloatArray) -> FloatArray:
    """Reflection coefficients, first to last, kept inside the unit circle: the Levinson recursion backwards."""
    reflections = []
    current = lags.copy()
    for order in range(len(lags), 0, -1):
        last = float(np.clip(current[order - 1], -MAX_REFLECTION, MAX_REFLECTION))
        reflections.append(last)
        current = (current[: order - 1] + last * current[order - 2 :: -1][: order - 1]) / (1.0 - last**2)
    return np.array(reflections[::-1])


def _stepped_down(lags: FloatArray, variance: float) -> MovementProcess:
    """All lower-order predictors, forwards from safe reflections."""
    predictors: list[FloatArray] = [np.zeros(0)]
    shares = [1.0]
    for last in _reflections(lags):
        before = predictors[-1]
        predictors.append(np.concatenate([before - last * before[::-1], [last]]))
        shares.append(shares[-1] * (1.0 - last**2))
    return MovementProcess(tuple(predictors), np.sqrt(variance * np.asarray(shares) / shares[-1]))


def start_factors(rows: FloatArray, valid: BoolArray, order: int) -> FloatArray:
    """Factor on the errors of the first rows of runs, shape (order + 1,): a run begins where something ended, and its
    first whitened `rows` may be off by more than a stationary movement's."""
    position = positions_in_run(valid)
    early, late = (position >= 0) & (position < order), position >= order
    usual = float(np.mean(rows[late] ** 2)) if late.any() else 1.0
    if usual <= 0.0:  # nothing moves
        return np.ones(order + 1)
    squares = np.bincount(position[early], rows[early] ** 2, minlength=order)
    count = np.bincount(position[early], minlength=order)
    factors = np.ones(order + 1)
    edges = [0, *(2**power for power in range(order.bit_length()) if 2**power < order), order]
    for low, high in pairwise(edges):
        mean = (squares[low:high].sum() + START_ROWS * usual) / (count[low:high].sum() + START_ROWS)
        factors[low:high] = np.sqrt(mean / usual)
    return factors


def unbiased(
    process: MovementProcess, valid: BoolArray, drive: IndexArray, order: int, *, longest: int | None = None
) -> MovementProcess:
    """A process freed of what each short drive's level does to it (Nickell's bias, an eighth of an error) [3]_."""
    if process.order == 0 or np.abs(_reflections(process.lags[-1])).max() >= (1.0 - 1e-9) * MAX_REFLECTION:
        return process  # at the edge of what is stationary, runs of it would grow without end
    rng = np.random.default_rng(BIAS_SEED)
    lags, log_variance = np.zeros(process.order), 0.0
    whitener = Whitener(process, valid, drive, np.ones(len(valid)))
    for simulated in process.simulate(len(valid), rng, runs=BIAS_DRAWS):
        left = np.where(valid, simulated - whitener.levels(simulated)[drive], 0.0)
        again = fit_autoregression(left, valid, order, longest=longest)
        if again.order != process.order:
            return process
        lags += again.lags[-1] / BIAS_DRAWS
        log_variance += 2.0 * float(np.log(again.deviations[-1])) / BIAS_DRAWS
    fitted = 2.0 * float(np.log(process.deviations[-1]))
    for share in (1.0, 0.5, 0.25):
        better = process.lags[-1] + share * (process.lags[-1] - lags)
        if np.abs(_reflections(better)).max() < MAX_REFLECTION:
            return _stepped_down(better, float(np.exp(fitted + share * (fitted - log_variance))))
    return process


@dataclass(frozen=True, eq=False)
class Whitener:
    """Turns series on the grid into independent rows of variance 1, the drives' own levels taken out."""

    process: MovementProcess  # Of the movement divided by `scale`.
    valid: BoolArray  # shape (n,)
    drive: IndexArray  # shape (n,): Which level a row has; increasing.
    scale: FloatArray  # shape (n,): Factor on the movement at each row.
    runs: tuple[slice, ...] = ()  # Rows of each run, where they stand side by side without anything invalid in between.

    @cached_property
    def compact(self) -> Whitener:
        """The same for the valid rows alone, put side by side: half the work where drives are short."""
        ends = np.cumsum([0, *(run.stop - run.start for run in self._runs)]).tolist()
        runs = tuple(slice(*edges) for edges in pairwise(ends))
        _, drive = np.unique(self.drive[self.valid], return_inverse=True)
        valid = np.ones(int(self.valid.sum()), dtype=np.bool_)
        return Whitener(self.process, valid, drive.astype(np.intp), self.scale[self.valid], runs)

    @cached_property
    def _runs(self) -> Sequence[slice]:
        return self.runs or true_slices(self.valid)

    @cached_property
    def _edges(self) -> IndexArray:
        return np.searchsorted(self.drive, np.arange(int(self.drive.max()) + 1)).astype(np.intp)

    def by_position(self, values: FloatArray) -> FloatArray:
        """What belongs to a row by its place in its run, shape (n,), from `values`, shape (order + 1,)."""
        return values[np.clip(positions_in_run(self.valid), 0, self.process.order)]

    @property
    def deviations(self) -> FloatArray:
        """What each row is divided by, predictor and scale, shape (n,). [m]"""
        return self.by_position(self.process.deviations) * self.scale

    @cached_property
    def ones(self) -> FloatArray:
        """A level of 1 m, whitened, shape (n,). [-]"""
        return self.white(np.ones(len(self.valid)))

    @cached_property
    def power(self) -> FloatArray:
        """What every drive tells of its level: 1 / variance, > 0, shape (drives,). [1/m2]"""
        return np.add.reduceat(self.ones**2, self._edges)

    def white(self, values: FloatArray, filtered: FloatArray | None = None) -> FloatArray:
        """Whitened, levels still in; 0 at invalid rows; shape and precision of `values`, (n,) or (n, k); `filtered`:
        what the process's polynomial makes of them amid runs."""
        columns = values[:, None] if values.ndim == 1 else values
        scale, start = (own.astype(columns.dtype) for own in (self.scale[:, None], self.process.start))
        if filtered is None:
            scaled = columns / scale
            filtered = moving_sum(
                self.process.polynomial, scaled if self.runs else np.where(self.valid[:, None], scaled, 0.0)
            )
        else:
            filtered = filtered / scale
        for run in self._runs:
            first = slice(run.start, min(run.stop, run.start + self.process.order))
            known = first.stop - first.start
            filtered[first] = start[:known, :known] @ (columns[first] / scale[first])
        if not self.runs:
            filtered[~self.valid] = 0.0
        return np.asarray(filtered.reshape(values.shape))

    def levels(self, values: FloatArray) -> FloatArray:
        """Level of every drive by generalised least squares, shape (drives,). [m]"""
        sums = np.add.reduceat(self.ones * self.white(values), self._edges)
        return np.asarray(sums / np.maximum(self.power, 1e-300))

    def rows(self, values: FloatArray, filtered: FloatArray | None = None) -> FloatArray:
        """Whitened, the drives' levels out; shape of `values` [m], (n,) or (n, k), the rows of variance 1. [-]"""
        columns = self.white(values[:, None] if values.ndim == 1 else values, filtered)
        ones, power = (of.astype(columns.dtype)[:, None] for of in (self.ones, np.maximum(self.power, 1e-30)))
        mean = np.add.reduceat(ones * columns, self._edges, axis=0) / power
        return np.asarray((columns - ones * mean[self.drive]).reshape(values.shape))

    def at_lags(self, values: FloatArray, lags: Sequence[int]) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Values, shape (n, k), so many rows later each, valid ones only, and the same white, levels out.

        Amid runs what is shifted is filtered once; drives are padded by more than any lag.
        """
        seconds, even = np.flatnonzero(self.valid), all(np.ptp(self.scale[run]) == 0.0 for run in self._runs)
        filtered = moving_sum(self.process.polynomial, values) if even else None
        for lag in lags:
            at = np.clip(seconds - lag, 0, len(values) - 1)
            moved = values[at]
            yield moved, self.compact.rows(moved, None if filtered is None else filtered[at])


@dataclass(frozen=True, eq=False)
class WhitenedRegression:
    """One linear regression, whitened: an ordinary one [4]_."""

    whitener: Whitener  # For series and columns.
    series: FloatArray  # shape (n,): With what the model has of this component still in.
    columns: FloatArray  # shape (n, k): What the model has already.

    @cached_property
    def observed(self) -> FloatArray:
        """White series, levels out, shape (seconds,), valid ones only. [-]"""
        return self.rows(self.series)

    @cached_property
    def known(self) -> FloatArray:
        """White columns, shape (seconds, k). [-]"""
        return self.rows(self.columns)

    def rows(self, values: FloatArray) -> FloatArray:
        """White rows [-] of series or columns, shape (n,) or (n, k); valid ones only."""
        return self.whitener.compact.rows(values[self.whitener.valid])
