"""Drives on the loop's grid whose movement and columns are known, without a simulator and without files."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import lfilter

from xosc_lateral.extras.loop.timeline import PAD, Coarse, Timeline

STEP = 0.2
SPREAD = 0.1
"""Of the movement. [m]"""


def wander(rng: np.random.Generator, n: int, seconds: float) -> np.ndarray:
    """First-order movement of variance 1 with a memory, at 5 Hz, stationary from the start."""
    keep = np.exp(-STEP / seconds)
    noise = np.sqrt(1.0 - keep**2) * rng.normal(size=n)
    noise[0] /= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], noise))


def movement(rng: np.random.Generator, seconds: float, memory: float = 5.0) -> np.ndarray:
    """Of 0.1 m."""
    return SPREAD * wander(rng, round(seconds / STEP), memory)


def timeline_of(
    offset: np.ndarray,
    context: Mapping[str, np.ndarray] | None = None,
    *,
    drives: int = 1,
    valid: np.ndarray | None = None,
    levels: frozenset[str] = frozenset(),
) -> Timeline:
    """Drives of equal length side by side; their first and last 15 s are context alone, as in the loop."""
    n = len(offset)
    length = n // drives
    inside = np.ones(n, dtype=bool) if valid is None else valid.copy()
    for first in range(0, n, length):
        inside[first : first + PAD] = inside[first + length - PAD : first + length] = False
    drive = np.repeat(np.arange(drives), length).astype(np.intp)
    time = STEP * (np.arange(n) % length - PAD)
    names = tuple(f"d{k}" for k in range(drives))
    return Timeline(
        names, drive, time, np.where(inside, offset, 0.0), inside, np.full(n, 3.6), dict(context or {}), levels
    )


def coarse_of(
    offset: np.ndarray,
    context: Mapping[str, np.ndarray] | None = None,
    *,
    drives: int = 1,
    valid: np.ndarray | None = None,
) -> Coarse:
    """The same by the second."""
    return Coarse.of(timeline_of(offset, context, drives=drives, valid=valid))
