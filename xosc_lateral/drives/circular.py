"""Columns that wrap around, such as directions: recognised by how they jump, never by their name or unit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

FEW = 8
"""A column with no more different values than this holds levels. [-]"""


def circular_period(drives: Sequence[FloatArray]) -> float:
    """Full circle of a column that wraps around, else 0. [unit of the column]

    It has a value everywhere; it jumps across its whole range again and again, hardly ever by a part of it, and mostly
    moves in small steps. The range is the circle, rounded to 360 or 2 pi when that is within 2 %.

    Parameters
    ----------
    drives : sequence of array
        The column in every drive.
    """
    values = np.concatenate(list(drives))
    if len(values) < 100 or not np.isfinite(values).all():
        return 0.0
    extent = float(values.max() - values.min())
    if extent <= 0.0 or len(np.unique(values)) <= FEW:
        return 0.0
    return _circle(drives, extent)


def _circle(drives: Sequence[FloatArray], extent: float) -> float:
    """That whole range, rounded, if the drives jump across it as a circle makes them, else 0."""
    jump = np.concatenate([np.abs(np.diff(own)) for own in drives]) / extent
    wraps, between = int((jump > 0.9).sum()), int(((jump > 0.25) & (jump <= 0.9)).sum())
    if wraps < 2 or between > 0.3 * wraps or wraps > 0.05 * len(jump):
        return 0.0
    for circle in (360.0, 2.0 * np.pi):
        if abs(extent / circle - 1.0) < 0.02:
            return circle
    return extent
