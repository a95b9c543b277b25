"""All candidates as whitened rows of length one, their scores, and what chance gives.

References
----------
.. [1] C. R. Rao, "Large sample tests of statistical hypotheses concerning several parameters with applications to
       problems of estimation", Proc. Cambridge Philosophical Society 44, 1948: scores, fitted under the null alone.
.. [2] H. White, "A heteroskedasticity-consistent covariance matrix estimator", Econometrica 48, 1980.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray
from xosc_lateral.base.grouping import grouped
from xosc_lateral.drivers.model.effects import ColumnEffect, Product
from xosc_lateral.extras.loop.autocorrelation import Whitener
from xosc_lateral.extras.loop.candidates import Candidate, Family, candidates_of
from xosc_lateral.extras.loop.columns import Column
from xosc_lateral.extras.loop.significance import as_one_degree
from xosc_lateral.extras.loop.timeline import Coarse, Timeline, coarse_mean, coarse_middle, start_anew

SingleArray = NDArray[np.float32]
Reals = NDArray[np.floating[Any]]
# Lags tried first, by time constant; refined later. What is smoothed by 4 s differs little from one second to the next.
# [s]
TIMINGS: Mapping[float, tuple[int, ...]] = {1.0: (-3, -2, -1, 0, 1, 2), 4.0: (-4, -2, 0, 2)}
# The same for products, of which there are many more. [s]
PRODUCT_TIMINGS: Mapping[float, tuple[int, ...]] = {2.0: (-2, -1, 0, 1)}
# A quantity that rests on fewer seconds than this is not tested: anything may have happened just then. [s]
MIN_SUPPORT_S = 45.0
LIKELIHOOD_MARGIN = 12.0  # Sets of columns that score lower than the best by more than this are not looked at. [-]
LEFT_OVER = 0.05  # A candidate of which less than this share is left beside what is known is not tested. [-]
# Directions of a column's cross-basis with less than this share of the largest variance are left in. [-]
CROSS_BASIS = 0.01
ROBUST_ENTRIES = 200  # Entries whose scores are set beside the squares of their own rows: those that may be the best.
# Of one column's entries, the best so many stand for all that it may do; more of them span hardly more.
RESPONSE_ENTRIES = 12
CHUNK_CANDIDATES = 48  # Candidates that are whitened at once: few enough to stay in a processor's cache.
# A factor of a product that keeps less than this share of its variance within drives tells drives apart, unless so many
# drives are on either side. [-]
LEFT_WITHIN, FEWEST_A_SIDE = 0.1, 5
LEAST_POWER = 1e-30  # Keeps single precision from dividing by zero.


@dataclass(frozen=True, eq=False)
class Quantities:
    """Candidates on the 1 Hz grid before lag and response, standardised, shape (candidates, n); `drive`, shape (n,)."""

    candidates: list[Candidate]
    values: SingleArray
    drive: IndexArray

    @classmethod
    def of(
        cls, candidates: Sequence[Candidate], timeline: Timeline, context: Mapping[str, FloatArray], valid: BoolArray
    ) -> Quantities:
        """Evaluate all; those that never vary on valid seconds are left out."""
        kept, rows = [], []
        for candidate in candidates:
            quantity = timeline.held(candidate.values(context)[:, None], candidate.effect.episode)[:, 0]
            there = quantity[timeline.valid & np.isfinite(quantity)]
            # what is unknown takes the mean of what is known and valid
            second = coarse_mean(np.where(np.isnan(quantity), there.mean() if len(there) else 0.0, quantity))
            deviation = float(second[valid].std())
            # beside all that it ever is: a product may be zero but for rounding wherever the car follows the road
            if deviation > 1e-9 * max(float(np.abs(second).max()), 1e-300):
                kept.append(candidate)
                rows.append(((second - second[valid].mean()) / deviation).astype(np.float32))
        stacked = np.stack(rows) if rows else np.zeros((0, len(valid)), dtype=np.float32)
        return cls(kept, stacked, coarse_middle(timeline.drive)[: len(valid)])

    def responses(self, members: IndexArray, response_s: float) -> FloatArray:
        """Some of them through a first-order lag, each drive on its own, shape (n, members)."""
        return respond_by_second(self.values[members].T, response_s, self.drive)


@dataclass(frozen=True, eq=False)
class Dictionary:
    """Whitened candidates at every lag and response."""

    candidates: list[Candidate]  # One per entry.
    lag: FloatArray  # shape (entries,): [s]
    response: FloatArray  # shape (entries,): [s]
    rows: SingleArray  # shape (entries, seconds): Length one each; valid seconds only.

    @cached_property
    def costs(self) -> FloatArray:
        """Of the entries."""
        return np.array([candidate.cost for candidate in self.candidates])

    def __len__(self) -> int:
        return len(self.candidates)

    def timed(self, index: int) -> ColumnEffect:
        """An entry's effect with its lag and response."""
        effect = self.candidates[index].effect
        return structs.replace(effect, lag_s=float(self.lag[index]), response_s=float(self.response[index]))


