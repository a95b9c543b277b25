"""From the dictionary's grid to the best lag, time constant and shape of one set of columns, in the same regression."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from xosc_lateral.driver.effects import ColumnEffect, Linear, Piecewise, Product, Proximity, Saturating, Threshold
from xosc_lateral.driver.effects.product import Form
from xosc_lateral.driver.effects.response import respond
from xosc_lateral.identification.candidates import shapes_of
from xosc_lateral.identification.columns import Column, Role
from xosc_lateral.identification.dictionary import orthonormal
from xosc_lateral.identification.problem import Problem
from xosc_lateral.identification.regression import Coarse
from xosc_lateral.identification.timeline import COARSE

FloatArray = NDArray[np.float64]

RESPONSES = (0.3, 0.6, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Time constants that are tried. [s]"""

LAG_STEPS = (1.0, 0.4, 0.2)
"""Lags are searched in steps that get finer. [s]"""

LAG_LIMIT = 5.0
"""Longest lag either way. [s]"""

KNOTS = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Quantiles at which a curve may bend. [-]"""


@dataclass(frozen=True, eq=False)
class Refined:
    """One effect, refined.

    Parameters
    ----------
    effect : ColumnEffect
        Without coefficients.
    score : float
        Squared score of all its coefficients, less log n for each beyond the first (Schwarz) and less what the choice
        of a shape costs.
    """

    effect: ColumnEffect
    score: float


class Refinement:
    """Scores effects beside everything known, many at once.

    Parameters
    ----------
    coarse : Coarse
    problem : Problem
    known : array, shape (seconds, k)
        Orthonormal; partialled out.
    single : bool
        Only shapes with one coefficient will do.
    """

    def __init__(self, coarse: Coarse, problem: Problem, known: FloatArray, *, single: bool = False) -> None:
        self._coarse, self._problem, self._single = coarse, problem, single
        self._basis = known
        left = problem.response
        left = left - known @ (known.T @ left)
        self._left = left / max(float(np.sqrt(np.mean(left**2))), 1e-300)
        self._shape_cost = 0.0
        self._quantities: dict[ColumnEffect, FloatArray] = {}
        self._responses: dict[tuple[ColumnEffect, float], FloatArray] = {}

    def refine(self, effect: ColumnEffect, columns: Mapping[str, Column]) -> Refined:
        """Shape, timing, shape again, timing again, each time in finer steps."""
        best = Refined(effect, self.scores([effect])[0])
        best = self._best(best, self._shapes(best.effect, columns))
        for step in LAG_STEPS:
            best = self._best(best, self._timings(best.effect, step, 2.0 * step))
        best = self._best(best, self._shapes(best.effect, columns))
        return best

    def scores(self, effects: Sequence[ColumnEffect]) -> list[float]:
        """Squared score of each effect, all its coefficients free, less log n for each beyond the first."""
        answers = [self._answer(effect) for effect in effects]
        widths = [answer.shape[1] for answer in answers]
        rows = self._problem.rows(np.concatenate(answers, axis=1))
        rows = rows - self._basis @ (self._basis.T @ rows)
        found, at = [], 0
        for width in widths:
            own = rows[:, at : at + width]
            at += width
            found.append(self._score(own))
        return found

    def _score(self, rows: FloatArray) -> float:
        sizes = np.linalg.norm(rows, axis=0)
        if not np.isfinite(sizes).all() or float(sizes.min()) < 1e-6:
            return -np.inf
        unit = rows / sizes
        if unit.shape[1] > 1:
            unit = orthonormal(unit, 1e-6)
        gain: float = float(np.square(unit.T @ self._left).sum())
        return gain - float((rows.shape[1] - 1) * np.log(len(self._left)))

    def _answer(self, effect: ColumnEffect) -> FloatArray:
        """Answer at 1 Hz, standardised, shape (n, k); on the fine grid, as the fit has it, and in whole steps of it.

        Answering at 1 Hz is another filter, whose best time constant is too short and whose size is too small.
        """
        step = self._coarse.timeline.step
        shape = structs.replace(effect, lag_s=0.0, response_s=0.0)
        if shape not in self._quantities:
            values = shape.answer(step, self._coarse.context)
            inside = values[self._coarse.timeline.valid]
            self._quantities[shape] = (values - inside.mean(axis=0)) / np.maximum(inside.std(axis=0), 1e-12)
        key = (shape, effect.response_s)
        if key not in self._responses:
            responded = respond(self._quantities[shape], step, 0.0, effect.response_s)
            self._responses[key] = np.cumsum(np.pad(responded, ((1, 0), (0, 0))), axis=0)
        return _means_by_second(self._responses[key], round(effect.lag_s / step))

    def _best(self, best: Refined, others: Iterable[tuple[ColumnEffect, float]]) -> Refined:
        several = list(others)
        if not several:
            return best
        scores = np.asarray(self.scores([effect for effect, _ in several])) - [cost for _, cost in several]
        at = int(np.argmax(scores))
        return Refined(several[at][0], float(scores[at])) if scores[at] > best.score else best

    def _timings(self, effect: ColumnEffect, step: float, reach: float) -> Iterator[tuple[ColumnEffect, float]]:
        paid = self._paid(effect)
        lags = effect.lag_s + np.arange(-reach, reach + 0.5 * step, step)
        near = sorted(RESPONSES, key=lambda response: abs(np.log(response / max(effect.response_s, 0.1))))[:5]
        for lag in lags[np.abs(lags) <= LAG_LIMIT]:
            for response in near:
                yield structs.replace(effect, lag_s=round(float(lag), 1), response_s=response), paid

    def _shapes(self, effect: ColumnEffect, columns: Mapping[str, Column]) -> Iterator[tuple[ColumnEffect, float]]:
        """Other shapes of the same column, and other scales of a product's proximities."""
        timing = {"lag_s": effect.lag_s, "response_s": effect.response_s}
        if isinstance(effect, Product):
            yield from ((structs.replace(other, **timing), 0.0) for other in _scaled(effect))
            return
        column = columns[effect.columns[0]]
        seen = self._coarse.context[column.name][self._coarse.timeline.valid]
        shapes = [shape.effect for shape in shapes_of(column, seen)]
        shapes += [] if self._single else list(_curves(column, seen))
        cost = self._shape_cost = 2.0 * float(np.log(max(1, len(shapes))))
        for shape in shapes:
            yield structs.replace(shape, **timing), 0.0 if _is_plain(shape) else cost

    def _paid(self, effect: ColumnEffect) -> float:
        """What the shape of an effect has cost already is paid by its variants too."""
        return 0.0 if _is_plain(effect) or isinstance(effect, Product) else self._shape_cost


