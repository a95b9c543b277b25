"""A Markov chain made ready for sampling: one uniform number and two look-ups per step.

References
----------
.. [1] A. J. Walker, "An efficient method for generating discrete random variables with general distributions", ACM
       Trans. Mathematical Software 3, 1977.
.. [2] M. D. Vose, "A linear algorithm for generating random numbers with a given distribution", IEEE Trans. Software
       Engineering 17, 1991.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False, slots=True)
class AliasTable:
    """A chain made ready for sampling: one uniform number and two look-ups per step [1]_.

    Parameters
    ----------
    keep : array, shape (n_bins * n_bins,)
        Column k of row i stands for bin k below this fraction of its width ...
    other : array of int, shape (n_bins * n_bins,)
        ... and for this bin above it.
    """

    n_bins: int
    keep: FloatArray
    other: IntArray

    @classmethod
    def of(cls, transition: FloatArray) -> AliasTable:
        """Build from rows of probabilities [-], shape (n_bins, n_bins), each summing to 1."""
        rows = [_alias_row(row) for row in transition]
        keep = np.concatenate([row[0] for row in rows])
        other = np.concatenate([row[1] for row in rows])
        return cls(len(transition), keep, other)


def _alias_row(probabilities: FloatArray) -> tuple[FloatArray, IntArray]:
    n = len(probabilities)
    keep, other = (probabilities * n).tolist(), list(range(n))
    _paired(keep, other)
    # A bin of probability 0 that rounding left alone must not be drawn.
    likely = int(np.argmax(probabilities))
    for k in range(n):
        if probabilities[k] == 0.0:
            other[k] = likely if other[k] == k else other[k]
            keep[k] = 0.0
    return np.array(keep), np.array(other, dtype=np.int64)


def _paired(keep: list[float], other: list[int]) -> None:
    """Fill what each bin lacks of 1 from one that has more: Vose's algorithm [2]_, in place."""
    n = len(keep)
    small = [k for k in range(n) if keep[k] < 1.0]
    large = [k for k in range(n) if keep[k] >= 1.0]
    while small and large:
        less, more = small.pop(), large[-1]
        other[less] = more
        keep[more] -= 1.0 - keep[less]
        if keep[more] < 1.0:
            small.append(large.pop())
    for k in small + large:  # what is left differs from 1 by rounding
        keep[k] = 1.0
