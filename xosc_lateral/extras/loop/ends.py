"""What an effect does between two ends of its column, by evaluation: the one number that words, JSON and page state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.effects import ColumnEffect
from xosc_lateral.extras.loop.timeline import Coarse

DRIVING_QUANTILES = (0.05, 0.95)  # Of a column in these drives: its ends. [-]
GRID = 19  # Quantiles between them at which an effect may be strongest. [-]
SHARE_WITHOUT = 0.05  # Of the time without anybody from which "none" is an end of a column. [-]
FEW = 12  # Different values up to which each is looked at. [-]
ALIKE = 1e-6  # Share of the largest change by which values of a column count as doing the same. [-]


@dataclass(frozen=True, slots=True)
class Ends:
    """From where to where the first column goes, NaN: none; where the second stays; what is different then."""

    low: Mapping[str, float]
    high: Mapping[str, float]
    change: float  # Of the strength, high less low. [m] or natural logarithm
    error: float  # Standard error of it. [m] or natural logarithm
    elsewhere: float = 0.0  # The same change with the second column at its other end. [m] or natural logarithm
    other: Mapping[str, float] | None = None  # That end.


def ends_of(coarse: Coarse, effect: ColumnEffect) -> Ends:
    """Between the ends, of 5 % and 95 % of the time, where an effect is weakest and strongest; of two columns, where
    the second lets the first do most."""
    columns = effect.columns
    grids = [_grid(coarse, name, GRID if len(columns) == 1 else 3) for name in columns]
    points = np.stack([part.ravel() for part in np.meshgrid(*grids, indexing="ij")], axis=1)
    held = [dict(zip(columns, map(float, point), strict=True)) for point in points]
    responses = np.stack([coarse.settled(effect, one) for one in held])
    strength = effect.weighed(responses).reshape([len(grid) for grid in grids])
    table = strength.reshape(len(grids[0]), -1)
    beside = int(np.argmax(np.ptp(table, axis=0)))
    low, high = _outermost(table[:, beside])
    size = table.shape[1]
    first, last = low * size + beside, high * size + beside
    contrast = responses[last] - responses[first]
    change = float(table[high, beside] - table[low, beside])
    error = float(np.linalg.norm(contrast * np.asarray(effect.errors)))
    if size == 1:
        return Ends(held[first], held[last], change, error)
    other = int(np.argmax(np.abs(table[high] - table[low] - change)))
    return Ends(held[first], held[last], change, error, float(table[high, other] - table[low, other]), held[other])


def _outermost(strength: FloatArray) -> tuple[int, int]:
    """Numbers of the weakest and the strongest, in the order of the column, as far apart as they are."""
    near = ALIKE * max(float(np.ptp(strength)), 1e-300)
    weak = np.flatnonzero(strength <= strength.min() + near)
    strong = np.flatnonzero(strength >= strength.max() - near)
    apart = np.abs(weak[:, None] - strong)
    one, other = np.unravel_index(int(np.argmax(apart)), apart.shape)
    low, high = sorted((int(weak[one]), int(strong[other])))
    return low, high


def _grid(coarse: Coarse, name: str, number: int) -> FloatArray:
    """Values of a column between its ends, rising, behind NaN where there often is none."""
    values = coarse.context[name][coarse.timeline.valid]
    seen = values[np.isfinite(values)]
    if not len(seen):
        return np.array([np.nan])
    grid = np.unique(np.quantile(seen, np.linspace(*DRIVING_QUANTILES, number), method="nearest"))
    if len(levels := np.unique(seen)) <= FEW or len(grid) == 1:  # a switch, however rarely it is on
        grid = levels if len(levels) <= FEW else levels[[0, -1]]
    return np.append([np.nan] if len(seen) < (1.0 - SHARE_WITHOUT) * len(values) else [], grid)