def _means_by_second(sums: FloatArray, late: int) -> FloatArray:
    """Means over each second of a series that comes `late` samples later, from its running sums; the ends stay."""
    last = len(sums) - 1
    first = np.arange(0, last - COARSE + 1, COARSE)
    start, stop = (np.clip(first + more - late, 0, last) for more in (0, COARSE))
    return np.asarray((sums[stop] - sums[start]) / np.maximum(stop - start, 1)[:, None])


def _is_plain(effect: ColumnEffect) -> bool:
    return not isinstance(effect, Threshold | Saturating | Piecewise | Proximity)


def _curves(column: Column, seen: FloatArray) -> Iterator[ColumnEffect]:
    """Curves with one or two bends; a neighbour that is not there is far away, which a curve does not say."""
    if column.role is not Role.NUMBER or column.gaps:
        return
    values = np.unique(np.quantile(seen[np.isfinite(seen)], KNOTS))
    template = Linear(acts="location", column=column.name)  # type: ignore[arg-type]
    for number in (1, 2):
        for knots in combinations(values.tolist(), number):
            yield Piecewise(acts=template.acts, column=column.name, knots=knots)


def _scaled(effect: Product) -> Iterator[Product]:
    for index, factor in enumerate(effect.factors):
        if factor.form is not Form.PROXIMITY:
            continue
        for share in (0.35, 0.5, 0.7, 1.4, 2.0):
            factors = list(effect.factors)
            factors[index] = structs.replace(factor, at=factor.at * share)
            yield structs.replace(effect, factors=(factors[0], factors[1]))
