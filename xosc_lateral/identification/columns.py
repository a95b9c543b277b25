"""What kind of quantity each context column holds, read from its values alone, and which ones can't tell anything."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.roles import Role
from xosc_lateral.identification.timeline import Timeline

FloatArray = NDArray[np.float64]

MAX_LEVELS = 8
"""More different whole numbers than this are a number, not levels. [-]"""

MIN_SHARE = 0.004
"""A level or presence on for less than this share of the road-following time (12 s of 50 min) tells nothing. [-]"""


class Values(Enum):
    """What values a column has: they say how it can act."""

    NUMBER = "number"
    SWITCH = "switch"
    LEVELS = "levels"
    ANGLE = "angle"


@dataclass(frozen=True, slots=True)
class Column:
    """One context column that varies.

    Parameters
    ----------
    name : str
        Column.
    values : Values
        How it can act.
    gaps : bool
        NaN ("there is none") occurs often enough to tell.
    levels : tuple of float
        Values, for a switch or levels; those that are rare left out.
    period : float
        Full circle of an angle, else 0.
    role : Role
        What it is.
    """

    name: str
    values: Values
    gaps: bool
    levels: tuple[float, ...] = ()
    period: float = 0.0
    role: Role = Role.UNKNOWN


def known_columns(timeline: Timeline) -> tuple[list[Column], dict[str, str]]:
    """Columns worth looking at, in alphabetical order, and why the others aren't.

    `lane_width` is always among them: it follows from the measured distances.
    """
    found, unused = [], {}
    context = {"lane_width": timeline.lane_width, **timeline.context}
    for name in sorted(context):
        column = read_column(name, context[name][timeline.valid], timeline.periods.get(name, 0.0))
        if isinstance(column, str):
            unused[name] = column
        else:
            found.append(column)
    return found, unused


def read_column(name: str, seen: FloatArray, period: float) -> Column | str:
    """What a column holds, from its values while road-following, shape (n,), and its full circle; or why it tells
    nothing."""
    there = np.isfinite(seen)
    share = float(there.mean())
    if share < MIN_SHARE:
        return "it is empty"
    values = seen[there]
    gaps = MIN_SHARE <= share <= 1.0 - MIN_SHARE
    if period > 0.0:
        return Column(name, Values.ANGLE, gaps, period=period)
    low, high = np.quantile(values, [MIN_SHARE, 1.0 - MIN_SHARE])
    levels = _levels(values)
    if len(levels) == 1 or (not levels and high - low <= 1e-9 * max(1e-9, abs(low), abs(high))):
        return Column(name, Values.NUMBER, True) if gaps and not levels else "it hardly varies"
    if len(levels) > MAX_LEVELS or not levels:
        return Column(name, Values.NUMBER, gaps)
    return Column(name, Values.SWITCH if len(levels) == 2 else Values.LEVELS, gaps, levels)


def _levels(values: FloatArray) -> tuple[float, ...]:
    """Values that occur often enough, when nearly all rows have one of a few."""
    levels, counts = np.unique(values, return_counts=True)
    often = counts >= MIN_SHARE * len(values)
    if counts[often].sum() < (1.0 - MIN_SHARE) * len(values) or often.sum() > MAX_LEVELS:
        return ()
    return tuple(float(level) for level in levels[often])
