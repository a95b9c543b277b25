"""Coarse movement of the paper's model: a first-order Markov chain over bins of the relative offset, smoothed; and the
chain made ready for sampling, one uniform number and two look-ups per step.

References
----------
.. [1] N. Neis, J. Beyerer, arXiv:2405.17080, section III: coarse part kappa of x = kappa + phi.
.. [2] A. J. Walker, "An efficient method for generating discrete random variables with general distributions", ACM
       Trans. Mathematical Software 3, 1977.
.. [3] M. D. Vose, "A linear algorithm for generating random numbers with a given distribution", IEEE Trans. Software
       Engineering 17, 1991.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.errors import DriverProfileError


def open_traps(counts: IntArray) -> IntArray:
    """Counts with a way out of every bin that has none, towards the nearest of the others. Shape as `counts`. [-]"""
    bins = np.arange(len(counts))
    visited = (counts.sum(axis=0) + counts.sum(axis=1)) > 0
    main = _main_part(counts)
    stuck = np.flatnonzero(visited & ~_reachable(counts.T, main))
    opened = counts.copy()
    opened[stuck, _nearest(bins[stuck], bins[main])] += 1
    empty = np.flatnonzero(~visited)
    opened[empty, empty + np.sign(_nearest(empty, bins[visited]) - empty)] += 1
    return opened


def _nearest(bins: IntArray, goals: IntArray) -> IntArray:
    return np.asarray(goals[np.abs(bins[:, None] - goals[None, :]).argmin(axis=1)])


def _reachable(counts: IntArray, start: BoolArray) -> BoolArray:
    """Bins that the chain can get to from `start` (itself included)."""
    bins = start.copy()
    while True:
        more = bins | (counts[bins] > 0).any(axis=0)
        if (more == bins).all():
            return bins
        bins = more


def _main_part(counts: IntArray) -> BoolArray:
    """The set of bins that all lead to one another in which most time was spent."""
    best, most = np.zeros(len(counts), dtype=np.bool_), -1
    left = counts.sum(axis=0) + counts.sum(axis=1) > 0
    while left.any():
        seed = np.zeros(len(counts), dtype=np.bool_)
        seed[np.argmax(left)] = True
        part = _reachable(counts, seed) & _reachable(counts.T, seed)
        inside = int(counts[np.ix_(part, part)].sum())
        if inside > most:
            best, most = part, inside
        left &= ~part
    return best


N_BINS = 20
"""Bins of the relative offset over [-0.5, 0.5]. [-]"""


@dataclass(frozen=True, eq=False)  # no slots: what follows from the counts is worked out once
class MarkovChain:
    """Coarse lateral position as a chain over bins of the relative offset.

    By observed transitions, shape (n_bins, n_bins): row i, column j: from bin i to bin j in one step. Raises
    `DriverProfileError` if it isn't square, a count is negative, or there is no transition at all.
    """

    counts: IntArray

    def __post_init__(self) -> None:
        counts = np.array(self.counts, dtype=np.int64)
        if counts.ndim != 2 or counts.shape[0] != counts.shape[1] or len(counts) < 2:
            raise DriverProfileError(f"Markov chain: counts of shape {counts.shape}, expected (n, n) with n >= 2")
        if counts.min() < 0 or counts.sum() == 0:
            raise DriverProfileError(f"Markov chain: smallest count {counts.min()}, sum {counts.sum()}: need 0 and > 0")
        counts.flags.writeable = False
        object.__setattr__(self, "counts", counts)

    @property
    def n_bins(self) -> int:
        """Count of bins."""
        return len(self.counts)

    @property
    def centres(self) -> FloatArray:
        """Bin centres, shape (n_bins,). [-]"""
        return (np.arange(self.n_bins) + 0.5) / self.n_bins - 0.5

    @cached_property
    def transition(self) -> FloatArray:
        """Probabilities of the next bin, shape (n_bins, n_bins), rows summing to 1, traps opened. [-]"""
        counts = open_traps(self.counts).astype(np.float64)
        return np.asarray(counts / counts.sum(axis=1, keepdims=True))

    @property
    def support(self) -> BoolArray:
        """Bins that were visited, shape (n_bins,). [-]"""
        return np.asarray((self.counts.sum(axis=0) + self.counts.sum(axis=1)) > 0)

    @cached_property
    def stationary(self) -> FloatArray:
        """Share of time in each bin in the long run, shape (n_bins,). [-]"""
        transition = self.transition
        system = np.vstack([transition.T - np.eye(self.n_bins), np.ones(self.n_bins)])
        share = np.linalg.lstsq(system, np.append(np.zeros(self.n_bins), 1.0), rcond=None)[0]
        share = np.where(self.support, np.maximum(share, 0.0), 0.0)
        return np.asarray(share / share.sum())

    @cached_property
    def alias_table(self) -> AliasTable:
        """The chain made ready for sampling."""
        return AliasTable.of(self.transition)

    @property
    def mean(self) -> float:
        """Mean of the coarse part in the long run. [-]"""
        return float(self.stationary @ self.centres)


def bin_of(rel_offset: FloatArray, n_bins: int = N_BINS) -> IntArray:
    """Bin, 0 to n_bins - 1, of each relative offset [-], any shape; beyond the markings the outermost."""
    return np.clip(np.floor((rel_offset + 0.5) * n_bins), 0, n_bins - 1).astype(np.int64)


@dataclass(frozen=True, eq=False, slots=True)
class AliasTable:
    """A chain made ready for sampling: one uniform number and two look-ups per step [2]_."""

    n_bins: int
    # Shape (n_bins * n_bins,). Column k of row i stands for bin k below this fraction of its width ...
    keep: FloatArray
    other: IntArray  # Shape (n_bins * n_bins,). ... and for this bin above it.

    @classmethod
    def of(cls, transition: FloatArray) -> AliasTable:
        """Build from rows of probabilities [-], shape (n_bins, n_bins), each summing to 1."""
        keep, other = zip(*map(_alias_row, transition), strict=True)
        return cls(len(transition), np.concatenate(keep), np.concatenate(other))


def _alias_row(probabilities: FloatArray) -> tuple[FloatArray, IntArray]:
    """What each bin lacks of 1 filled from one that has more: Vose's algorithm [3]_."""
    n = len(probabilities)
    keep, other = (probabilities * n).tolist(), list(range(n))
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
    # A bin of probability 0 that rounding left alone must not be drawn.
    likely = int(np.argmax(probabilities))
    for k in range(n):
        if probabilities[k] == 0.0:
            other[k] = likely if other[k] == k else other[k]
            keep[k] = 0.0
    return np.array(keep), np.array(other, dtype=np.int64)
