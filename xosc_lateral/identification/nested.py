"""Held-out gain of everything that was accepted: each fold's terms are selected and sized without it.

References
----------
.. [1] S. Varma, R. Simon, "Bias in error estimation when using cross-validation for model selection", BMC
       Bioinformatics 7, 2006.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.held_out_gain import Gain, folds_of, held_out_gain
from xosc_lateral.identification.regression import Coarse, fit_model
from xosc_lateral.identification.search import Search
from xosc_lateral.identification.selection import Selection, select
from xosc_lateral.identification.terms.base import Term
from xosc_lateral.identification.timeline import coarse_middle

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Nested:
    """Selections of all folds, and what they gain.

    Parameters
    ----------
    selections : tuple of Selection
        One per fold.
    """

    selections: tuple[Selection, ...]
    _by_row: tuple[tuple[BoolArray, Coarse], ...]
    _blocks: IntArray

    def only(self, terms: Sequence[Term]) -> Nested:
        """The same without what a fold chose that is none of these terms."""
        reduced = []
        for selection in self.selections:
            extra = [one.term for one in selection.accepted if not _any_matches(one.term, terms)]
            reduced.append(selection.without(extra, "") if extra else selection)
        return replace(self, selections=tuple(reduced))

    def of(self, term: Term) -> Gain:
        """What one accepted term gains: each fold's own version of it, in or out; nothing where it was not chosen."""
        rows = np.zeros(len(self._blocks))
        chosen = 0
        for selection, (held, coarse) in zip(self.selections, self._by_row, strict=True):
            own = [one for one in selection.final.terms if isinstance(one, Term) and one.matches(term)]
            if not own:
                continue
            chosen += 1
            rest = fit_model(selection.final.coarse, tuple(one for one in selection.final.terms if one is not own[0]))
            rows += held_out_gain(selection.final, rest, coarse, held)
        return _over_blocks(rows, self._blocks, self._by_row, chosen)

    def together(self, terms: Sequence[Term]) -> Gain:
        """What several accepted terms gain over the start: in each fold those of them that were chosen there."""
        rows = np.zeros(len(self._blocks))
        for selection, (held, coarse) in zip(self.selections, self._by_row, strict=True):
            own = [one.term for one in selection.accepted if _any_matches(one.term, terms)]
            if own:
                fitted = fit_model(selection.final.coarse, (*selection.start.terms, *own))
                rows += held_out_gain(fitted, selection.start, coarse, held)
        return _over_blocks(rows, self._blocks, self._by_row, len(self.selections))


def nest(
    search: Search,
    blocks: IntArray,
    initial: Sequence[Term],
    wanted: Mapping[str, int],
    progress: Callable[[float], None] = lambda _: None,
) -> Nested:
    """Select anew without each fold: of every component at least as many terms as the table has, the best ones.

    A level that all have to reach would bias the gain. What a fold lacks of an effect, the others have more of: it is
    significant in just those whose own held-out rows show least of it.

    Parameters
    ----------
    blocks : int array, shape (n,)
        On the 0.2 s grid.
    wanted : mapping of str to int
        Terms that the table has, of the components in which any was accepted.
    """
    from joblib import cpu_count

    coarse = search.coarse
    seconds = coarse_middle(blocks)[: len(coarse)]
    folds = folds_of(blocks)
    quiet = replace(search, wanted=wanted, progress=lambda _: None)

    def selected(fold: int) -> Selection:
        part = coarse.only(seconds % folds != fold) if folds > 1 else coarse
        return select(replace(quiet, coarse=part), initial)

    selections = []
    # threads: the work is in compiled code that lets others run, and all folds read the same candidates
    with ThreadPoolExecutor(min(folds, cpu_count())) as pool:
        for selection in pool.map(selected, range(folds)):
            selections.append(selection)
            progress(len(selections) / folds)
    return Nested(tuple(selections), tuple((seconds % folds == fold, coarse) for fold in range(folds)), seconds)


def _any_matches(term: Term, others: Sequence[Term]) -> bool:
    return any(type(term) is type(other) and term.matches(other) for other in others)


def _over_blocks(rows: FloatArray, blocks: IntArray, where: Sequence[tuple[BoolArray, Coarse]], folds: int) -> Gain:
    valid = where[0][1].valid
    used = np.unique(blocks[valid])
    sums = np.bincount(blocks, rows, minlength=int(blocks.max()) + 1)[used]
    error = float(np.std(sums, ddof=1) / np.sqrt(len(sums))) if len(sums) > 1 else 0.0
    return Gain(float(sums.mean()), error, folds)
