"""What the accepted terms predict better on held-out blocks, on which they were neither selected nor sized.

References
----------
.. [1] S. Varma, R. Simon, "Bias in error estimation when using cross-validation for model selection", BMC
       Bioinformatics 7, 2006: selection belongs into the folds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.drivers.loop.autocorrelation import Whitener
from xosc_lateral.drivers.loop.dictionary import Search
from xosc_lateral.drivers.loop.model import CLIP, Fitted, Term, design_of, fit_model, own_levels
from xosc_lateral.drivers.loop.selection import Gain, Selection, select
from xosc_lateral.drivers.loop.terms.time import StepTerm
from xosc_lateral.drivers.loop.timeline import Coarse, Timeline, coarse_middle

Progress = Callable[[float, str], None]  # Gets the share that is done and what is being done.
FOLDS = 4  # Every part of the drives is held out once, and predicted from the other three.
# Length of the blocks of a drive that are held out; drives shorter than three blocks are held out whole. [s]
BLOCK_S = 150.0


def hold_out_blocks(timeline: Timeline) -> IntArray:
    """Number of the block that every row is in, shape (n,) [-]; block b belongs to fold b modulo `FOLDS`."""
    blocks = np.zeros(len(timeline), dtype=np.intp)
    length = round(BLOCK_S / timeline.step)
    next_block = 0
    for span in timeline.spans:
        n = span.stop - span.start
        parts = max(1, n // length) if n >= 3 * length else 1
        blocks[span] = next_block + np.minimum(np.arange(n) * parts // n, parts - 1)
        next_block += parts
    return blocks


def folds_of(blocks: IntArray) -> int:
    """Number of folds, at most `FOLDS`: fewer when there are fewer blocks. `blocks` of shape (n,). [-]"""
    return min(FOLDS, int(blocks.max()) + 1)


def held_out_words(timeline: Timeline) -> str:
    """What is held out, for the record."""
    blocks = hold_out_blocks(timeline)
    number, folds = int(blocks.max()) + 1, folds_of(blocks)
    if folds == 1:
        return "nothing: the table is too short to hold a block out"
    what = "drives" if number < 1.5 * len(timeline.names) else f"blocks of about {BLOCK_S:g} s"
    return (
        f"{number} {what} in {folds} folds: the rows of a fold are scored by profiles whose base model, effects and "
        "sizes were chosen and fitted on the other folds"
    )


def held_out_gain(fitted: Fitted, rest: Fitted, coarse: Coarse, held: BoolArray) -> FloatArray:
    """Gain in log-likelihood of `fitted` over `rest`, which has fewer terms, shape (n,); 0 where not held. [nat]

    Both get the autoregression of `fitted`: what is judged is where the car should be and how large its movement is. An
    autoregression fitted beside a term differs by what the term takes out of the movement, and is judged by *every*
    held-out row, also where the term does nothing: on the motorway recording it cost 0.3 to 0.5 nat a vehicle, as much
    as the neighbour on the right gains. The held-out rows' own levels of place and spread are taken from themselves.
    """
    return _log_likelihood(fitted, fitted, coarse, held) - _log_likelihood(rest, fitted, coarse, held)


def _log_likelihood(fitted: Fitted, noise: Fitted, coarse: Coarse, held: BoolArray) -> FloatArray:
    """Of every valid row in `held`, shape (n,), with the autoregression of `noise`; 0 elsewhere."""
    rows = coarse.valid & held
    columns, scales, known = design_of(fitted.coarse, fitted.terms)
    scale = np.exp(scales @ fitted.log_sizes + known)
    whitener = Whitener(noise.whitener.process, rows, coarse.drive, scale)
    squares = np.square(whitener.rows(np.where(rows, coarse.offset - columns @ fitted.sizes, 0.0)))
    typical = max(float(squares[rows].mean()), 1e-300) if rows.any() else 1.0
    level = own_levels(np.minimum(squares, CLIP * typical), rows, coarse.drive) * typical
    variance = level[coarse.drive]
    factor = whitener.by_position(noise.starts)
    deviation = np.sqrt(variance) * factor * whitener.deviations
    return np.where(rows, -0.5 * np.minimum(squares / (variance * factor**2), CLIP) - np.log(deviation), 0.0)


@dataclass(frozen=True, eq=False)
class Nested:
    """Selections of all folds, one each, and what they gain.

    What is scored knows nothing of the rows that are held out: neither how many effects there are, nor of which kind.
    What judges a single effect has as many of its kind as the table: a level that all folds have to reach would bias
    its gain. What a fold lacks of an effect, the others have more of: it is significant in just those whose own
    held-out rows show least of it.
    """

    scored: tuple[Selection, ...]  # By the table's levels.
    selections: tuple[Selection, ...]  # At least as many terms of every component as the table has, the best ones.
    coarse: Coarse
    blocks: IntArray  # shape (n,): On the 1 Hz grid.

    def only(self, terms: Sequence[Term], gone: Sequence[Term] = ()) -> Nested:
        """What judges without what a fold chose that is none of these terms; what is scored without those `gone`."""
        judging = (_without(one, lambda term: not _any_matches(term, terms)) for one in self.selections)
        scored = (_without(one, lambda term: _any_matches(term, gone)) for one in self.scored)
        return replace(self, selections=tuple(judging), scored=tuple(scored))

    def of(self, term: Term) -> Gain:
        """What one accepted term gains: each fold's own version of it, in or out; nothing where it was not chosen."""
        pairs: list[tuple[Fitted, Fitted] | None] = []
        for final in (selection.final for selection in self.selections):
            version = next((one for one in final.terms if one.matches(term)), None)
            rest = [one for one in final.terms if one is not version]
            pairs.append(None if version is None else (final, fit_model(final.coarse, rest)))
        return self._gain(pairs, sum(pair is not None for pair in pairs))

    def together(self, terms: Sequence[Term]) -> Gain:
        """What several accepted terms gain over the start: in each fold those of them that were chosen there."""
        pairs: list[tuple[Fitted, Fitted] | None] = []
        for selection in self.selections:
            start = selection.start
            chosen = [one.term for one in selection.accepted if _any_matches(one.term, terms)]
            pairs.append((fit_model(start.coarse, (*start.terms, *chosen)), start) if chosen else None)
        return self._gain(pairs, len(pairs))

    def _gain(self, pairs: Sequence[tuple[Fitted, Fitted] | None], folds: int) -> Gain:
        """Over the blocks, of each fold's fits with and without."""
        rows = np.zeros(len(self.blocks))
        for fold, pair in enumerate(pairs):
            if pair is not None:
                rows += held_out_gain(*pair, self.coarse, self.blocks % len(pairs) == fold)
        return gain_over(rows, self.blocks, self.coarse.valid, folds)


