"""The search for one more column: best of the dictionary, refined, fitted, and proved against rotations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import ColumnEffect
from xosc_lateral.identification.dictionary import (
    Dictionary,
    Scores,
    orthonormal,
    score_entries,
)
from xosc_lateral.identification.problem import Problem
from xosc_lateral.identification.refinement import Refined, Refinement
from xosc_lateral.identification.regression import Fitted, ModelTerm, fit_model
from xosc_lateral.identification.search import Search
from xosc_lateral.identification.significance import upper_tail
from xosc_lateral.identification.terms.base import Outcome, Term

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

HOPELESS = 0.1
"""With so large a p-value before refinement nothing is refined. [-]"""

CONTENDERS = 4
"""Sets of columns that are refined, at most."""

WITHIN = 12.0
"""Sets of columns that score lower than the best by more than this are not. [squared score]"""

ALIKE = 1.0
"""A set of columns whose refined score differs by less can't be told from the best. [squared score]"""

STRETCH_S = 120
"""Stretches that count as independent where movement with and without a term is compared: longer than the memory of a
minute and a half. [s]"""

GROWN = 2.0
"""Standard errors by which the movement must have grown. A term of the right size lowers it by as much as one of twice
the right size leaves it the same: a true one is lost in at most 2 % of the tables, however weak it is. [-]"""

ROUNDING = 1e-6
"""A term may lower the likelihood of the rows that it is fitted to by so much. More, and the model contradicts it: a
factor on the movement that changes faster than the movement does, say, which its innovations alone allow. [nat]"""

CROSS_BASIS = 0.01
"""Directions of a column's cross-basis with less than this share of the largest variance are left in. [-]"""


class ColumnKind(ModelTerm, Protocol):
    """What the search asks of a kind of term; see `terms.column.ColumnTerm`."""

    single: ClassVar[bool]

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that it reads."""
        ...

    @classmethod
    def of(cls, effect: ColumnEffect, alike: tuple[str, ...] = ()) -> Self:
        """A term of an effect."""
        ...

    @classmethod
    def problem(cls, fitted: Fitted) -> Problem:
        """Its regression."""
        ...

    @classmethod
    def barred(cls, fitted: Fitted) -> frozenset[str]:
        """Columns that it may not take up."""
        ...


def find_column(search: Search, kind: type[ColumnKind], fitted: Fitted) -> Outcome | None:
    """Best candidate of one kind; None: there is no candidate.

    The p-value is that of a score test [1]_: data and null are whitened alike, by what is left *without* the candidate.
    To whiten again with it in would give a slow column credit for the memory that it has just explained away, which
    no rotation gets: on drives without an effect such p-values fall below 0.005 seven times as often as they should.

    References
    ----------
    .. [1] C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948.
    """
    problem = kind.problem(fitted)
    dictionary = search.dictionary(kind, fitted, problem)
    barred = _barred(dictionary, kind, fitted)
    if len(dictionary) == 0 or barred.all():
        return None
    own = [term for term in fitted.terms if isinstance(term, kind)]
    known = _known(problem, dictionary, own)
    while True:
        scores = _scored(search, dictionary, problem, known, barred)
        columns = dictionary.candidates[scores.best].columns
        p_value = upper_tail(float(scores.scores[scores.best]), scores.maxima)
        if p_value > HOPELESS:
            return Outcome(None, columns, p_value)
        refined, alike = _refine(search, kind, problem, known, dictionary, scores)
        term = kind.of(refined.effect, alike)
        after = fit_model(fitted.coarse, (*fitted.terms, term))
        if not _grows(fitted, after) and after.log_likelihood >= fitted.log_likelihood - ROUNDING:
            assert isinstance(term, Term)
            return Outcome(term, term.columns, p_value, after)
        barred = barred | np.array([one.columns == term.columns for one in dictionary.candidates], dtype=np.bool_)
        if barred.all():
            return Outcome(None, term.columns, 1.0)


def _grows(before: Fitted, after: Fitted) -> bool:
    """Whether the movement that is left is larger with a term than without it, beyond chance.

    Generalised and ordinary least squares agree on a quantity that moves the driver [1]_. What was sized on a few odd
    seconds alone, as those after a lane change, does not lie in between the rest of the time: taken out, it puts in
    more than was there, and an autoregression close to a unit root lets it.

    References
    ----------
    .. [1] J. Hausman, "Specification tests in econometrics", Econometrica 46, 1978.
    """
    coarse = before.coarse
    rows = np.flatnonzero(coarse.valid)
    saved = np.square(before.movement * before.scale)[rows] - np.square(after.movement * after.scale)[rows]
    stretch = rows // STRETCH_S
    sums = np.bincount(stretch, saved)[np.unique(stretch)]
    return len(sums) > 1 and float(sums.sum()) < -GROWN * float(np.std(sums, ddof=1)) * np.sqrt(len(sums))


def _scored(search: Search, dictionary: Dictionary, problem: Problem, known: FloatArray, barred: BoolArray) -> Scores:
    drive = search.coarse.drive[problem.valid]
    return score_entries(dictionary, problem.response, known, barred, drive, search.rng(0))


def _known(problem: Problem, dictionary: Dictionary, own: Sequence[ColumnKind]) -> FloatArray:
    """What the model has already, and the whole cross-basis of its columns: nothing may be blamed on their likes."""
    known = problem.known
    sizes = np.maximum(np.linalg.norm(known, axis=0), 1e-300)
    blocks = [orthonormal(known / sizes, 1e-8)]
    for term in own:
        parts = {(column,) for column in term.columns} | {term.columns}
        rows = np.array([candidate.columns in parts for candidate in dictionary.candidates])
        if rows.any():
            blocks.append(orthonormal(dictionary.rows[rows].astype(np.float64).T, CROSS_BASIS))
    return orthonormal(np.concatenate(blocks, axis=1), 1e-6)


def _refine(
    search: Search,
    kind: type[ColumnKind],
    problem: Problem,
    known: FloatArray,
    dictionary: Dictionary,
    scores: Scores,
) -> tuple[Refined, tuple[str, ...]]:
    """Refine the best sets of columns; the best of them, and which others explain as much."""
    refinement = Refinement(search.coarse, problem, known, single=kind.single)
    best: dict[tuple[str, ...], int] = {}
    for index in np.argsort(-scores.scores):
        if scores.scores[index] < scores.scores[scores.best] - WITHIN or len(best) == CONTENDERS:
            break
        best.setdefault(dictionary.candidates[index].columns, int(index))
    outcomes: list[tuple[float, Refined]] = []
    for index in best.values():
        candidate = dictionary.candidates[index]
        start = dictionary.timed(index)
        refined = refinement.refine(start, search.columns)
        outcomes.append((refined.score - candidate.cost, refined))
    outcomes.sort(key=lambda outcome: -outcome[0])
    first = set(outcomes[0][1].effect.columns)
    close = [o.effect.columns for score, o in outcomes[1:] if score > outcomes[0][0] - ALIKE]
    alike = tuple(sorted({name for columns in close for name in columns} - first))
    return outcomes[0][1], alike


def _barred(dictionary: Dictionary, kind: type[ColumnKind], fitted: Fitted) -> BoolArray:
    """Entries that this kind may not take up."""
    columns = kind.barred(fitted)
    most = 1 if kind.single else 2
    return np.array(
        [bool(columns & set(one.columns)) or len(one.contrast) > most for one in dictionary.candidates], dtype=np.bool_
    )
