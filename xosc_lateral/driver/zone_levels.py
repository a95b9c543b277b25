"""How loud each zone is: a random effect beside that of the driver who passes it.

One observation for each passage: y = fixed effects + zone + driver + rest. Variances by the fitting of constants, zones
by best linear unbiased prediction, so that few passages move a zone little and what chance makes stays 0. Of zones that
no driver has in common, as both carriageways of a road, nothing but how much drivers differ tells whether it is the
zones or those who pass them: such parts of a recording have a level of their own, shrunk by that.

References
----------
.. [1] S. R. Searle, G. Casella, C. E. McCulloch, "Variance Components", 1992: section 5.5, Henderson's method III;
       section 7.4, prediction of random effects by the mixed model equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEAST_DRIVES = 30
"""Drives that must have passed, as of a population (`place`): with fewer, whose level it is can't be told. [-]"""

SIGNIFICANCE = 0.01
"""Zones whose differences chance makes as large as this often are alike. [-]"""


@dataclass(frozen=True, eq=False)
class Passages:
    """What was seen of each passage of a zone.

    Parameters
    ----------
    level : array, shape (n,)
        Logarithm of a power. [-]
    zone : sequence of str, length n
    drive : sequence of str, length n
    beside : array, shape (n, k)
        What else the level may go with, linearly.
    """

    level: FloatArray
    zone: Sequence[str]
    drive: Sequence[str]
    beside: FloatArray


@dataclass(frozen=True, eq=False)
class Levels:
    """Level of each zone about the mean of all passages.

    Parameters
    ----------
    names : tuple of str
        Sorted.
    values, errors : array, shape (zones,)
        Predicted, and their standard errors. [-]
    """

    names: tuple[str, ...]
    values: FloatArray
    errors: FloatArray


def zone_levels(seen: Passages) -> Levels | None:
    """Levels of the zones; None where there are too few drives or zones, or chance makes as much."""
    names, zone = np.unique(np.asarray(seen.zone, dtype=np.str_), return_inverse=True)
    drives, drive = np.unique(np.asarray(seen.drive, dtype=np.str_), return_inverse=True)
    if len(names) < 2 or len(drives) < LEAST_DRIVES or len(seen.level) <= len(names) + len(drives) + 1:
        return None
    part = _parts(zone, drive, len(names), len(drives))
    parts = int(part.max()) + 1
    fixed = np.column_stack([part[zone][:, None] == np.arange(parts), seen.beside]).astype(np.float64)
    model = _Crossed(seen.level, fixed, zone, drive, len(names), len(drives))
    variance = model.variances()
    if variance is None:
        return None
    values, errors, means, covariance = model.predicted(*variance, parts)
    above, doubt = _shrunk_parts(means, covariance)
    values, errors = values + above[part], np.hypot(errors, doubt[part])
    return Levels(tuple(map(str, names)), values - float(values[zone].mean()), errors)


def _parts(zone: IntArray, drive: IntArray, zones: int, drives: int) -> IntArray:
    """Part of the recording that each zone belongs to, shape (zones,): those of one part are linked by drives."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ones, size = np.ones(len(zone)), zones + drives
    links = coo_array((ones, (zone, zones + drive)), shape=(size, size))
    return np.unique(connected_components(links, directed=False)[1][:zones], return_inverse=True)[1]


def _shrunk_parts(means: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Level of each part above their mean, shrunk by what chance makes of it, and its standard error. [-]"""
    count = len(means)
    centre = np.eye(count) - 1.0 / count
    above, error = centre @ means, np.diag(centre @ covariance @ centre)
    between = max(float(above @ above - error.sum()), 0.0) / max(count - 1, 1)
    share = between / np.maximum(between + error, 1e-30)
    return share * above, np.sqrt(share * error)


class _Crossed:
    """Normal equations of fixed effects, drives and zones, in this order."""

    def __init__(
        self, y: FloatArray, fixed: FloatArray, zone: IntArray, drive: IntArray, zones: int, drives: int
    ) -> None:
        from scipy.sparse import coo_array, hstack

        rows, ones = np.arange(len(y)), np.ones(len(y))
        design = hstack(
            [
                coo_array(fixed),
                coo_array((ones, (rows, drive)), shape=(len(y), drives)),
                coo_array((ones, (rows, zone)), shape=(len(y), zones)),
            ]
        ).tocsr()
        self._gram: FloatArray = np.asarray((design.T @ design).todense())
        self._moment: FloatArray = np.asarray(design.T @ y)
        self._square, self._n = float(y @ y), len(y)
        self._fixed, self._drives, self._zones = fixed.shape[1], drives, zones

    def variances(self) -> tuple[float, float, float] | None:
        """Of zones, drives and the rest; None where the zones' is none beyond chance. [-]"""
        from scipy.stats import f as f_distribution

        before = self._fixed + self._drives
        every = np.arange(len(self._gram))
        without_zones, without_drives = every[:before], np.concatenate([every[: self._fixed], every[before:]])
        left, rank = self._left(every)
        rest = left / max(self._n - rank, 1)
        by_zone, rank_before = self._left(without_zones)
        freedom = rank - rank_before
        if freedom < 1 or rest <= 0.0:
            return None
        ratio = (by_zone - left) / freedom / rest
        if f_distribution.sf(ratio, freedom, self._n - rank) > SIGNIFICANCE:
            return None
        zones = max(by_zone - left - rest * freedom, 0.0) / self._amount(without_zones, every[before:])
        by_drive, rank_before = self._left(without_drives)
        drives = max(by_drive - left - rest * (rank - rank_before), 0.0)
        return zones, drives / self._amount(without_drives, every[self._fixed : before]), rest

    def _left(self, used: IntArray) -> tuple[float, int]:
        """Sum of squares that these columns leave, and their rank."""
        gram, moment = self._gram[np.ix_(used, used)], self._moment[used]
        values, vectors = np.linalg.eigh(gram)
        kept = values > 1e-10 * values[-1]
        part = vectors[:, kept].T @ moment
        return self._square - float(part @ (part / values[kept])), int(kept.sum())

    def _amount(self, others: IntArray, own: IntArray) -> float:
        """Trace of the own columns' squares once the others are taken out of them: what a unit of variance adds."""
        cross = self._gram[np.ix_(others, own)]
        inverse = np.linalg.pinv(self._gram[np.ix_(others, others)], hermitian=True)
        return max(float(np.trace(self._gram[np.ix_(own, own)]) - (cross * (inverse @ cross)).sum()), 1e-12)

    def predicted(
        self, zones: float, drives: float, rest: float, parts: int
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Level of each zone in its part, and its standard error; levels of the parts, and their covariance. [-]"""
        first, before = self._fixed, self._fixed + self._drives
        penalty = np.zeros(len(self._gram))
        penalty[first:before] = rest / max(drives, 1e-12)
        penalty[before:] = rest / max(zones, 1e-12)
        inverse = np.asarray(np.linalg.pinv(self._gram + np.diag(penalty), hermitian=True), dtype=np.float64)
        found = inverse @ self._moment
        errors: FloatArray = np.sqrt(rest * np.diag(inverse)[before:])
        return found[before:], errors, found[:parts], rest * inverse[:parts, :parts]
