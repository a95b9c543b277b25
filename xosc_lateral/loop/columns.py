"""What kind of quantity each context column holds, and which ones can't tell anything."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.loop.timeline import Timeline, is_direction

FloatArray = NDArray[np.float64]

MAX_LEVELS = 8
"""More different whole numbers than this are a number, not levels. [-]"""

MIN_SHARE = 0.004
"""A level or presence on for less than this share of the road-following time (12 s of 50 min) tells nothing. [-]"""


class Role(Enum):
    """How a column can act."""

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
    role : Role
        How it can act.
    gaps : bool
        NaN ("there is none") occurs often enough to tell.
    distance : bool
        It has gaps and is never negative: near may matter more than far.
    levels : tuple of float
        Values, for a switch or levels; those that are rare left out.
    period : float
        Full circle of an angle, else 0.
    """

    name: str
    role: Role
    gaps: bool
    distance: bool
    levels: tuple[float, ...] = ()
    period: float = 0.0


def known_columns(timeline: Timeline) -> tuple[list[Column], dict[str, str]]:
    """Columns worth looking at, and why the others aren't.

    `lane_width` is always among them: it follows from the measured distances.
    """
    found, unused = [], {}
    context = {"lane_width": timeline.lane_width, **timeline.context}
    for name, values in context.items():
        seen = values[timeline.valid]
        column = _column(name, seen, name in timeline.levels)
        if isinstance(column, str):
            unused[name] = column
        else:
            found.append(column)
    return found, unused


def _column(name: str, seen: FloatArray, whole: bool) -> Column | str:
    there = np.isfinite(seen)
    share = float(there.mean())
    if share < MIN_SHARE:
        return "it is empty"
    values = seen[there]
    gaps = MIN_SHARE <= share <= 1.0 - MIN_SHARE
    period = is_direction(name, values)
    if period is not None:
        return Column(name, Role.ANGLE, gaps, False, period=period)
    low, high = np.quantile(values, [MIN_SHARE, 1.0 - MIN_SHARE])
    levels = _levels(values) if whole or _is_whole(values) else ()
    if len(levels) == 1 or (not levels and high - low <= 1e-9 * max(1.0, abs(low))):
        return "presence only" if gaps and not levels else "it hardly varies"
    role = Role.NUMBER if not levels or len(levels) > MAX_LEVELS else Role.SWITCH if len(levels) == 2 else Role.LEVELS
    distance = gaps and float(values.min()) >= 0.0 and role is Role.NUMBER
    return Column(name, role, gaps, distance, levels if role is not Role.NUMBER else ())


def _is_whole(values: FloatArray) -> bool:
    return bool(np.all(values == np.rint(values)))


def _levels(values: FloatArray) -> tuple[float, ...]:
    levels, counts = np.unique(np.rint(values), return_counts=True)
    return tuple(float(level) for level, count in zip(levels, counts, strict=True) if count >= MIN_SHARE * len(values))