def tells_drives(values: FloatArray, coarse: Coarse) -> bool:
    """Whether values, shape (fine n,), say little but which drive it is: they hardly change within drives, and too few
    drives are on either side."""
    if coarse.drives == 1:
        return False
    inside, drive = coarse.timeline.valid, coarse.timeline.drive
    seen, of_drive = np.nan_to_num(values[inside], nan=0.0, posinf=0.0, neginf=0.0), drive[inside]
    rows = np.bincount(of_drive, minlength=coarse.drives)
    usual = np.bincount(of_drive, seen, minlength=coarse.drives) / np.maximum(rows, 1)
    there = usual[rows > 0]
    high = int(np.sum(there > 0.5 * (there.min() + there.max())))
    few = min(high, len(there) - high) < FEWEST_A_SIDE
    return few and float(np.mean(np.square(seen - usual[of_drive]))) < LEFT_WITHIN * float(seen.var())


def build_dictionary(quantities: Quantities, whitener: Whitener) -> Dictionary:
    """Pass every candidate through every response and lag, and whiten it; those left that rest on enough seconds."""
    entries: list[tuple[Candidate, float, float]] = []
    single = np.array([len(candidate.columns) == 1 for candidate in quantities.candidates], dtype=np.bool_)
    grids = ((np.flatnonzero(single), TIMINGS), (np.flatnonzero(~single), PRODUCT_TIMINGS))
    most = sum(len(members) * sum(map(len, grid.values())) for members, grid in grids)
    table = np.empty((most, int(whitener.valid.sum())), dtype=np.float32)  # what is not written takes no memory
    for members, grid in grids:
        for first in range(0, len(members), CHUNK_CANDIDATES):
            chunk = members[first : first + CHUNK_CANDIDATES]
            for response_s, lags in grid.items():
                response = quantities.responses(chunk, response_s)
                for lag, (moved, rows) in zip(lags, whitener.at_lags(response, lags), strict=True):
                    squares = np.square(rows)
                    power = squares.sum(axis=0)
                    support = power**2 / np.maximum(np.square(squares).sum(axis=0), LEAST_POWER)
                    varies = power > 1e-9 * np.maximum(np.square(moved).sum(axis=0), LEAST_POWER)  # within drives
                    kept = np.flatnonzero(varies & (support >= MIN_SUPPORT_S))
                    unit = rows[:, kept] / np.sqrt(np.maximum(power[kept], LEAST_POWER))
                    table[len(entries) : len(entries) + len(kept)] = unit.T
                    entries += [(quantities.candidates[chunk[i]], float(lag), response_s) for i in kept]
    timings = np.array([entry[1:] for entry in entries]).reshape(-1, 2)
    return Dictionary([entry[0] for entry in entries], timings[:, 0], timings[:, 1], table[: len(entries)])


def respond_by_second(values: Reals, response_s: float, drive: IndexArray) -> FloatArray:
    """Means over each second of a first-order lag of gain 1, settled where a drive starts; shape (n, k)."""
    from scipy.signal import lfilter

    keep = float(np.exp(-1.0 / response_s))
    late = response_s * (1.0 - keep)
    later, earlier = np.array([[1.0 - late, late - keep], [1.0, -keep]], dtype=values.dtype)
    return start_anew(lfilter(later, earlier, values, axis=0, zi=late * values[:1])[0], values, keep, drive)


