"""How loud each zone is: a random effect beside that of the driver who passes it.

One observation for each passage: y = fixed effects + zone + driver + rest. Variances by the fitting of constants, zones
by best linear unbiased prediction, so that few passages move a zone little and what chance makes stays 0. Of zones that
no driver has in common, as both carriageways of a road, nothing but how much drivers differ says whether it is the
zones or those who pass them: such parts of a recording have a level of their own, shrunk by that.

References
----------
.. [1] S. R. Searle, G. Casella, C. E. McCulloch, "Variance Components", 1992: section 5.5, Henderson's method III;
       section 7.4, prediction of random effects by the mixed model equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drives.zones import numbered

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEAST_DRIVES = 30
"""Fewer are no population: whose zone or lane it was, and who he is, can't be separated. As many are to have had a
neighbour: errors clustered by drive are too small where few have one (where nothing acts, 90, 8 and 7 % of the
effects are beyond two of their errors if 1, 5 and 20 of 60 drives do). [-]"""

RANK = 1e-10
"""Mean square of a column, as large as an indicator, below which it is a sum of others. [-]"""

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
    names, zone = numbered(seen.zone)
    drives, drive = numbered(seen.drive)
    if len(names) < 2 or len(drives) < LEAST_DRIVES or len(seen.level) <= len(names) + len(drives) + 1:
        return None
    part = _parts(zone, drive, len(names), len(drives))
    parts = int(part.max()) + 1
    spread = seen.beside.std(axis=0)
    beside = (seen.beside - seen.beside.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)  # as large as indicators
    fixed = np.column_stack([part[zone][:, None] == np.arange(parts), beside]).astype(np.float64)
    model = _Crossed(seen.level, fixed, zone, drive, len(names), len(drives))
    variance = model.variances()
    if variance is None:
        return None
    values, errors, means, covariance = model.predicted(*variance, parts)
    above, doubt = _shrunk_parts(means, covariance)
    values, errors = values + above[part], np.hypot(errors, doubt[part])
    return Levels(tuple(names), values - float(values[zone].mean()), errors)


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
    """Normal equations of fixed effects and zones, in this order, with those of the drives worked into them.

    Of the drives, of which a recording may have very many, nothing but counts is kept: their block is diagonal.
    """

    def __init__(
        self, y: FloatArray, fixed: FloatArray, zone: IntArray, drive: IntArray, zones: int, drives: int
    ) -> None:
        from scipy.sparse import coo_array, hstack

        rows, ones = np.arange(len(y)), np.ones(len(y))
        by_drive = coo_array((ones, (drive, rows)), shape=(drives, len(y))).tocsr()
        design = hstack([coo_array(fixed), coo_array((ones, (rows, zone)), shape=(len(y), zones))]).tocsr()
        y = y - y.mean()
        self._gram = _dense(design.T @ design)
        self._moment = np.asarray(design.T @ y)
        self._square, self._n = float(y @ y), len(y)
        self._count = np.bincount(drive, minlength=drives).astype(np.float64)
        self._sums: Any = by_drive @ design
        self._sums_of_y = np.asarray(by_drive @ y)
        self._fixed, self._drives = fixed.shape[1], drives

    def _without_drives(self, penalty: float = 0.0) -> tuple[FloatArray, FloatArray, float]:
        """Normal equations, and the sum of squares, that drives of a prior variance leave; none: whatever they are."""
        share = 1.0 / (self._count + penalty)
        weighted: Any = self._sums.T.multiply(share[None, :])
        gram = self._gram - _dense(weighted @ self._sums)
        moment = self._moment - np.asarray(weighted @ self._sums_of_y)
        return gram, moment, self._square - float(share @ self._sums_of_y**2)

    def variances(self) -> tuple[float, float, float] | None:
        """Of zones, drives and the rest; None where the zones' is none beyond chance. [-]"""
        from scipy.stats import f as f_distribution

        gram, moment, square = self._without_drives()
        first = slice(0, self._fixed)
        explained, rank, _ = _solved(gram, moment, self._n)
        by_fixed, rank_fixed, inverse = _solved(gram[first, first], moment[first], self._n)
        left, freedom = square - explained, rank - rank_fixed
        rows = self._n - self._drives - rank
        if freedom < 1 or rows < 1 or left <= 0.0:
            return None
        rest, explained_by = left / rows, explained - by_fixed
        if f_distribution.sf(explained_by / freedom / rest, freedom, rows) > SIGNIFICANCE:
            return None
        cross = gram[first, self._fixed :]
        amount = float(np.trace(gram[self._fixed :, self._fixed :]) - (cross * (inverse @ cross)).sum())
        zones = max(explained_by - rest * freedom, 0.0) / max(amount, 1e-12)

        explained, rank_zones, inverse = _solved(self._gram, self._moment, self._n)
        remaining = self._square - explained - left
        amount = self._n - float((inverse * _dense(self._sums.T @ self._sums)).sum())
        drives = max(remaining - rest * (self._drives + rank - rank_zones), 0.0) / max(amount, 1e-12)
        return zones, drives, rest

    def predicted(
        self, zones: float, drives: float, rest: float, parts: int
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Level of each zone in its part, and its standard error; levels of the parts, and their covariance. [-]"""
        gram, moment, _ = self._without_drives(rest / max(drives, 1e-12))
        gram[np.arange(self._fixed, len(gram)), np.arange(self._fixed, len(gram))] += rest / max(zones, 1e-12)
        _, _, inverse = _solved(gram, moment, self._n)
        found = inverse @ moment
        errors = np.asarray(np.sqrt(rest * np.diag(inverse)[self._fixed :]), dtype=np.float64)
        return found[self._fixed :], errors, found[:parts], rest * inverse[:parts, :parts]


def _dense(matrix: Any) -> FloatArray:
    return np.asarray(matrix.todense(), dtype=np.float64)


def _solved(gram: FloatArray, moment: FloatArray, n: int) -> tuple[float, int, FloatArray]:
    """Sum of squares that columns of n rows explain, their rank, and the generalised inverse of their squares."""
    values, vectors = np.linalg.eigh(gram)
    kept = values > RANK * n
    vectors, values = vectors[:, kept], values[kept]
    part = vectors.T @ moment
    return float(part @ (part / values)), int(kept.sum()), np.asarray((vectors / values) @ vectors.T)
