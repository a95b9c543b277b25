"""What an effect does between two ends of its column, by evaluating it: the one number that is said of it anywhere."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.effects.base import ColumnEffect, Effect

ALIKE = 1e-6  # Share of the largest change by which values of a column count as doing the same. [-]


@dataclass(frozen=True, slots=True)
class Ends:
    """From where to where the first column goes, NaN: none; where the others stay; what is different then."""

    low: Mapping[str, float]
    high: Mapping[str, float]
    change: float  # Of the strength, high less low. [m] or natural logarithm
    error: float  # Standard error of it. [m] or natural logarithm
    elsewhere: float = 0.0  # The same change with the second column at its other end. [m] or natural logarithm
    other: Mapping[str, float] | None = None  # That end.
    scatter: float = 0.0  # Standard deviation of the change between drivers. [m] or natural logarithm


def ends_of(effect: ColumnEffect, profile: Iterable[Effect] = ()) -> Ends | None:
    """Where an effect is weakest and strongest among the values that it was fitted on (`driven`); None: not known.

    Of two columns, where the second lets the first do most; and what the first does at the second's other end.
    What others of a `profile` do by the same columns comes with it, a product beside what its columns do alone: it is
    said of all together, for that is what the profile does. Columns that only the others read stay in the middle.
    """
    if not effect.driven or not effect.coefficients:
        return None
    together = [effect, *(one for one in profile if isinstance(one, ColumnEffect) and _goes_along(one, effect))]
    grids = [np.array(values, dtype=np.float64) for values in effect.driven]
    points = np.stack([part.ravel() for part in np.meshgrid(*grids, indexing="ij")])
    places = dict(zip(effect.columns, points, strict=True))
    for other in together:
        for name, values in zip(other.columns, other.driven, strict=True):
            places.setdefault(name, np.full(points.shape[1], np.array(values, dtype=np.float64)[len(values) // 2]))
    responses = [one.settled({name: places[name] for name in one.columns}) for one in together]
    strengths = [one.weighed(response) for one, response in zip(together, responses, strict=True)]
    table = np.sum(strengths, axis=0).reshape(len(grids[0]), -1)
    beside, size = int(np.argmax(np.ptp(table, axis=0))), table.shape[1]
    low, high = _outermost(table[:, beside])
    change = float(table[high, beside] - table[low, beside])
    contrasts = [response[high * size + beside] - response[low * size + beside] for response in responses]
    other_end = int(np.argmax(np.abs(table[high] - table[low] - change)))

    def held(row: int, column: int) -> dict[str, float]:
        return {name: float(values[row * size + column]) for name, values in places.items()}

    return Ends(
        held(low, beside),
        held(high, beside),
        change,
        float(
            np.linalg.norm([np.linalg.norm(apart * one.errors) for apart, one in zip(contrasts, together, strict=True)])
        ),
        float(table[high, other_end] - table[low, other_end]) if size > 1 else 0.0,
        held(high, other_end) if size > 1 else None,
        float(np.linalg.norm(contrasts[0] * np.asarray(effect.between_drivers))) if effect.between_drivers else 0.0,
    )


def _goes_along(other: ColumnEffect, effect: ColumnEffect) -> bool:
    """Whether another effect of a profile, of known ends, does something of the same by a column that both read."""
    known = other.acts is effect.acts and bool(other.driven and other.coefficients)
    return known and not set(other.columns).isdisjoint(effect.columns) and other != effect


def _outermost(strength: FloatArray) -> tuple[int, int]:
    """Numbers of the weakest and the strongest, in the order of the column, as far apart as they are."""
    near = ALIKE * max(float(np.ptp(strength)), 1e-300)
    weak = np.flatnonzero(strength <= strength.min() + near)
    strong = np.flatnonzero(strength >= strength.max() - near)
    apart = np.abs(weak[:, None] - strong)
    first, second = np.unravel_index(int(np.argmax(apart)), apart.shape)
    low, high = sorted((int(weak[first]), int(strong[second])))
    return low, high
