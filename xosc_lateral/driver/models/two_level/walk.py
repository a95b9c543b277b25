"""Chains that run side by side, step by step: the inner loop of sampling."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.jit_kernel import JitKernel
from xosc_lateral.driver.models.two_level.alias_table import AliasTable

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


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
