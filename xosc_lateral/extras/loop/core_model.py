"""What a two-level base lacks, whatever its effects: memory beyond one step, and drivers that differ.

References
----------
.. [1] H. Hotelling, "The generalization of Student's ratio", Annals of Mathematical Statistics 2, 1931.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from scipy.special import fdtrc

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.seeds import child
from xosc_lateral.extras.loop.model import Description, Fitted
from xosc_lateral.extras.loop.residual import simulated_runs
from xosc_lateral.extras.loop.significance import MINIMUM_P, LoopSeed
from xosc_lateral.extras.loop.timeline import Timeline, local_mean

TIMES_S = (0.4, 1.0, 2.0, 4.0, 8.0)  # Averaging times between which the bands lie. [s]
WHOLE_S = 30.0  # Movement about the mean over so long is the whole that the bands are parts of. [s]
BLOCK = 300  # Samples that one value per band is taken from: 60 s. [-]
SHAPE_LEVEL = 0.003  # Probability of a false finding.
N_RUNS = 3  # Runs of the profile.
STANDSTILL_DEVIATION = 1e-9  # Blocks that move by less stand still: their bands are nothing but rounding. [m]
# A difference below this share of a band's size is no reason for another core model, however sure it is. [-]
WORTH_ADDING = 0.05
MIN_DRIVES = 8  # Fewer drives say nothing about a population.
MIN_SECONDS = 20  # Of road-following in either half of a drive that is counted. [s]
DRIVERS_LEVEL = 0.002  # Probability of a false finding.


@dataclass(frozen=True, eq=False)
class SpectrumShape:
    """Movement by bands up to `bands_s` [s] over the whole, profile over drives, with Hotelling's test [1]_."""

    KIND: ClassVar[str] = "memory"
    bands_s: tuple[float, ...]
    ratio: FloatArray
    p_value: float

    @property
    def is_found(self) -> bool:
        """Whether the profile's spectrum has another shape, beyond chance and by enough to matter."""
        return self.p_value < SHAPE_LEVEL and bool(np.max(np.abs(np.log(self.ratio))) > WORTH_ADDING)

    def described(self) -> Description:
        """The first-order chain forgets too fast."""
        worst = int(np.argmax(np.abs(np.log(self.ratio))))
        ratio, measure = float(self.ratio[worst]), "size of the movement by frequency band"
        shape = f"movement within {self.bands_s[worst]:g} s is {ratio:.2f} times the measured"
        return Description("memory beyond one step", shape, ratio, 0.0, "movement by band", measure)


def compare_spectrum_shapes(profile: DriverProfile, timeline: Timeline, seed: np.random.SeedSequence) -> SpectrumShape:
    """Compare a profile's free runs with the drives, block by block."""
    runs = simulated_runs(profile, timeline, child(seed, LoopSeed.SPECTRUM), runs=N_RUNS)
    real = _shapes(timeline.offset, timeline)
    sampled = np.concatenate([_shapes(run, timeline) for run in runs])
    if len(real) < 2 * len(TIMES_S) + 4:
        return SpectrumShape(TIMES_S, np.ones(len(TIMES_S)), 1.0)
    difference = sampled.mean(axis=0) - real.mean(axis=0)
    covariance = np.cov(real.T) / len(real) + np.cov(sampled.T) / len(sampled)
    k, n = len(difference), len(real)
    statistic = float(difference @ np.linalg.pinv(covariance) @ difference)
    p_value = float(fdtrc(k, n - k, statistic * (n - k) / (k * (n - 1))))
    return SpectrumShape(TIMES_S, np.exp(difference), max(p_value, MINIMUM_P))


def _shapes(offset: FloatArray, timeline: Timeline) -> FloatArray:
    """Logarithm of each band's size over the whole movement's, per block, shape (blocks, bands)."""
    *levels, usual = (local_mean(offset, timeline.valid, seconds) for seconds in (*TIMES_S, WHOLE_S))
    bands = [finer - coarser for finer, coarser in pairwise([offset, *levels])]
    slow, rows, inside = offset - usual, [], np.flatnonzero(timeline.valid)
    for first in range(0, len(inside) - BLOCK + 1, BLOCK):
        at = inside[first : first + BLOCK]
        whole = float(np.std(slow[at]))
        if whole > STANDSTILL_DEVIATION:
            deviations = (max(float(np.std(band[at])), STANDSTILL_DEVIATION) for band in bands)
            rows.append([np.log(deviation / whole) for deviation in deviations])
    return np.asarray(rows).reshape(-1, len(bands))


@dataclass(frozen=True, slots=True)
class DriverVariance:
    """Deviation between drives of means [m] and log spreads without noise, and the p-value that all are alike."""

    KIND: ClassVar[str] = "population"
    drives: int
    shift: float
    log_spread: float
    p_value: float

    @property
    def is_found(self) -> bool:
        """Whether drivers differ beyond chance."""
        return self.p_value < DRIVERS_LEVEL

    def described(self) -> Description:
        """One pooled driver can't be many."""
        shape = f"{self.drives} drives; their spreads scatter by a factor of {np.exp(self.log_spread):.2f}"
        return Description(
            "drivers that differ",
            shape,
            self.shift,
            self.shift / np.sqrt(2.0 * self.drives),
            "quantiles of local spread",
        )


def test_population(fitted: Fitted, known: FloatArray) -> DriverVariance | None:
    """Analysis of variance with drives' halves as noise, so that drift counts as noise; None: too few drives."""
    whitener = fitted.whitener
    offset = fitted.movement * whitener.scale + (fitted.levels - known)[whitener.drive]
    halves = []
    for index in range(len(fitted.levels)):
        series = offset[whitener.valid & (whitener.drive == index)]
        if len(series) >= 2 * MIN_SECONDS:
            halves.append((series[: len(series) // 2], series[len(series) // 2 :]))
    if len(halves) < MIN_DRIVES:
        return None
    shift, p_shift = _scatter(np.array([[half.mean() for half in pair] for pair in halves]))
    log_spread, p_spread = _scatter(np.array([[np.log(max(half.std(), 1e-6)) for half in pair] for pair in halves]))
    return DriverVariance(len(halves), shift, log_spread, max(min(1.0, 2.0 * min(p_shift, p_spread)), MINIMUM_P))


def _scatter(halves: FloatArray) -> tuple[float, float]:
    """Standard deviation between drives without the noise, and the F test's probability; halves: shape (drives, 2)."""
    between = float(np.var(halves.mean(axis=1), ddof=1))
    within = float(np.mean((halves[:, 0] - halves[:, 1]) ** 2)) / 4.0
    p_value = float(fdtrc(len(halves) - 1, len(halves), between / max(within, 1e-30)))
    return float(np.sqrt(max(between - within, 0.0))), p_value
