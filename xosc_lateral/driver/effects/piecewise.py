"""A curve of straight pieces: for a column whose effect bends.

References
----------
.. [1] C. de Boor, "A Practical Guide to Splines", 1978, chapter VIII: truncated powers, here of first degree.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.single_column import SingleColumnEffect
from xosc_lateral.driver.records import set_once
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


class Piecewise(SingleColumnEffect, frozen=True, kw_only=True):
    """The first coefficient is the slope up to the first knot, each further one the change of slope at a knot.

    Parameters
    ----------
    column : str
        Where it is NaN ("there is none"), nothing changes.
    knots : tuple of float
        Increasing. [unit of the column]
    """

    knots: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse knots that don't increase."""
        super().__post_init__()
        set_once(self, knots=tuple(float(knot) for knot in self.knots))
        if not self.knots or not all(low < high for low, high in pairwise(self.knots)):
            raise DriverProfileError(f"effect piecewise of {self.column}: knots {self.knots} must increase")

    @property
    def shape(self) -> str:
        """Word for the report."""
        return f"curve (bends at {', '.join(f'{knot:.4g}' for knot in self.knots)})"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """The column, and how far it is beyond each knot, shape (n, number of knots + 1). [the column's unit]"""
        values = np.asarray(context[self.column], dtype=np.float64)
        return np.stack(
            [values, *(np.where(values > knot, values - knot, 0.0 * values) for knot in self.knots)], axis=1
        )
