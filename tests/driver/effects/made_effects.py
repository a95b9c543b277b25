"""Effects with round numbers, and their strength on rows of context."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np

from xosc_lateral.driver.effects import Acts, ColumnEffect

STEP = 0.2

C = TypeVar("C", bound=ColumnEffect)


def made(kind: type[C], *coefficients: float, acts: Acts = Acts.LOCATION, **fields: Any) -> C:
    """With coefficients, errors of a tenth of them, and nothing as the reference."""
    sizes = coefficients or (1.0,)
    known = {"errors": tuple(0.1 * abs(size) for size in sizes), "reference": (0.0,) * len(sizes)}
    return kind(acts=acts, coefficients=sizes, **known | fields)


def strength(effect: ColumnEffect, **context: object) -> np.ndarray:
    """Shape (n,); the columns are there."""
    found = effect.strength(STEP, {name: np.asarray(values, dtype=np.float64) for name, values in context.items()})
    assert found is not None
    return found


def quantity(effect: ColumnEffect, **context: object) -> np.ndarray:
    """Shape (n, k)."""
    return effect.quantity({name: np.asarray(values, dtype=np.float64) for name, values in context.items()})
