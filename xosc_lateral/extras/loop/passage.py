"""A typical passage of a column, a bend of the usual sharpness and length, say, and the car's path through it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, true_slices
from xosc_lateral.drivers.model.effects import ColumnEffect
from xosc_lateral.extras.loop.columns import MIN_SHARE
from xosc_lateral.extras.loop.timeline import COARSE, Coarse

BEFORE_S, AFTER_S = 10.0, 20.0  # What is shown before a passage begins and after it ends: all delays. [s]
LONGEST_S = 60.0  # Where a column stays for longer, all that there is to see is seen by then. [s]


@dataclass(frozen=True, eq=False)
class Passage:
    """A column on the 0.2 s grid that goes from its usual value to a high one and back, and the car's path."""

    column: FloatArray = field(repr=False)  # shape (fine n,), in its own unit.
    usual: float
    high: float
    lasts_s: float
    path: FloatArray = field(default_factory=lambda: np.zeros(0), repr=False)  # shape (n,): Against before it. [m]
    error: FloatArray = field(default_factory=lambda: np.zeros(0), repr=False)  # shape (n,): Standard error. [m]

    @property
    def time(self) -> FloatArray:
        """Of the path, from where the column begins to change. [s] Shape (n,)."""
        return np.asarray(np.arange(len(self.path)) - BEFORE_S, dtype=np.float64)

    @property
    def at(self) -> int:
        """Second of the path at which the car is farthest."""
        return int(np.argmax(np.abs(self.path)))

    @property
    def largest_shift(self) -> tuple[float, float]:
        """The farthest that the car goes, to the left, and its standard error. [m]"""
        return float(self.path[self.at]), float(self.error[self.at])


def typical_passage(coarse: Coarse, effect: ColumnEffect) -> Passage:
    """From a column's median to its farther outer quantile, or from none to it, as long and steep as usual."""
    timeline = coarse.timeline
    values = coarse.context[effect.columns[0]]
    known = timeline.valid & np.isfinite(values)
    if known.sum() < (1.0 - MIN_SHARE) * timeline.valid.sum():
        lasts, middle = _median_length(np.isfinite(values), timeline.step), float(np.median(values[known]))
        time = timeline.step * np.arange(COARSE * int(np.ceil(BEFORE_S + lasts + AFTER_S))) - BEFORE_S
        return Passage(np.where((time >= 0.0) & (time < lasts), middle, np.nan), np.nan, middle, lasts)
    low, usual, high = np.quantile(values[known], [0.05, 0.5, 0.95])
    high = low if usual - low > 2.0 * (high - usual) else high
    if high == usual:  # a switch that is on now and then
        high = float(values[known].max() if values[known].max() > usual else values[known].min())
    away = np.abs(np.where(np.isfinite(values), values, usual) - usual) / max(abs(high - usual), 1e-300)
    lasts, wide, narrow = (_median_length(away > share, timeline.step) for share in (0.5, 0.25, 0.75))
    ramp = min(max(wide - narrow, timeline.step), lasts)
    knots = BEFORE_S + np.array([0.0, ramp, lasts, lasts + ramp])
    time = timeline.step * np.arange(COARSE * int(np.ceil(knots[-1] + AFTER_S)))
    return Passage(np.interp(time, knots, [usual, high, high, usual]), float(usual), float(high), float(lasts))


def _median_length(there: BoolArray, step: float) -> float:
    """Length of the stretch that a second of all stretches lies in, in the median, at most `LONGEST_S`. [s]"""
    lengths = np.sort([0.0, *((rows.stop - rows.start) * step for rows in true_slices(there))])
    return min(float(lengths[np.searchsorted(np.cumsum(lengths), 0.5 * lengths.sum())]), LONGEST_S)
