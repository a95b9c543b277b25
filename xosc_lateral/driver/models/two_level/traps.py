"""Bins that a chain would never leave, opened.

What the paper leaves open is settled here, so that no bin outside the data's support is ever entered from inside it
and none holds the chain for good. Where in a set of bins the most time was spent and all lead to one another is the
chain's main part:

- A visited bin from which the main part can't be reached (the end of a run, or a trap that was entered and never
  left) gets one more transition, to the main part's nearest bin.
- An unvisited bin, in which a drive can only start, leads one bin towards the nearest visited one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]


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
