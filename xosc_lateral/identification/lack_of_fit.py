"""What a closed loop leaves unexplained: groups of statistics beside their floors, and whether all of it is chance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.close import LoopResult
from xosc_lateral.identification.cross_validation import hold_out_blocks
from xosc_lateral.identification.residual import size_of, split_differences
from xosc_lateral.identification.significance import LoopSeed

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

SPLITS = 64
"""Random halves of the blocks that a statistic's floor is averaged over, and that the whole error is compared with."""

LEVEL = 0.05
"""Share of those splits that may be as far apart as the refined profile and the drives are. [-]"""

STANDS_OUT = 2.0
"""A group of summary statistics with so many times its own floor is named when something is left. [-]"""


@dataclass(frozen=True, slots=True)
class GroupError:
    """Root mean square over the statistics of one group, on held-out blocks. [m]

    Parameters
    ----------
    name : str
        Group, as in `SummaryStatistics.describe`.
    before, after : float
        Measured minus expected.
    floor : float
        What the measured drives differ from themselves.
    """

    name: str
    before: float
    after: float
    floor: float

    @property
    def unexplained(self) -> float:
        """What is left beyond the floor. [m]"""
        return _beyond(self.after, self.floor)


@dataclass(frozen=True, eq=False)
class LackOfFit:
    """What is left after the loop.

    Parameters
    ----------
    floors : mapping of str to array
        Standard error of every statistic: what blocks of the same drives make it differ by. [m]
    groups : tuple of GroupError
        In the order of the statistics.
    unexplained : float
        Part of the error after that the floor does not cover. [m]
    p_value : float
        Share of random halves of the drives that are as far apart.
    """

    floors: Mapping[str, FloatArray]
    groups: tuple[GroupError, ...]
    unexplained: float
    p_value: float

    @property
    def clear(self) -> bool:
        """Whether more is left than the drives differ from themselves by."""
        return self.unexplained > 0.0 and self.p_value <= LEVEL

    @property
    def where(self) -> tuple[GroupError, ...]:
        """Groups that stand out, the largest first."""
        standing = [group for group in self.groups if group.after > STANDS_OUT * group.floor]
        return tuple(sorted(standing, key=lambda group: -group.unexplained))


def lack_of_fit_of(result: LoopResult) -> LackOfFit:
    """Compare every group of statistics, and all of them, with what the drives differ from themselves by (seeded)."""
    timeline = result.scored.statistics.timeline
    rng = np.random.default_rng(np.random.SeedSequence(result.seed, spawn_key=(LoopSeed.LACK_OF_FIT,)))
    splits = split_differences(result.scored.statistics, result.unmoved, hold_out_blocks(timeline), rng, SPLITS)
    floors = {
        name: np.sqrt(_mean_of_finite(np.stack([split[name] for split in splits]) ** 2)) for name in result.scored.real
    }
    groups = tuple(
        GroupError(
            name,
            before=_size(real - result.scored.before[name]),
            after=_size(real - result.scored.after[name]),
            floor=_size(floors[name]),
        )
        for name, real in result.scored.real.items()
    )
    as_far = sum(size_of(split) >= result.error_after for split in splits)
    p_value = (1.0 + as_far) / (1.0 + len(splits))
    return LackOfFit(floors, groups, _beyond(result.error_after, result.floor), p_value)


def _beyond(error: float, floor: float) -> float:
    return float(np.sqrt(max(error**2 - floor**2, 0.0)))


def _mean_of_finite(values: FloatArray) -> FloatArray:
    count = np.isfinite(values).sum(axis=0)
    return np.where(count > 0, np.nansum(values, axis=0) / np.maximum(count, 1), np.nan)


def _size(difference: FloatArray) -> float:
    finite = difference[np.isfinite(difference)]
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else 0.0
