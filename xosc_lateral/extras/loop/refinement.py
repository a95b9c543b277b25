"""From the dictionary's grid to the best lag, time constant and shape of one set of columns, in the same regression.

References
----------
.. [1] G. Schwarz, "Estimating the dimension of a model", Annals of Statistics 6, 1978.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.drivers.model.effects import ColumnEffect, Product
from xosc_lateral.drivers.model.effects.shapes import Form
from xosc_lateral.extras.loop.autocorrelation import WhitenedRegression
from xosc_lateral.extras.loop.candidates import FINE_SCALES, Candidate, Family, shapes_of
from xosc_lateral.extras.loop.columns import Column
from xosc_lateral.extras.loop.dictionary import LIKELIHOOD_MARGIN, beside, of_unit_variance, orthonormal
from xosc_lateral.extras.loop.timeline import COARSE, Coarse

Alternatives = tuple[tuple[str, ...], ...]  # Columns of each effect that explains as much.
Priced = tuple[ColumnEffect, float]  # An effect, and what its family and a finer choice within it take from its score.
# Standard errors by which the better of two has to be better: 5 %, one-sided; the better is known to be it. [-]
CLEAR_ERRORS = 1.645
RESPONSES = (0.3, 0.6, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)  # Time constants that are tried. [s]
# And in the end, a fifth apart: with a time constant half as long again the size is 15 % off. [s]
FINE_RESPONSES = tuple(np.round(np.geomspace(0.3, 8.0, 19), 2).tolist())
# Quantiles at which a number may turn the sign of another column's effect. [-]
CENTRES = tuple(np.round(np.arange(0.05, 0.96, 0.1), 2).tolist())
LAG_STEPS = (1.0, 0.4, 0.2)  # Lags are searched in steps that get finer. [s]
LAG_LIMIT = 5.0  # Longest lag either way. [s]


def explains_as_much(chosen: FloatArray, other: FloatArray, observed: FloatArray, cluster: IntArray) -> bool:
    """Whether squared residuals of two white regressions differ by no more than they scatter by cluster."""
    first, second = (
        np.square(observed - own @ np.linalg.lstsq(own, observed, rcond=None)[0]) for own in (chosen, other)
    )
    sums = np.bincount(np.unique(cluster, return_inverse=True)[1], second - first)
    return len(sums) < 2 or float(sums.sum()) <= CLEAR_ERRORS * float(np.sqrt(len(sums)) * np.std(sums, ddof=1))


@dataclass(frozen=True, eq=False)
class Refined:
    """One effect, refined, without coefficients."""

    effect: ColumnEffect
    score: float  # Squared, of all its coefficients, less log n for each beyond the first [1]_ and less its price.
    price: float  # Of its family, and of a finer choice within it than the dictionary has.


class Refinement:
    """Scores many effects at once beside all that is `known` (orthonormal, shape (seconds, k)).

    `slopes`: how strongly each effect acts in every drive, shape (drives,), where drives differ.
    """

    def __init__(
        self,
        coarse: Coarse,
        problem: WhitenedRegression,
        known: FloatArray,
        candidates: Sequence[Candidate],
        slopes: FloatArray | None = None,
    ) -> None:
        self._coarse, self._problem = coarse, problem
        self._costs = {candidate.family: candidate.cost for candidate in candidates}
        of_drives = np.ones(coarse.drives) if slopes is None else slopes
        self._slopes = of_drives[coarse.drive[problem.whitener.valid], None].astype(np.float32)
        self._basis = known.astype(np.float32)
        self._left = of_unit_variance(beside(known, problem.observed))
        self._quantities: dict[ColumnEffect, FloatArray] = {}
        self._responses: dict[tuple[ColumnEffect, float], FloatArray] = {}

    def refine(self, effect: ColumnEffect, price: float, columns: Mapping[str, Column]) -> Refined:
        """Shape, timing, shape again, timing again, each time in finer steps."""
        self._quantities.clear()  # of other columns
        self._responses.clear()
        shapes = list(self._shapes(effect, columns))
        best, scores = self._best(Refined(effect, self.scores([effect])[0] - price, price), shapes)
        near = np.flatnonzero(scores > best.score - LIKELIHOOD_MARGIN)
        for step in LAG_STEPS:
            responses = RESPONSES if step > LAG_STEPS[-1] else FINE_RESPONSES
            distance = np.abs(np.log(np.array(responses) / max(best.effect.response_s, 0.1)))
            about = [responses[index] for index in np.argsort(distance, kind="stable")[:5]]
            lags = [round(float(lag), 1) for lag in lags_about(best.effect.lag_s, 2.0 * step, step)]
            timings = (structs.replace(best.effect, lag_s=lag, response_s=late) for lag in lags for late in about)
            best, _ = self._best(best, [(timed, best.price) for timed in timings])
        shapes = list(self._shapes(best.effect, columns))
        return self._best(best, shapes if isinstance(effect, Product) else [shapes[at] for at in near])[0]

    def scores(self, effects: Sequence[ColumnEffect]) -> list[float]:
        """Squared score of each effect, all its coefficients free, less log n for each beyond the first."""
        responses = [self._response(effect) for effect in effects]
        ends = np.cumsum([response.shape[1] for response in responses])
        rows = np.split(self._rows(np.concatenate(responses, axis=1)), ends[:-1], axis=1)
        return [self._score(own.astype(np.float64)) for own in rows]

    def as_good(self, chosen: ColumnEffect, other: ColumnEffect) -> bool:
        """Whether another effect would explain as much, as far as the rows can tell."""
        first, second = (self._rows(self._response(effect)).astype(np.float64) for effect in (chosen, other))
        return explains_as_much(first, second, self._left, self._coarse.cluster[self._problem.whitener.valid])

    def _rows(self, responses: FloatArray) -> FloatArray:
        """White, beside what is known; in single precision, which tells responses apart as well in half the time."""
        rows = self._slopes * self._problem.rows(responses.astype(np.float32))
        rows -= self._basis @ (self._basis.T @ rows)
        return rows

    def _score(self, rows: FloatArray) -> float:
        sizes = np.linalg.norm(rows, axis=0)
        if not np.isfinite(sizes).all() or float(sizes.min()) < 1e-6:
            return -np.inf
        unit = rows / sizes
        if unit.shape[1] > 1:
            unit = orthonormal(unit, 1e-6)
        return float(np.square(unit.T @ self._left).sum() - (rows.shape[1] - 1) * np.log(len(self._left)))

    def _response(self, effect: ColumnEffect) -> FloatArray:
        """Response at 1 Hz, standardised, shape (n, k), by the fine grid: at 1 Hz a lag is another filter."""
        timeline, shape = self._coarse.timeline, structs.replace(effect, lag_s=0.0, response_s=0.0)
        if shape not in self._quantities:
            values = self._coarse.fine_response(shape)
            inside = values[timeline.valid]
            self._quantities[shape] = (values - inside.mean(axis=0)) / np.maximum(inside.std(axis=0), 1e-12)
        key = (shape, effect.response_s)
        if key not in self._responses:
            self._responses[key] = running_sums(self._coarse, self._quantities[shape], effect.response_s)
        return means_by_second(self._responses[key], round(effect.lag_s / timeline.step))

    def _best(self, best: Refined, others: Sequence[Priced]) -> tuple[Refined, FloatArray]:
        """The best so far or a better one, and the scores of the others, less their prices."""
        if not others:
            return best, np.zeros(0)
        scores = np.asarray(self.scores([effect for effect, _ in others])) - [price for _, price in others]
        at = int(np.argmax(scores))
        return (Refined(others[at][0], float(scores[at]), others[at][1]) if scores[at] > best.score else best), scores

    def _shapes(self, effect: ColumnEffect, columns: Mapping[str, Column]) -> Iterator[Priced]:
        """Other shapes of a column, scales and centres of a product, with their prices: a finer choice costs more."""
        if isinstance(effect, Product):
            others = [*other_scales(effect, FINE_SCALES), *other_centres(effect, self._coarse)]
            price = self._costs.get(Family.PRODUCT, 0.0) + 2.0 * float(np.log(max(1, len(others))))
            yield from ((other, price) for other in others)
            return
        column = columns[effect.columns[0]]
        seen = self._coarse.context[column.name][self._coarse.timeline.valid]
        plain, bent, finer = shapes_of(column, seen, curves=True)
        price = self._costs.get(Family.PLAIN, 0.0)
        bent_price = self._costs.get(Family.BENT, price) + 2.0 * float(np.log(max(1.0, finer)))
        for shapes, cost in ((plain, price), (bent, bent_price)):
            yield from (
                (structs.replace(shape, lag_s=effect.lag_s, response_s=effect.response_s), cost) for shape in shapes
            )


def lags_about(lag_s: float, reach: float, step: float) -> FloatArray:
    """Lags within a reach of one, none beyond the longest. [s]"""
    lags = lag_s + np.arange(-reach, reach + 0.5 * step, step)
    return np.asarray(lags[np.abs(lags) <= LAG_LIMIT])


def running_sums(coarse: Coarse, quantity: FloatArray, response_s: float) -> FloatArray:
    """Of the response to a quantity on the fine grid, shape (fine n, k), from zero on: shape (fine n + 1, k)."""
    response = coarse.timeline.respond(quantity, 0.0, response_s)
    sums = np.zeros((len(response) + 1, response.shape[1]))
    np.cumsum(response, axis=0, out=sums[1:])
    return sums


def means_by_second(sums: FloatArray, late: int) -> FloatArray:
    """Means over each second of a series that comes `late` samples later, from its running sums; the ends stay."""
    last = len(sums) - 1
    first = np.arange(0, last - COARSE + 1, COARSE)
    start, stop = (np.clip(first + more - late, 0, last) for more in (0, COARSE))
    return np.asarray((sums[stop] - sums[start]) / np.maximum(stop - start, 1)[:, None])


def other_scales(effect: Product, shares: Sequence[float]) -> Iterator[Product]:
    """The same product with one of its proximities fading over a share of its distance."""
    for index, factor in enumerate(effect.factors):
        if factor.form is Form.PROXIMITY:
            yield from (_with(effect, index, factor.at * share) for share in shares)


def other_centres(effect: Product, coarse: Coarse) -> Iterator[Product]:
    """The same product, where one of its numbers turns the sign of the other's effect elsewhere than at its median."""
    for index, factor in enumerate(effect.factors):
        if factor.form is Form.VALUE and factor.at != 0.0:  # 0: its natural zero
            seen = coarse.context[factor.column][coarse.timeline.valid]
            centres = np.unique(np.quantile(seen[np.isfinite(seen)], CENTRES))
            yield from (_with(effect, index, float(centre)) for centre in centres)


def _with(effect: Product, index: int, at: float) -> Product:
    first, second = (structs.replace(own, at=at) if k == index else own for k, own in enumerate(effect.factors))
    return structs.replace(effect, factors=(first, second))