def score_entries(
    dictionary: Dictionary,
    left: FloatArray,
    known: FloatArray,
    barred: BoolArray,
    null: FloatArray,
    *,
    of_mean: bool,
) -> tuple[FloatArray, FloatArray]:
    """Squared score of every entry less its cost, -inf if barred, and the largest of each of the `null`'s residuals;
    beside `known`, orthonormal columns. Loudness where entries act is evidence of a spread, not of a mean."""
    rotated = np.concatenate([left[:, None], null], axis=1)
    rotated = beside(known, rotated).astype(np.float32)
    basis = known.astype(np.float32)
    squared = np.empty((len(dictionary), rotated.shape[1]), dtype=np.float32)
    rest = np.empty(len(dictionary))
    for first in range(0, len(dictionary), 2048):
        part = slice(first, first + 2048)
        rows = dictionary.rows[part]
        squared[part] = np.square(rows @ rotated)
        rest[part] = 1.0 - np.square(rows @ basis).sum(axis=1) if basis.shape[1] else 1.0
    usable = ~barred & (rest > LEFT_OVER)
    squared = squared / np.maximum(rest, LEFT_OVER).astype(np.float32)[:, None]
    squared -= dictionary.costs.astype(np.float32)[:, None]
    squared[~usable] = -np.inf
    largest = squared.max(axis=0).astype(np.float64)
    scores = squared[:, 0].astype(np.float64)
    if of_mean:
        scores = _beside_loud_stretches(scores, dictionary, left, basis)
    return scores, largest[1:] if np.isfinite(largest).all() else np.zeros(0)


def _beside_loud_stretches(
    scores: FloatArray, dictionary: Dictionary, left: FloatArray, basis: SingleArray
) -> FloatArray:
    """Scores of the best entries by the squares of their own rows [2]_: the null loses where they are large."""
    order = np.argsort(-scores)[:ROBUST_ENTRIES]
    order = order[np.isfinite(scores[order])]
    rows = dictionary.rows[order].astype(np.float64)
    rows -= (rows @ basis) @ basis.T
    columns = [frozenset(dictionary.candidates[index].effect.columns) for index in order]
    rest = np.empty_like(rows)
    for read in set(columns):  # what some response to the same columns explains is not loudness
        alike = [k for k, others in enumerate(columns) if others <= read or read <= others][:RESPONSE_ENTRIES]
        rest[[others == read for others in columns]] = beside(orthonormal(rows[alike].T), left)
    robust, costs = scores.copy(), dictionary.costs[order]
    robust[order] = (scores[order] + costs) / _loudness(rows, rest, left) - costs
    return robust


def _loudness(rows: FloatArray, rest: FloatArray, left: FloatArray) -> FloatArray:
    """Mean square, at least 1, of what is left where entries act, shape (entries,); `rest` as their rows, or one."""
    weights = np.square(rows) / np.maximum(np.square(rows).sum(axis=1), LEAST_POWER)[:, None]
    # of few rows it is a rough estimate: what counts is what is sure of it, two standard errors less
    kurtosis = float(np.mean(left**4) / np.mean(left**2) ** 2)
    sure = 1.0 + 2.0 * np.sqrt((kurtosis - 1.0) * np.square(weights).sum(axis=1))
    return np.asarray(np.maximum((weights * np.square(rest)).sum(axis=1) / sure, 1.0))


def beside_parts(
    scores: FloatArray,
    dictionary: Dictionary,
    left: FloatArray,
    known: FloatArray,
    spans: Callable[[str], FloatArray],
    by_drive: Callable[[str], FloatArray],
    margin: float = LIKELIHOOD_MARGIN,
) -> FloatArray:
    """Scores of products, where less, beside all that either column does alone (`spans`); no vector's components. None
    that explains less than slopes of each drive's own (`by_drive`) would: it would stand for which drive it is. What is
    below the best by more than a `margin` stays as it is."""
    known_scores = ((index, dictionary.candidates[index]) for index in np.flatnonzero(np.isfinite(scores)).tolist())
    members = grouped((one.columns, index) for index, one in known_scores if len(one.columns) > 1 and not one.of_vector)
    scores, best = scores.copy(), {pair: float(scores[entries].max()) for pair, entries in members.items()}
    for pair in sorted(members, key=best.__getitem__, reverse=True):
        if best[pair] < float(scores.max()) - margin:
            break
        entries = members[pair]
        span = orthonormal(np.concatenate([known, *(spans(column) for column in pair)], axis=1), CROSS_BASIS)
        rows = beside(span, dictionary.rows[entries].astype(np.float64).T)
        power = np.square(rows).sum(axis=0)
        rest = beside(span, left)
        gains = np.square(rest @ rows) / np.maximum(power, LEAST_POWER)
        # what is left is louder in a bend, say, and there the product has its rows once the columns' own are out
        best_rows = rows[:, np.argsort(-gains)[:RESPONSE_ENTRIES]]
        unexplained = of_unit_variance(beside(orthonormal(best_rows), rest))
        gains = gains / _loudness(rows.T, unexplained, left) - dictionary.costs[entries]
        slopes = [orthonormal(beside(span, by_drive(column)), CROSS_BASIS) for column in pair]
        rivals = [as_one_degree(float(np.sum(np.square(rest @ one))), one.shape[1]) for one in slopes if one.shape[1]]
        usable = (power > LEFT_OVER) & (gains > max(map(float, rivals), default=-np.inf))
        scores[entries] = np.where(usable, np.minimum(scores[entries], gains), -np.inf)
    return scores


