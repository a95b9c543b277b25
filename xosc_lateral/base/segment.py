"""The one thing that the driver model and the scenario player share: a road-following segment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.limits import CONTEXT_RANGES

MINIMUM_SPEED = 40.0 / 3.6
"""Below this drives are not fitted (Neis & Beyerer cut their data at 40 km/h), and movement has its own clock. [m/s]"""

CONTEXT_UNITS: Mapping[str, str] = MappingProxyType({name: known.unit for name, known in CONTEXT_RANGES.items()})
"""Of the contexts that a scenario can supply by itself; NaN in their arrays where there is none (no vehicle ahead)."""

FADES = "_fades"
"""Ends the name of a column that says how far another column's is there, 0 to 1, where it comes and goes, as a lane
that opens does: `left_distance_fades` is of `left_distance`. [-]"""


@dataclass(frozen=True, eq=False, slots=True)
class Segment:
    """A road-following segment: a part of one vehicle's motion with no lateral action running, on a uniform time grid.

    Parameters
    ----------
    time : array, shape (n,)
        Uniformly increasing. [s]
    lane_width : array, shape (n,)
        Width of the lane followed. [m]
    speed : array, shape (n,)
        [m/s]
    context : mapping of str to array, shape (n,)
        What the driver may react to (`CONTEXT_UNITS` and other names); NaN where there is nothing (no leader).
        A name that is absent has no effect.
    before, after : int
        Rows at the start and at the end of the arrays that lie outside the segment: context only, no offsets are
        sampled there. Effects that look ahead or respond slowly need what comes after and what went before.
    """

    time: FloatArray
    lane_width: FloatArray
    speed: FloatArray
    context: Mapping[str, FloatArray] = field(default_factory=dict)
    before: int = 0
    after: int = 0

    def __post_init__(self) -> None:
        """Copy and freeze the arrays; refuse unequal lengths."""
        n = len(self.time)
        for name in ("time", "lane_width", "speed"):
            object.__setattr__(self, name, _frozen(getattr(self, name), name, n))
        context = {name: _frozen(values, name, n) for name, values in self.context.items()}
        object.__setattr__(self, "context", MappingProxyType(context))
        if self.before < 0 or self.after < 0 or self.before + self.after > n:
            raise ValueError(f"{self.before} rows before and {self.after} after a segment in {n} rows")

    @classmethod
    def even(cls, duration: float, step: float, lane_width: float, speed: float) -> Segment:
        """Free driving at one speed [m/s] in a lane of one width [m], for so long, at this step. [s]"""
        n = round(duration / step) + 1
        return cls(step * np.arange(n, dtype=np.float64), np.full(n, lane_width), np.full(n, speed))

    def at(self, rows: IntArray) -> Segment:
        """With these rows of its inside, shape (k,), a step apart in time, in place of all: as on another clock."""
        around = np.arange(self.before), np.arange(self.inside.stop, len(self))
        taken = np.concatenate((around[0], self.before + rows, around[1]))
        time = self.time[0] + (self.time[1] - self.time[0]) * np.arange(len(taken))
        context = {name: values[taken] for name, values in self.context.items()}
        return Segment(time, self.lane_width[taken], self.speed[taken], context, self.before, self.after)

    def __len__(self) -> int:
        return len(self.time)

    @property
    def inside(self) -> slice:
        """Rows of the segment itself."""
        return slice(self.before, len(self.time) - self.after)


def _frozen(values: FloatArray, name: str, n: int) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    if array.shape != (n,):
        raise ValueError(f"{name}: shape {array.shape}, expected ({n},)")
    array.flags.writeable = False
    return array
