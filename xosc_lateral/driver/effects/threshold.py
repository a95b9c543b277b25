"""Nothing up to a limit, then a jump (step) or a slope (hinge)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.single_column import SingleColumnEffect

FloatArray = NDArray[np.float64]


class Threshold(SingleColumnEffect, frozen=True, kw_only=True):
    """Acts beyond a limit only.

    Parameters
    ----------
    column : str
        Where it is NaN ("there is none"), it counts as on the side that does not act.
    at : float
        The limit. [unit of the column]
    above : bool
        Whether it acts above the limit, or below.
    jump : bool
        True: as a whole at once; False: in proportion to the distance from the limit.
    """

    at: float
    above: bool = True
    jump: bool = True

    @property
    def levels_off(self) -> bool:
        """A step does."""
        return self.jump

    @property
    def shape(self) -> str:
        """Word for the report."""
        return f"threshold ({'step' if self.jump else 'hinge'} {'above' if self.above else 'below'} {self.at:.4g})"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """0 on the quiet side, 1 [-] or the distance from the limit [column's unit] on the other; shape (n, 1)."""
        beyond = (context[self.column] - self.at) * (1.0 if self.above else -1.0)
        with np.errstate(invalid="ignore"):
            return np.where(beyond > 0, 1.0 if self.jump else beyond, 0.0)[:, None]
