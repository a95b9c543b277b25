"""Coarse movement of the paper's model: a first-order Markov chain over bins of the relative offset, smoothed.

Reference: N. Neis, J. Beyerer, arXiv:2405.17080, section III: coarse part kappa of x = kappa + phi.

What the paper leaves open is settled here, so that no bin outside the data's support is ever entered from inside it
and none holds the chain for good. Where in a set of bins the most time was spent and all lead to one another is the
chain's main part:

- A visited bin from which the main part can't be reached (the end of a run, or a trap that was entered and never
  left) gets one more transition, to the main part's nearest bin.
- An unvisited bin, in which a drive can only start, leads one bin towards the nearest visited one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.jit_kernel import JitKernel
from xosc_lateral.errors import DriverProfileError, NotEnoughDataError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

N_BINS = 20
"""Bins of the relative offset over [-0.5, 0.5]. [-]"""


@dataclass(frozen=True, eq=False)  # no slots: what follows from the counts is worked out once
class MarkovChain:
    """Coarse lateral position as a chain over bins of the relative offset.

    Parameters
    ----------
    counts : array of int, shape (n_bins, n_bins)
        Observed transitions: row i, column j: from bin i to bin j in one step.

    Raises
    ------
    DriverProfileError
        If it isn't square, a count is negative, or there is no transition at all.
    """

    counts: IntArray

    def __post_init__(self) -> None:
        """Check, copy and freeze."""
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
    def support(self) -> NDArray[np.bool_]:
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


def fit_markov_chain(rel_offsets: Sequence[FloatArray], *, n_bins: int = N_BINS) -> MarkovChain:
    """Count transitions inside each run; none across two runs.

    Parameters
    ----------
    rel_offsets : sequence of array, shape (n_i,)
        Relative offsets, one array per run, evenly sampled. [-]
    n_bins : int
        Over [-0.5, 0.5].

    Raises
    ------
    NotEnoughDataError
        When there is no transition.
    """
    counts = np.zeros((n_bins, n_bins), dtype=np.int64)
    for run in rel_offsets:
        bins = bin_of(np.asarray(run), n_bins)
        np.add.at(counts, (bins[:-1], bins[1:]), 1)
    if not counts.any():
        raise NotEnoughDataError(f"{len(rel_offsets)} runs hold no two successive offsets: nothing to fit")
    return MarkovChain(counts)


def open_traps(counts: IntArray) -> IntArray:
    """Counts with a way out of every bin that has none; see the module. Shape as `counts`. [-]"""
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


def _reachable(counts: IntArray, start: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Bins that the chain can get to from `start` (itself included)."""
    found = start.copy()
    while True:
        more = found | (counts[found] > 0).any(axis=0)
        if (more == found).all():
            return found
        found = more


def _main_part(counts: IntArray) -> NDArray[np.bool_]:
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


@dataclass(frozen=True, eq=False, slots=True)
class AliasTable:
    """A chain made ready for sampling: one uniform number and two look-ups per step (Walker 1977, Vose 1991).

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


def _walk_body(uniform, drivers, n_bins, keep, other, states):  # type: ignore[no-untyped-def]
    # states: each driver's last state first, then one per driver and step; all arrays flat, step by step
    if drivers == 1:  # the same, faster: the last state stays in a register
        state = states[0]
        for i in range(len(uniform)):
            scaled = uniform[i] * n_bins
            column = int(scaled)
            k = state * n_bins + column
            state = column if scaled - column < keep[k] else other[k]
            states[i + 1] = state
        return
    for i in range(len(uniform)):
        scaled = uniform[i] * n_bins
        column = int(scaled)
        k = states[i] * n_bins + column
        states[i + drivers] = column if scaled - column < keep[k] else other[k]


_walk = JitKernel(_walk_body)


def walk(table: AliasTable, states: IntArray, uniform: FloatArray) -> IntArray:
    """States after each step of chains that run side by side.

    Parameters
    ----------
    table : AliasTable
    states : array of int, shape (drivers,)
        Where they are.
    uniform : array, shape (n, drivers)
        One number in [0, 1) per step and chain. [-]

    Returns
    -------
    array of int, shape (n, drivers)
    """
    m = len(states)
    flat = np.empty(m + uniform.size, dtype=np.int64)
    flat[:m] = states
    _walk(uniform.size, (uniform.ravel(), m, table.n_bins, table.keep, table.other), (flat,))
    return flat[m:].reshape(-1, m)
