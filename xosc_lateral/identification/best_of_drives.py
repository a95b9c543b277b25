"""The best candidate, or pair of them, for what is left of the drives' levels, and what chance gives.

One number per drive and column: few enough to try every pair. A pair pays for its choice among all pairs, and wins only
by more than that; its two members are one finding with one p-value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.dictionary import NULL_DRAWS
from xosc_lateral.identification.significance import as_one_degree, upper_tail

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

LEAST_APART = 0.1
"""Share of either member's variance that the other must leave: below, the two are one quantity twice. [-]"""


@dataclass(frozen=True, slots=True)
class Best:
    """What explains most.

    Parameters
    ----------
    members : tuple of int
        One candidate, or two.
    p_value : float
        Family-wise over all candidates and pairs.
    """

    members: tuple[int, ...]
    p_value: float


def best_of_drives(
    left: FloatArray,
    counted: BoolArray,
    quantities: FloatArray,
    costs: FloatArray,
    columns: Sequence[str],
    rng: np.random.Generator,
) -> Best:
    """Largest gain in chi-square less what its choice costs, against drives that are dealt anew.

    Parameters
    ----------
    left : array, shape (drives,)
        What is not explained, of variance 1. [-]
    counted : bool array, shape (drives,)
        Drives that are long enough.
    quantities : array, shape (drives, k)
        Candidates, free of what is known, of length 1.
    costs : array, shape (k,)
        Of choosing each among its family.
    columns : sequence of str
        Each candidate's; the two of a pair are of different columns.
    rng : Generator
    """
    rows = np.flatnonzero(counted)
    draws = np.zeros((NULL_DRAWS + 1, len(left)))
    draws[0] = left
    for drawn in draws[1:]:
        drawn[rows] = left[rng.permutation(rows)]
    z = draws @ quantities
    singles = np.square(z) - costs
    pairs = _Pairs.of(quantities, columns)
    scores = np.maximum(singles.max(axis=1), pairs.scores(z))
    p_value = upper_tail(float(scores[0]), scores[1:])
    alone = int(np.argmax(singles[0]))
    return Best((alone,) if singles[0, alone] >= scores[0] else pairs.best(z[0]), p_value)


@dataclass(frozen=True, eq=False, slots=True)
class _Pairs:
    """Pairs of candidates that are two quantities.

    Parameters
    ----------
    first, second : int array, shape (pairs,)
    product : array, shape (pairs,)
        Cosine of the angle between the two.
    """

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    product: FloatArray

    @classmethod
    def of(cls, quantities: FloatArray, columns: Sequence[str]) -> _Pairs:
        names = np.array(columns)
        products = quantities.T @ quantities
        apart = (names[:, None] != names) & (1.0 - np.square(products) >= LEAST_APART)
        first, second = np.nonzero(np.triu(apart, 1))
        return cls(first, second, products[first, second])

    def best(self, z: FloatArray) -> tuple[int, int]:
        """The pair that gains most, of the scores of one draw, shape (k,)."""
        index = int(np.argmax(self._gained(z)))
        return int(self.first[index]), int(self.second[index])

    def scores(self, z: FloatArray) -> FloatArray:
        """Largest gain of a pair, as that of one candidate: chi-square that is as rare with one degree of freedom, less
        the choice among all pairs; shape (draws,) of `z`, shape (draws, k)."""
        if not len(self.first):
            return np.full(len(z), -np.inf)
        gained = np.array([self._gained(drawn).max() for drawn in z])  # one by one: a table of all would fill gigabytes
        return np.asarray(as_one_degree(gained, 2) - 2.0 * np.log(len(self.first)))

    def _gained(self, z: FloatArray) -> FloatArray:
        """Chi-square of two degrees, shape (pairs,)."""
        one, other = z[self.first], z[self.second]
        power = np.square(one) + np.square(other) - 2.0 * self.product * one * other
        return np.asarray(power / (1.0 - np.square(self.product)))
