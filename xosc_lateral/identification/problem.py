"""One linear regression on white rows: what every test of a column comes down to.

Generalised least squares [1]_: both sides are whitened, then it is an ordinary one.

References
----------
.. [1] A. C. Aitken, "On least squares and linear combination of observations", Proc. R. Soc. Edinburgh 55, 1936.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.autocorrelation import Whitener, fit_autoregression
from xosc_lateral.identification.innovations import ORDER
from xosc_lateral.identification.regression import Coarse

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SQUARES_S = 12
"""Past seconds of the squares that whitening sees: two time constants of the clusters of 6 s that are no regime. Beyond
`ORDER`, as means. Sensitivity: docs/design/identification.md. [s]"""


@dataclass(frozen=True, eq=False)
class Problem:
    """One linear regression.

    Parameters
    ----------
    whitener : Whitener
        For series and columns.
    series : array, shape (n,)
        With what the model has of this component still in.
    columns : array, shape (n, k)
        What the model has already.
    """

    whitener: Whitener
    series: FloatArray
    columns: FloatArray

    @property
    def valid(self) -> BoolArray:
        """Rows that count, shape (n,)."""
        return self.whitener.valid

    @cached_property
    def observed(self) -> FloatArray:
        """White series, levels out, shape (seconds,), valid ones only. [-]"""
        return self.rows(self.series)

    @cached_property
    def known(self) -> FloatArray:
        """White columns, shape (seconds, k). [-]"""
        return self.rows(self.columns)

    def rows(self, values: FloatArray) -> FloatArray:
        """White rows [-] of series or columns, shape (n,) or (n, k); valid ones only."""
        return self.whitener.compact.rows(values[self.valid])


def of_squares(coarse: Coarse, squares: FloatArray, valid: BoolArray, columns: FloatArray) -> Problem:
    """Regression of squares [-], shape (n,), on columns, shape (n, k), that may make them larger.

    Squares come in clusters of seconds, which whitening takes out. Loud and quiet minutes it leaves: they are what a
    slow column does (an autoregression that sees them takes half of the effect of rain for memory), and where no column
    does it, the null keeps them too.
    """
    left = squares
    if columns.shape[1]:
        design = columns - columns[valid].mean(axis=0)
        left = squares - design @ np.linalg.lstsq(design[valid], squares[valid], rcond=None)[0]
    process = fit_autoregression(np.where(valid, left, 0.0), valid, min(ORDER, SQUARES_S), longest=SQUARES_S)
    return Problem(Whitener(process, valid, coarse.drive, np.ones(len(coarse))), squares, columns)
