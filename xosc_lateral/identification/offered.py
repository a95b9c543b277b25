"""Effects of plug-ins as candidates: each says itself what is worth a try on a column."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import EFFECTS, ColumnEffect, known_effects


def offered_effects(column: str, values: NDArray[np.float64]) -> list[ColumnEffect]:
    """What installed plug-ins propose for a column with these values, shape (n,), without coefficients."""
    kinds = [kind for kind in known_effects() if kind not in EFFECTS and issubclass(kind, ColumnEffect)]
    return [effect for kind in kinds for effect in kind.proposals(column, values)]
