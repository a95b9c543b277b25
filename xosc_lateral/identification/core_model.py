"""What a two-level base lacks, whatever its effects: memory beyond one step, and drivers that differ.

References
----------
.. [1] H. Hotelling, "The generalization of Student's ratio", Annals of Mathematical Statistics 2, 1931.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.identification.regression import Fitted
from xosc_lateral.identification.residual import simulated_runs
from xosc_lateral.identification.significance import LEAST, LoopSeed
from xosc_lateral.identification.timeline import FloatArray, Timeline, local_mean

TIMES_S = (0.4, 1.0, 2.0, 4.0, 8.0)  # Averaging times between which the bands lie. [s]
BLOCK = 300  # Samples that one value per band is taken from: 60 s. [-]
SHAPE_LEVEL = 0.003  # Probability of a false finding.
N_RUNS = 3  # Runs of the profile.
STILL = 1e-9  # Blocks that move by less stand still: their bands are nothing but rounding. [m]
# A difference below this share of a band's size is no reason for another core model, however sure it is. [-]
WORTH_ADDING = 0.05
MIN_DRIVES = 8  # Fewer drives say nothing about a population.
MIN_SECONDS = 20  # Of road-following in either half of a drive that is counted. [s]
DRIVERS_LEVEL = 0.002  # Probability of a false finding.


@dataclass(frozen=True, eq=False)
class SpectrumShape:
    """Profile over drives, by bands up to `bands_s` [s], of the movement's size in each over its overall size.

    `p_value`: that both have the same spectrum shape (Hotelling's test [1]_ over blocks of a minute).
    """

    bands_s: tuple[float, ...]
    ratio: FloatArray
    p_value: float

    @property
    def found(self) -> bool:
        """Whether the profile's spectrum has another shape, beyond chance and by enough to matter."""
        return self.p_value < SHAPE_LEVEL and bool(np.max(np.abs(np.log(self.ratio))) > WORTH_ADDING)


def compare_spectrum_shapes(profile: DriverProfile, timeline: Timeline, seed: np.random.SeedSequence) -> SpectrumShape:
    """Compare a profile's free runs with the drives, block by block."""
    from scipy.stats import f

    own_seed = np.random.SeedSequence(seed.entropy, spawn_key=(LoopSeed.SPECTRUM,))
    runs = simulated_runs(profile, timeline, own_seed, runs=N_RUNS)
    real = _shapes(timeline.offset, timeline)
    own = np.concatenate([_shapes(run, timeline) for run in runs])
    if len(real) < 2 * len(TIMES_S) + 4:
        return SpectrumShape(TIMES_S, np.ones(len(TIMES_S)), 1.0)
    difference = own.mean(axis=0) - real.mean(axis=0)
    covariance = np.cov(real.T) / len(real) + np.cov(own.T) / len(own)
    k, n = len(difference), len(real)
    statistic = float(difference @ np.linalg.pinv(covariance) @ difference)
    p_value = float(f.sf(statistic * (n - k) / (k * (n - 1)), k, n - k))
    return SpectrumShape(TIMES_S, np.exp(difference), max(p_value, LEAST))


def _shapes(offset: FloatArray, timeline: Timeline) -> FloatArray:
    """Logarithm of each band's size over the whole movement's, per block, shape (blocks, bands)."""
    valid = timeline.valid
    levels = [offset, *(local_mean(offset, valid, seconds, timeline.step) for seconds in TIMES_S)]
    bands = [finer - coarser for finer, coarser in pairwise(levels)]
    slow = offset - local_mean(offset, valid, 30.0, timeline.step)
    rows = []
    inside = np.flatnonzero(valid)
    for first in range(0, len(inside) - BLOCK + 1, BLOCK):
        at = inside[first : first + BLOCK]
        whole = float(np.std(slow[at]))
        if whole > STILL:
            rows.append([np.log(max(float(np.std(band[at])), STILL) / whole) for band in bands])
    return np.asarray(rows).reshape(-1, len(bands))


@dataclass(frozen=True, slots=True)
class DriverVariance:
    """Scatter between drives that are long enough, noise taken out: standard deviation of their means and log spreads.

    `shift` in [m], `log_spread` [-]; `p_value`: that all are of one driver, by the stronger of both.
    """

    drives: int
    shift: float
    log_spread: float
    p_value: float

    @property
    def found(self) -> bool:
        """Whether drivers differ beyond chance."""
        return self.p_value < DRIVERS_LEVEL


def test_population(fitted: Fitted, known: FloatArray) -> DriverVariance | None:
    """Analysis of variance with every drive's halves as the noise; None with too few drives.

    Halves of a drive are as far apart in time as a drive is long: what drifts slowly counts as noise, not as a driver.
    `known`, shape (drives,): where the drives keep by effects between them. [m]
    """
    whitener = fitted.whitener
    offset = fitted.movement * whitener.scale + (fitted.levels - known)[whitener.drive]
    means, spreads = _halves(offset, whitener.valid, whitener.drive, len(fitted.levels))
    if len(means) < MIN_DRIVES:
        return None
    shift, p_shift = _scatter(np.asarray(means))
    log_spread, p_spread = _scatter(np.asarray(spreads))
    return DriverVariance(len(means), shift, log_spread, max(min(1.0, 2.0 * min(p_shift, p_spread)), LEAST))


def _halves(
    offset: FloatArray, valid: NDArray[np.bool_], drive: NDArray[np.intp], drives: int
) -> tuple[list[list[float]], list[list[float]]]:
    """Means [m] and logarithms of the spread of both halves of every drive that lasts."""
    means, spreads = [], []
    for index in range(drives):
        own = offset[valid & (drive == index)]
        if len(own) >= 2 * MIN_SECONDS:
            halves = own[: len(own) // 2], own[len(own) // 2 :]
            means.append([float(half.mean()) for half in halves])
            spreads.append([float(np.log(max(half.std(), 1e-6))) for half in halves])
    return means, spreads


def _scatter(halves: FloatArray) -> tuple[float, float]:
    """Standard deviation between drives without the noise, and the F test's probability; halves: shape (drives, 2)."""
    from scipy.stats import f

    between = float(np.var(halves.mean(axis=1), ddof=1))
    within = float(np.mean((halves[:, 0] - halves[:, 1]) ** 2)) / 4.0
    p_value = float(f.sf(between / max(within, 1e-30), len(halves) - 1, len(halves)))
    return float(np.sqrt(max(between - within, 0.0))), p_value