def orthonormal(columns: FloatArray, share: float = 1e-6) -> FloatArray:
    """Orthonormal basis of what holds all but a share of the columns' largest variance, shape (n, rank)."""
    if columns.shape[1] == 0:
        return columns
    # by the Gram matrix: few columns of many rows, for which a singular value decomposition takes ten times as long
    powers, directions = np.linalg.eigh(columns.T @ columns)
    kept = powers > share * max(float(powers[-1]), 1e-300)
    return np.asarray(columns @ (directions[:, kept] / np.sqrt(powers[kept])))


def of_unit_variance(rows: FloatArray) -> FloatArray:
    """Rows about zero, shape (n,), over their root mean square. [-]"""
    return np.asarray(rows / max(float(np.sqrt(np.mean(rows**2))), 1e-300))


def beside(basis: FloatArray, rows: FloatArray) -> FloatArray:
    """Rows, shape (n,) or (n, k), without what an orthonormal basis, shape (n, rank), explains of them."""
    return np.asarray(rows - basis @ (basis.T @ rows))


@dataclass(frozen=True, eq=False)
class Search:
    """What stays the same while terms are selected: columns, candidates before whitening, random streams."""

    coarse: Coarse
    columns: Mapping[str, Column]  # That may act.
    quantities: Quantities
    seed: np.random.SeedSequence
    levels: Mapping[str, float]  # Family-wise p-value up to which the best of each component counts as found.
    progress: Callable[[str], object]  # Gets what is being done, in a few words.
    # How many terms a component has in the table that this is a part of: so many are added, best first, whatever their
    # p-values, and components that have none are not tested. None: this is the table.
    wanted: Mapping[str, int] | None = None
    # What tests of terms gave, by kind and terms fitted; a search in the same part has the same.
    tested: dict[tuple[object, tuple[object, ...]], Any] = field(default_factory=dict, repr=False)
    _kept: dict[tuple[object, object], Any] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def over(
        cls,
        coarse: Coarse,
        columns: list[Column],
        seed: np.random.SeedSequence,
        levels: Mapping[str, float],
        progress: Callable[[str], None] = lambda _: None,
    ) -> Search:
        """Evaluate all candidates once."""
        inside = coarse.timeline.valid
        every = candidates_of(columns, {column.name: coarse.context[column.name][inside] for column in columns})
        factors = {factor for one in every if isinstance(one.effect, Product) for factor in one.effect.factors}
        barred = {factor for factor in factors if tells_drives(factor.values(coarse.context), coarse)}
        candidates = [
            one for one in every if not isinstance(one.effect, Product) or barred.isdisjoint(one.effect.factors)
        ]
        quantities = Quantities.of(candidates, coarse.timeline, coarse.context, coarse.valid)
        return cls(coarse, {column.name: column for column in columns}, quantities, seed, levels, progress)

    def plain_candidates(self) -> list[Candidate]:
        """Columns as they are, of one component each."""
        candidates = self.quantities.candidates
        return [one for one in candidates if one.family is Family.PLAIN and len(one.contrast) == 1]

    def once(self, kind: object, fitted: object, make: Callable[[], Any]) -> Any:
        """What is worked out once for one kind of term beside one fit; the last is kept, of tens of megabytes."""
        if (kind, fitted) not in self._kept:
            self.forget()
            self._kept[kind, fitted] = make()
        return self._kept[kind, fitted]

    def forget(self) -> None:
        """What is kept would stay with whoever refers to this search."""
        self._kept.clear()

    def cross_basis(self, columns: Collection[str]) -> FloatArray:
        """What columns can do in any shape, at any lag and response, at 1 Hz, orthonormal, shape (n, rank)."""
        known = frozenset(columns)
        members = np.array([known.issuperset(one.columns) for one in self.quantities.candidates], dtype=np.bool_)
        seconds, valid = np.arange(len(self.coarse)), self.coarse.valid[:, None]
        blocks = []
        for response_s, lags in TIMINGS.items():
            response = self.quantities.responses(np.flatnonzero(members), response_s)
            blocks += [response[np.clip(seconds - lag, 0, len(seconds) - 1)] * valid for lag in lags]
        return orthonormal(np.concatenate(blocks, axis=1).astype(np.float64), CROSS_BASIS)
