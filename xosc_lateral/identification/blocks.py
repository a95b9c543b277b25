"""Blocks of driving that are held out together, and the folds that they are dealt to.

References
----------
.. [1] P. Burman, E. Chow, D. Nolan, "A cross-validatory method for dependent data", Biometrika 81, 1994.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.timeline import Timeline

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
