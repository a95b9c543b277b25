"""Where in the lane drives keep and how large their movement is, how sure that is, and what tells two of them apart.

What a drive shows scatters from stretch to stretch, and drives of one driver may differ by more than that: the error is
the larger one of the two, by blocks or by drives [1]_.

References
----------
.. [1] K.-Y. Liang, S. L. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import NORMAL_95, FloatArray, IndexArray
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.fitting.regression import cluster_sums

QUANTITIES = ("mean offset", "slow movement", "fast movement")  # Of the movements the standard deviation.
# Averaging times between which movement is fast, and beyond which it is slow. [s]
FAST_S, SLOW_S = 1.0, 4.0
FAST_HZ = 0.5 / FAST_S  # Frequency up to which a recording has to be valid for its fast movement to count. [Hz]
BLOCK_S = 300.0  # Stretches that count as independent: three times as long as drivers wander. [s]
LEAST_MEAN_SQUARE = 1e-12  # Of a mean square: of a car that does not move. [m2]
# Share of pairs of one driver that are told apart, by whichever quantity, and the chance of finding the least
# difference that is named. [-]
SIGNIFICANCE_LEVEL, TEST_POWER = 0.05, 0.8


@dataclass(frozen=True, eq=False, slots=True)
class Sizes:
    """By `QUANTITIES`, shape (3,): metres and natural logarithms of metres, and standard errors, NaN where unknown."""

    values: FloatArray
    errors: FloatArray

    def to_dict(self) -> dict[str, list[float]]:
        """What a profile's provenance holds: metres, and the standard error, of a movement as a share."""
        sizes = [self.values[0], *np.exp(self.values[1:])]
        known = zip(QUANTITIES, sizes, self.errors, strict=True)
        return {
            name: [float(f"{size:.5g}"), float(f"{error:.3g}")] for name, size, error in known if np.isfinite(error)
        }

    @classmethod
    def from_dict(cls, known: Mapping[str, Any]) -> Sizes | None:
        """The same again; None: it holds none, or they can't be read."""
        pairs = [known.get(name, (np.nan, np.nan)) for name in QUANTITIES]
        try:
            values, errors = np.array(pairs, dtype=np.float64).T
        except ValueError:
            return None
        with np.errstate(invalid="ignore", divide="ignore"):
            values[1:] = np.log(values[1:])
        return cls(values, errors) if np.isfinite(errors).any() else None


def sizes_of_runs(runs: Sequence[Run], step: float) -> Sizes:
    """Of measured drives; nothing of the fast movement where the recording does not show it."""
    sizes, by_block, by_drive = _measured([(run.drive, run.offset) for run in runs], step)
    errors = np.maximum(by_block, by_drive)
    if any(run.valid_below is not None and run.valid_below < FAST_HZ for run in runs):
        errors[2] = np.nan
    return Sizes(sizes, errors)


def sizes_of_samples(drives: FloatArray, step: float, number: int, seconds: float) -> Sizes:
    """Of a profile's sampled drives, shape (drives, n) [m], as sure as so many measured ones of so long together."""
    sizes, by_block, by_drive = _measured([(str(k), drive) for k, drive in enumerate(drives)], step)
    longer, more = drives.size * step / seconds, len(drives) / number
    return Sizes(sizes, np.maximum(by_block * np.sqrt(longer), by_drive * np.sqrt(more)))


def _measured(parts: Sequence[tuple[str, FloatArray]], step: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sizes of uninterrupted parts of drives [m], their standard errors by blocks and by drives, shape (3,) each."""
    names = np.unique([name for name, _ in parts], return_inverse=True)[1]
    rows = np.bincount(names, [len(offset) for _, offset in parts])
    means = np.bincount(names, [float(offset.sum()) for _, offset in parts]) / rows
    blocks = [
        (drive, len(block), block.mean(), *_mean_squares(block - means[drive], step))
        for drive, (_, offset) in zip(names, parts, strict=True)
        for block in np.array_split(offset, max(round(len(offset) * step / BLOCK_S), 1))
    ]
    table = np.array(blocks, dtype=np.float64)
    weights, values = table[:, 1] / table[:, 1].sum(), table[:, 2:]
    means = weights @ values
    scores = weights[:, None] * (values - means)
    errors = [_error(scores, cluster) for cluster in (np.arange(len(table)), table[:, 0].astype(np.intp))]
    squares = np.maximum(means[1:], LEAST_MEAN_SQUARE)
    for error in errors:
        error[1:] /= 2.0 * squares
    return np.array([means[0], *(0.5 * np.log(squares))]), errors[0], errors[1]


def _error(scores: FloatArray, cluster: IndexArray) -> FloatArray:
    """Standard errors from clusters, shape (3,), as wide as Student's distribution; 0 of a single one."""
    number = int(cluster.max()) + 1
    sums = cluster_sums(scores, cluster)
    freedom = max(number - 1, 1)
    wider = freedom / (freedom - 2) if freedom > 2 else 1.0
    error = np.sqrt(np.square(sums).sum(axis=0) * number / freedom * wider)
    return np.asarray(error if number > 1 else np.zeros(len(error)))


def _mean_squares(offset: FloatArray, step: float) -> tuple[float, float]:
    """Of slow and of fast movement. [m2]"""
    sums = np.cumsum(offset, dtype=np.float64)
    lengths = [min(max(round(seconds / step), 1), len(offset) - 1) for seconds in (FAST_S, SLOW_S)]
    fine, coarse = ((sums[length:] - sums[:-length]) / length for length in lengths)
    cut = (len(fine) - len(coarse)) // 2
    fast = fine[cut : cut + len(coarse)] - coarse
    return float(np.mean(coarse**2)), float(np.mean(fast**2))


@dataclass(frozen=True, slots=True)
class Difference:
    """By how much the second of two profiles differs from the first in one quantity.

    `size`, `error` and `least`, what as much driving would show in four of five cases: [m], or natural logarithm.
    `p_value`: of a difference as large between two fits of one driver, all quantities considered. [-]
    """

    quantity: str
    size: float
    error: float
    least: float
    p_value: float

    @property
    def is_factor(self) -> bool:
        """Whether it is a natural logarithm."""
        return self.quantity != QUANTITIES[0]

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the size."""
        return self.size - NORMAL_95 * self.error, self.size + NORMAL_95 * self.error


def differences(first: Sizes, second: Sizes) -> list[Difference]:
    """In each quantity that both know."""
    from scipy.stats import norm

    size, error = second.values - first.values, np.hypot(first.errors, second.errors)
    known = np.flatnonzero(np.isfinite(error) & (error > 0.0))
    number = max(len(known), 1)
    least = float(norm.isf(0.5 * SIGNIFICANCE_LEVEL / number) + norm.ppf(TEST_POWER))
    p_values = np.minimum(2.0 * number * norm.sf(np.abs(size[known]) / error[known]), 1.0)
    return [
        Difference(QUANTITIES[k], float(size[k]), float(error[k]), least * float(error[k]), float(p_value))
        for k, p_value in zip(known, p_values, strict=True)
    ]


def surest(parts: Sequence[Difference]) -> float:
    """Smallest p-value, 1 where nothing is known of both. [-]"""
    return min((part.p_value for part in parts), default=1.0)