def gain_over(rows: FloatArray, blocks: IntArray, valid: BoolArray, folds: int) -> Gain:
    """Mean over blocks of what their rows gain, shape (n,), with its standard error. [nat]"""
    sums = np.bincount(blocks, rows)[np.unique(blocks[valid])]
    error = float(np.std(sums, ddof=1) / np.sqrt(len(sums))) if len(sums) > 1 else 0.0
    return Gain(float(sums.mean()), error, folds)


def nest(
    search: Search,
    initial: Sequence[Term],
    accepted: Sequence[Term],
    progress: Callable[[float], None] = lambda _: None,
) -> Nested:
    """Select anew without each fold: by the table's levels, and then at least as many terms as were `found` there."""
    from joblib import cpu_count

    coarse, blocks = search.coarse, hold_out_blocks(search.coarse.timeline)
    seconds, folds = coarse_middle(blocks)[: len(coarse)], folds_of(blocks)
    # what happened once can't be found without the block in which it happened: what judges the others knows when
    once = tuple(term for term in accepted if term.component == StepTerm.component)
    wanted = Counter(term.component for term in accepted if term not in once)

    def selected(fold: int) -> tuple[Selection, Selection]:
        part = coarse.only(seconds % folds != fold) if folds > 1 else coarse
        part_of_search = replace(search, coarse=part, progress=lambda _: None)
        scored = select(part_of_search, initial)
        there = Counter(one.term.component for one in scored.accepted)
        if not once and all(there[component] >= number for component, number in wanted.items()):
            return scored, scored
        return scored, select(replace(part_of_search, wanted=wanted), (*initial, *once))

    pairs = []
    # threads: the work is in compiled code that lets others run, and all folds read the same candidates
    with ThreadPoolExecutor(min(folds, cpu_count())) as pool:
        for pair in pool.map(selected, range(folds)):
            pairs.append(pair)
            progress(len(pairs) / folds)
    return Nested(tuple(pair[0] for pair in pairs), tuple(pair[1] for pair in pairs), coarse, seconds)


def _without(selection: Selection, leave_out: Callable[[Term], bool]) -> Selection:
    extra = [one.term for one in selection.accepted if leave_out(one.term)]
    return selection.without(extra, "") if extra else selection


def _any_matches(term: Term, others: Sequence[Term]) -> bool:
    return any(term.kind == other.kind and term.matches(other) for other in others)
