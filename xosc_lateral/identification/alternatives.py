"""What would explain the rows as well as what was chosen: two columns that go along with each other, say.

References
----------
.. [1] Q. H. Vuong, "Likelihood ratio tests for model selection and non-nested hypotheses", Econometrica 57, 1989.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

Alternatives = tuple[tuple[str, ...], ...]
"""Columns of each effect that explains as much."""

CLEARLY = 1.645
"""Standard errors by which the better of two has to be better: 5 %, one-sided; the better is known to be it. [-]"""


def explains_as_much(chosen: FloatArray, other: FloatArray, observed: FloatArray, cluster: IntArray) -> bool:
    """Whether squared residuals of two regressions differ by no more than they scatter from cluster to cluster [1]_.

    Neither has to be true, nor one a part of the other.

    Parameters
    ----------
    chosen, other : array, shape (n, k) and (n, j)
        White columns of either.
    observed : array, shape (n,)
        White.
    cluster : int array, shape (n,)
        Rows of one cluster are not independent.
    """
    better = _squares(other, observed) - _squares(chosen, observed)
    sums = np.bincount(np.unique(cluster, return_inverse=True)[1], better)
    if len(sums) < 2:
        return True
    error = float(np.sqrt(len(sums)) * np.std(sums, ddof=1))
    return float(sums.sum()) <= CLEARLY * error


def _squares(columns: FloatArray, observed: FloatArray) -> FloatArray:
    sizes = np.linalg.lstsq(columns, observed, rcond=None)[0]
    return np.asarray(np.square(observed - columns @ sizes))
