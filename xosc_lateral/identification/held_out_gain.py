"""What a model predicts better than another on rows that neither was fitted on, with the same noise for both.

References
----------
.. [1] L. Breiman, J. Friedman, R. Olshen, C. Stone, "Classification and Regression Trees", 1984, section 3.4.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.autocorrelation import Whitener
from xosc_lateral.identification.innovations import CLIP, own_levels
from xosc_lateral.identification.regression import Coarse, Fitted, joined, known_scale_of
from xosc_lateral.identification.timeline import Timeline
from xosc_lateral.normal import NORMAL_95

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

IntArray = NDArray[np.intp]

FOLDS = 4
"""Every part of the drives is held out once, and predicted from the other three."""

BLOCK_S = 150.0
"""Length of the blocks of a drive that are held out; drives shorter than three blocks are held out whole. [s]"""


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


def held_out_words(timeline: Timeline, blocks: IntArray) -> str:
    """What is held out, for the record."""
    number, folds = int(blocks.max()) + 1, folds_of(blocks)
    if folds == 1:
        return "nothing: the table is too short to hold a block out"
    what = "drives" if number < 1.5 * len(timeline.names) else f"blocks of about {BLOCK_S:g} s"
    return (
        f"{number} {what} in {folds} folds: the rows of a fold are scored by profiles whose base model, effects and "
        "sizes were chosen and fitted on the other folds"
    )


@dataclass(frozen=True, slots=True)
class Gain:
    """Gain in log-likelihood on rows that nothing was chosen or fitted on.

    Parameters
    ----------
    mean, error : float
        Over blocks, per block, with the standard error of the mean. [nat]
    folds : int
        In how many folds the term was chosen again.
    """

    mean: float
    error: float
    folds: int

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the mean gain."""
        return self.mean - NORMAL_95 * self.error, self.mean + NORMAL_95 * self.error

    @property
    def stands(self) -> bool:
        """Whether the held-out blocks leave a significant term standing: no loss by a standard error [1]_.

        They are a veto, not a second proof: beside a gain of 12 nat over all blocks chance alone gives 6 either way,
        and what a fold gets wrong of lag, shape and size is lost on top. What no fold found again does not stand.
        """
        return self.mean + self.error > 0.0


def held_out_gain(fitted: Fitted, rest: Fitted, coarse: Coarse, held: BoolArray) -> FloatArray:
    """Gain in log-likelihood of `fitted` over `rest`, which has fewer terms, shape (n,); 0 where not held. [nat]

    Both get the autoregression of `fitted`: what is judged is where the car should be and how large its movement is. An
    autoregression fitted beside a term differs by what the term takes out of the movement, and is judged by *every*
    held-out row, also where the term does nothing: on the motorway recording it cost 0.3 to 0.5 nat a vehicle, as much
    as the neighbour on the right gains. The held-out rows' own levels of place and spread are taken from themselves.

    Parameters
    ----------
    fitted, rest : Fitted
        Without the held-out rows.
    coarse : Coarse
        With the held-out rows valid.
    held : bool array, shape (n,)
    """
    return _log_likelihood(fitted, fitted, coarse, held) - _log_likelihood(rest, fitted, coarse, held)


def _log_likelihood(fitted: Fitted, noise: Fitted, coarse: Coarse, held: BoolArray) -> FloatArray:
    """Of every valid row in `held`, shape (n,), with the autoregression of `noise`; 0 elsewhere."""
    rows = coarse.valid & held
    columns = joined([term.mean_columns(fitted.coarse) for term in fitted.terms], len(coarse))
    scales = joined([term.scale_columns(fitted.coarse) for term in fitted.terms], len(coarse))
    scale = np.exp(scales @ fitted.log_sizes + known_scale_of(coarse, fitted.terms))
    bare = Whitener(noise.whitener.process, rows, coarse.drive, scale)
    squares = np.square(bare.rows(np.where(rows, coarse.offset - columns @ fitted.sizes, 0.0)))
    typical = max(float(squares[rows].mean()), 1e-300) if rows.any() else 1.0
    level = own_levels(np.minimum(squares, CLIP * typical), rows, coarse.drive) * typical
    own = level[coarse.drive]
    factor = bare.by_position(noise.starts)
    deviation = np.sqrt(own) * factor * bare.deviations
    return np.where(rows, -0.5 * np.minimum(squares / (own * factor**2), CLIP) - np.log(deviation), 0.0)
