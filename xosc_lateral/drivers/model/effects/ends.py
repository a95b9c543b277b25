"""What an effect does between two ends of its column, by evaluating it: the one number that is said of it anywhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.effects.base import ColumnEffect

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
    scatter: float = 0.0  # Standard deviation of the change between drivers. [m] or natural logarithm


def ends_of(effect: ColumnEffect) -> Ends | None:
    """Where an effect is weakest and strongest among the values that it was fitted on (`driven`); None: not known.

    Of two columns, where the second lets the first do most; and what the first does at the second's other end.
    """
    if not effect.driven or not effect.coefficients:
        return None
    columns, grids = effect.columns, [np.array(values, dtype=np.float64) for values in effect.driven]
    points = np.stack([part.ravel() for part in np.meshgrid(*grids, indexing="ij")])
    responses = effect.settled(dict(zip(columns, points, strict=True)))
    table = effect.weighed(responses).reshape(len(grids[0]), -1)
    beside, size = int(np.argmax(np.ptp(table, axis=0))), table.shape[1]
    low, high = _outermost(table[:, beside])
    change = float(table[high, beside] - table[low, beside])
    contrast = responses[high * size + beside] - responses[low * size + beside]
    other = int(np.argmax(np.abs(table[high] - table[low] - change)))

    def held(row: int, column: int) -> dict[str, float]:
        return dict(zip(columns, points[:, row * size + column].tolist(), strict=True))

    return Ends(
        held(low, beside),
        held(high, beside),
        change,
        float(np.linalg.norm(contrast * np.asarray(effect.errors))),
        float(table[high, other] - table[low, other]) if size > 1 else 0.0,
        held(high, other) if size > 1 else None,
        float(np.linalg.norm(contrast * np.asarray(effect.between_drivers))) if effect.between_drivers else 0.0,
    )


def _outermost(strength: FloatArray) -> tuple[int, int]:
    """Numbers of the weakest and the strongest, in the order of the column, as far apart as they are."""
    near = ALIKE * max(float(np.ptp(strength)), 1e-300)
    weak = np.flatnonzero(strength <= strength.min() + near)
    strong = np.flatnonzero(strength >= strength.max() - near)
    apart = np.abs(weak[:, None] - strong)
    first, second = np.unravel_index(int(np.argmax(apart)), apart.shape)
    low, high = sorted((int(weak[first]), int(strong[second])))
    return low, high
