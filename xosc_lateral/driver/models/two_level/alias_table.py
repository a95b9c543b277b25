"""A Markov chain made ready for sampling: one uniform number and two look-ups per step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.jit_kernel import JitKernel

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


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
