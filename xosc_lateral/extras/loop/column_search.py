"""The search for one more column: best of the dictionary, refined, fitted, and proved against rotations."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np
from scipy.special import chdtri

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect
from xosc_lateral.drivers.model.seeds import generator
from xosc_lateral.extras.loop.autocorrelation import WhitenedRegression
from xosc_lateral.extras.loop.candidates import Family
from xosc_lateral.extras.loop.dictionary import (
    CROSS_BASIS,
    LEFT_OVER,
    LIKELIHOOD_MARGIN,
    Dictionary,
    Search,
    beside,
    beside_parts,
    build_dictionary,
    of_unit_variance,
    orthonormal,
    score_entries,
)
from xosc_lateral.extras.loop.drives import OwnSlopes, counted
from xosc_lateral.extras.loop.model import Fitted, Outcome, fit_model
from xosc_lateral.extras.loop.omnibus import courses
from xosc_lateral.extras.loop.refinement import Refined, Refinement
from xosc_lateral.extras.loop.significance import MANY_DRIVES, NULL_DRAWS, LoopSeed, draw_null, score_at, upper_tail
from xosc_lateral.extras.loop.terms.column import ColumnTerm, of_kind

# Sets of columns that are refined, at most: of 35 effects 23 are named with one, 24 with four and with eight
# (laboratory.loop_ablation).
CONTENDERS = 4
# A term may lower the likelihood of the rows that it is fitted to by so much. More, and the model contradicts it: a
# factor on the movement that changes faster than the movement does, say, which its innovations alone allow. [nat]
ROUNDING = 1e-6
# Windows that count as independent where movement with and without a term is compared: longer than the memory of a
# minute and a half. [s]
CLUSTER_S = 120
# Standard errors by which the movement must have grown. A term of the right size lowers it by as much as one of twice
# the right size leaves it the same: a true one is lost in at most 2 % of the tables, however weak it is. [-]
GROWTH_ERRORS = 2.0
# Directions of a column's plain responses with less than this share of the largest variance have no slope of their own
# in every drive. [-]
OWN_SLOPES = 0.2
FEWEST, MOST_DRIVES = 3, 60  # Drives of two minutes from which, and up to which, slopes of their own are looked at.
ROUNDS = 2  # Times that the candidates are scored beside what was found before; the first changes most.


class SearchedTerm(ColumnTerm):
    """An effect that the dictionary is searched for, in a regression of its own."""

    @classmethod
    @abstractmethod
    def problem(cls, fitted: Fitted) -> WhitenedRegression:
        """Regression in which a column of this kind is tested, with the terms fitted already."""

    @classmethod
    def reweighted(cls, fitted: Fitted, after: Fitted) -> WhitenedRegression | None:
        """The same regression beside `fitted`, weighted by the noise that is left in `after`; None: no other."""
        return None

    def own_slopes(self, fitted: Fitted) -> OwnSlopes | None:
        """How it differs from drive to drive; None: nobody asks."""
        return None

    @classmethod
    def barred(cls, fitted: Fitted) -> frozenset[str]:
        """Columns that this kind may not take up beside the terms fitted."""
        return frozenset()

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """The best candidate of the whole dictionary against rotations."""
        return ColumnSearch(search, cls, fitted).outcome()

    def probability_beside(self, search: Search, fitted: Fitted) -> float:
        """p-value of its columns in whatever shape suits them beside the terms fitted."""
        return ColumnSearch(search, type(self), fitted).probability_of(self.columns)


@dataclass(frozen=True, eq=False)
class _Scored:
    """All candidates, scored beside what is known."""

    problem: WhitenedRegression
    dictionary: Dictionary
    known: FloatArray  # shape (seconds, k), orthonormal
    alone: FloatArray  # shape (entries,): Squared score less cost, of products not beside their parts; -inf: barred.
    maxima: FloatArray  # shape (draws,): The largest that the null gives.
    left: FloatArray  # shape (seconds,): What the scores are of.
    span: Callable[[str], FloatArray]  # All that a column does alone, shape (seconds, rank), orthonormal.
    by_drive: Callable[[str], FloatArray]  # What it does with slopes of each drive's own, shape (seconds, k).

    def _beside_parts(self, alone: FloatArray, margin: float) -> FloatArray:
        return beside_parts(alone, self.dictionary, self.left, self.known, self.span, self.by_drive, margin)

    @cached_property
    def _leading(self) -> FloatArray:
        """Scores as far as it takes to know the largest."""
        return self._beside_parts(self.alone, 0.0)

    @cached_property
    def scores(self) -> FloatArray:
        """Squared score less cost, shape (entries,), of all that may be looked at; -inf: barred."""
        return self._beside_parts(self._leading, LIKELIHOOD_MARGIN)

    @cached_property
    def best(self) -> int:
        """Entry with the largest score."""
        return int(np.argmax(self._leading))

    def likeliest(self) -> tuple[ColumnEffect, float]:
        """Best candidate and its p-value."""
        return self.dictionary.timed(self.best), upper_tail(float(self._leading[self.best]), self.maxima)

    def contenders(self) -> list[int]:
        """Best entry of the best sets of columns, and of each single column of the very best."""
        scores, columns = self.scores, [candidate.columns for candidate in self.dictionary.candidates]
        order = np.argsort(-scores, kind="stable")
        best: dict[tuple[str, ...], int] = {}
        for index in order:
            if scores[index] < scores[self.best] - LIKELIHOOD_MARGIN or len(best) == CONTENDERS:
                break
            best.setdefault(columns[index], int(index))
        for index in order[np.isfinite(scores[order])]:
            if columns[index] in {(column,) for column in columns[self.best]}:
                best.setdefault(columns[index], int(index))
        return list(best.values())


@dataclass(frozen=True, eq=False)
class ColumnSearch:
    """One more column is searched for beside the terms of a fit."""

    search: Search
    kind: type[SearchedTerm]  # Of the term that it would become.
    fitted: Fitted
    # Columns that were taken for a product with them that explains more, but not surely so.
    _simplified: list[tuple[str, ...]] = field(default_factory=list, init=False)

    def outcome(self) -> Outcome | None:
        """Best candidate; None: there is no candidate.

        The p-value is that of a score test (Rao 1948): data and null are whitened alike, by what is left *without* the
        candidate. To whiten again with it in would give a slow column credit for the memory that it has just explained
        away, which no rotation gets: on drives without an effect such p-values fall below 0.005 seven times as often as
        they should.
        """
        refused = {term.columns for term in of_kind(self.fitted, self.kind)}  # one column, one finding
        there = len(refused)
        scored = self._scored_once()
        while scored is not None:
            likeliest, p_value = scored.likeliest()
            if not self.kind.passes(self.search, p_value, self.fitted):  # refined, it would not be accepted either
                entry, own_p = self.in_some_drives(scored, refused)
                if entry is not None and self.kind.passes(self.search, own_p, self.fitted):
                    some: SearchedTerm = self.kind.of(scored.dictionary.timed(entry))
                    some, after = self._where_it_acts(some, scored)
                    return Outcome(some, some.columns, own_p, after, unsure=True)
                return Outcome(None, likeliest.columns, p_value)
            term, after = self._term(scored, refused)
            if not grows(self.fitted, after) and after.log_likelihood >= self.fitted.log_likelihood - ROUNDING:
                term, after = self._where_it_acts(term, scored)
                return Outcome(term, term.columns, p_value, after, unsure=bool(self._simplified))
            refused.add(term.columns)
            scored = self._scored(scored.problem, scored.dictionary, refused)
        return Outcome(None, min(refused), 1.0) if len(refused) > there else None

    def probability_of(self, columns: tuple[str, ...]) -> float:
        """p-value of the best candidate of given columns by the null of `outcome`, in a fit without a term of them."""
        scored = self._scored(self.kind.problem(self.fitted), spared=columns)
        if scored is None:
            return 1.0
        members = [i for i, candidate in enumerate(scored.dictionary.candidates) if candidate.columns == columns]
        p_value = upper_tail(float(scored.scores[members].max()), scored.maxima) if members else 1.0
        return min(p_value, self.in_some_drives(scored, (), columns)[1])

    def in_some_drives(
        self, scored: _Scored, refused: Collection[tuple[str, ...]], only: tuple[str, ...] = ()
    ) -> tuple[int | None, float]:
        """The plain entry that explains most with a slope of each drive's own, and its p-value by the same null."""
        coarse, rows = self.search.coarse, scored.problem.whitener.valid
        drive, candidates, lasting = coarse.drive[rows], scored.dictionary.candidates, np.flatnonzero(counted(coarse))
        taken = {term.columns for term in of_kind(self.fitted, self.kind)} | set(refused)
        barred = self.kind.barred(self.fitted)
        plain = [
            i
            for i, one in enumerate(candidates)
            if one.family is Family.PLAIN and one.columns not in taken and barred.isdisjoint(one.columns)
        ]
        if self.kind.acts is not Acts.LOCATION or not FEWEST <= len(lasting) <= MOST_DRIVES or not plain:
            return None, 1.0
        rng = generator(self.search.seed, LoopSeed.COLUMNS)
        if coarse.drives < MANY_DRIVES:
            null = draw_null(scored.left, drive, rng)
        else:  # signs of whole drives leave the square of a drive's own slope as it is: signs of minutes
            minutes = np.unique(coarse.cluster[rows], return_inverse=True)[1]
            null = scored.left[:, None] * rng.choice([-1.0, 1.0], size=(minutes.max() + 1, NULL_DRAWS))[minutes]
        known_slopes = (scored.by_drive(name) for term in of_kind(self.fitted, self.kind) for name in term.columns)
        known = orthonormal(np.concatenate([scored.known, *known_slopes], axis=1), CROSS_BASIS)
        left = beside(known, np.concatenate([scored.left[:, None], null], axis=1))
        entries = beside(known, scored.dictionary.rows[plain].astype(np.float64).T)
        explained = np.zeros((len(plain), left.shape[1]))
        for number in lasting:
            slopes = entries[drive == number].T
            power = np.square(slopes).sum(axis=1)
            there = power > 3.0 * LEFT_OVER / len(lasting)  # a copy of what was found has nothing left
            explained[there] += np.square(slopes[there] @ left[drive == number]) / power[there, None]
        names = [i for i in range(len(plain)) if not only or candidates[plain[i]].columns == only]
        if not names:
            return None, 1.0
        best = names[int(np.argmax(explained[names, 0]))]
        # the second of two looks
        return plain[best], min(1.0, 2.0 * upper_tail(explained[best, 0], explained[:, 1:].max(axis=0)))

    def limits(self, level: float) -> tuple[WhitenedRegression, FloatArray, float] | None:
        """Regression, what is known in it (white, orthonormal), and the score whose p-value is a level; None: empty."""
        scored = self._scored_once()
        return None if scored is None else (scored.problem, scored.known, score_at(level, scored.maxima))

    def likely_response(self, level: float) -> tuple[FloatArray, float]:
        """Response of the best candidate and its p-value, shape (n, 1) where that is at most `level`; else (n, 0)."""
        scored = self._scored_once()
        effect, p_value = (None, 1.0) if scored is None else scored.likeliest()
        if effect is None or p_value > level:
            return np.zeros((len(self.fitted.coarse), 0)), 1.0
        return self.fitted.coarse.response(effect), p_value

    def _scored_once(self) -> _Scored | None:
        taken = {term.columns for term in of_kind(self.fitted, self.kind)}
        scored: _Scored | None = self.search.once(
            self.kind, self.fitted, lambda: self._scored(self.kind.problem(self.fitted), refused=taken)
        )
        return scored

    def _scored(
        self,
        problem: WhitenedRegression,
        dictionary: Dictionary | None = None,
        refused: Collection[tuple[str, ...]] = (),
        *,
        draws: int = NULL_DRAWS,
        spared: tuple[str, ...] = (),
    ) -> _Scored | None:
        """Score what is neither barred nor refused beside all that is known of its columns but those `spared`."""
        kind, search = self.kind, self.search
        if dictionary is None:
            dictionary = build_dictionary(search.quantities, problem.whitener)
        columns, candidates = kind.barred(self.fitted), dictionary.candidates
        barred = np.array([not columns.isdisjoint(one.columns) or one.columns in refused for one in candidates])
        if len(dictionary) == 0 or barred.all():
            return None
        sizes = np.maximum(np.linalg.norm(problem.known, axis=0), 1e-300)
        blocks = [orthonormal(problem.known / sizes, 1e-8)]
        for term in of_kind(self.fitted, kind):
            if spared and set(spared) < set(term.columns):
                continue
            parts = ({(column,) for column in term.columns} | {term.columns}) - {spared}
            rows = np.array([candidate.columns in parts for candidate in candidates])
            if rows.any():
                blocks.append(orthonormal(dictionary.rows[rows].astype(np.float64).T, CROSS_BASIS))
        known = orthonormal(np.concatenate(blocks, axis=1), 1e-6)
        left, drive = of_unit_variance(beside(known, problem.observed)), search.coarse.drive[problem.whitener.valid]
        null, drives = draw_null(left, drive, generator(search.seed, LoopSeed.COLUMNS), draws), np.unique(drive)
        scores, maxima = score_entries(dictionary, left, known, barred, null, of_mean=kind.acts is Acts.LOCATION)

        @cache
        def span(column: str) -> FloatArray:
            rows = [i for i, candidate in enumerate(candidates) if candidate.columns == (column,)]
            course = courses(search.quantities, problem.whitener, problem.whitener.valid, (column,)).values()
            return orthonormal(
                np.concatenate([dictionary.rows[rows].astype(np.float64).T, *course], axis=1), CROSS_BASIS
            )

        @cache
        def by_drive(column: str) -> FloatArray:
            if not 1 < len(drives) <= MOST_DRIVES:
                return np.zeros((len(left), 0))
            plain = [i for i, one in enumerate(candidates) if one.columns == (column,) and one.family is Family.PLAIN]
            leading = orthonormal(dictionary.rows[plain].astype(np.float64).T, OWN_SLOPES)
            return np.concatenate([leading * (drive == one)[:, None] for one in drives], axis=1)

        return _Scored(problem, dictionary, known, scores, maxima, left, span, by_drive)

    def _term(self, scored: _Scored, refused: Collection[tuple[str, ...]]) -> tuple[SearchedTerm, Fitted]:
        """The term that the best candidate becomes, and the fit with it.

        *That* something acts is tested with the noise that is left without it, for data and null alike. *What* acts is
        chosen once more with the noise that is left beside what was found: a strong slow effect makes the noise look
        slow, and against slow noise a quicker look-alike stands out better than the effect itself.
        """
        term: SearchedTerm = self.kind.of(scored.dictionary.timed(scored.best))
        coarse, terms = self.fitted.coarse, self.fitted.terms
        after = fit_model(coarse, (*terms, term))
        best: Refined | None = None
        for _ in range(ROUNDS):
            here = self._again(scored, after, refused)
            if here is None:
                break
            refined, other = self._refined(here)
            other_after = fit_model(coarse, (*terms, other))
            if best and 2.0 * other_after.log_likelihood - refined.price <= 2.0 * after.log_likelihood - best.price:
                break
            same = other.columns == term.columns
            best, term, after = refined, other, other_after
            if same or here is scored:
                break
        return term, after

    def _again(self, scored: _Scored, after: Fitted, refused: Collection[tuple[str, ...]]) -> _Scored | None:
        """Scored with the noise that is left in `after`."""
        problem = self.kind.reweighted(self.fitted, after)
        return scored if problem is None else self._scored(problem, refused=refused, draws=0)

    def _where_it_acts(self, term: SearchedTerm, scored: _Scored) -> tuple[SearchedTerm, Fitted]:
        """A term and the fit with it; where drives surely differ, in the shape and timing that it has where it acts.

        By one slope for all, what a drive does not show is noise as slow as the column. Quick responses and odd shapes
        stand out against that, and sizes come out a sixth too small.
        """
        coarse, terms = self.fitted.coarse, self.fitted.terms
        after = fit_model(coarse, (*terms, term))
        slopes = term.own_slopes(after)
        here = self._again(scored, after, ()) if slopes is not None and slopes.differ else None
        if slopes is None or here is None:
            return term, after
        refinement = Refinement(coarse, here.problem, here.known, here.dictionary.candidates, slopes.each)
        refined = refinement.refine(term.effect, np.inf, self.search.columns)  # any shape that has a price is better
        term = self.kind.of(refined.effect, term.alike)
        return term, fit_model(coarse, (*terms, term))

    def _refined(self, scored: _Scored) -> tuple[Refined, SearchedTerm]:
        """Refine the best sets of columns; the best of them, which knows what others explain as much."""
        search, candidates = self.search, scored.dictionary.candidates
        refinement = Refinement(search.coarse, scored.problem, scored.known, candidates)
        outcomes = [
            refinement.refine(scored.dictionary.timed(index), candidates[index].cost, search.columns)
            for index in scored.contenders()
        ]
        outcomes.sort(key=lambda outcome: -outcome.score)
        parts = {(column,) for column in outcomes[0].effect.columns}
        # a second factor is a finding of its own, and has to be as sure as any; a part of a table need not be sure
        chance = float(chdtri(1, search.levels[self.kind.component])) if search.wanted is None else 0.0
        simpler = [one for one in outcomes if one.effect.columns in parts and one.score > outcomes[0].score - chance]
        best = simpler[0] if simpler else outcomes[0]
        self._simplified.extend([] if best is outcomes[0] else [best.effect.columns])
        rest = [one for one in outcomes if one.effect.columns != best.effect.columns and np.isfinite(one.score)]
        alike = dict.fromkeys(one.effect.columns for one in rest if refinement.as_good(best.effect, one.effect))
        return best, self.kind.of(best.effect, tuple(alike))


def grows(before: Fitted, after: Fitted) -> bool:
    """Whether the movement that is left is larger with a term than without it, beyond chance.

    Generalised and ordinary least squares agree on a quantity that moves the driver (Hausman 1978). What was sized on a
    few odd seconds alone, as those after a lane change or around a jump of the camera, does not lie in between the rest
    of the time: taken out, it puts in more than was there, and an autoregression close to a unit root lets it.
    """
    rows = np.flatnonzero(before.coarse.valid)
    saved = np.square(before.movement * before.scale)[rows] - np.square(after.movement * after.scale)[rows]
    cluster = rows // CLUSTER_S
    sums = np.bincount(cluster, saved)[np.unique(cluster)]
    return len(sums) > 1 and float(sums.sum()) < -GROWTH_ERRORS * float(np.std(sums, ddof=1)) * np.sqrt(len(sums))
