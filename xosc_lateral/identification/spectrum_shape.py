"""Whether a profile's own runs move as the drives do, from tenths of seconds to minutes.

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
from xosc_lateral.identification.residual import simulated_runs
from xosc_lateral.identification.seeds import LoopSeed
from xosc_lateral.identification.significance import LEAST
from xosc_lateral.identification.timeline import Timeline, local_mean

FloatArray = NDArray[np.float64]

TIMES_S = (0.4, 1.0, 2.0, 4.0, 8.0)
"""Averaging times between which the bands lie. [s]"""

BLOCK = 300
"""Samples that one value per band is taken from: 60 s. [-]"""

LEVEL = 0.003
"""Probability of a false finding."""

N_RUNS = 3
"""Runs of the profile."""

STILL = 1e-9
"""Blocks that move by less stand still: their bands are nothing but rounding. [m]"""

WORTH_ADDING = 0.05
"""A difference below this share of a band's size is no reason for another core model, however sure it is. [-]"""


@dataclass(frozen=True, eq=False)
class SpectrumShape:
    """Comparison of the movement's size in bands of time, with its overall size divided out.

    Parameters
    ----------
    bands_s : tuple of float
        Upper limit of each band. [s]
    ratio : array
        Profile over drives. [-]
    p_value : float
        That both have the same spectrum shape (Hotelling's test over blocks of a minute).
    """

    bands_s: tuple[float, ...]
    ratio: FloatArray
    p_value: float

    @property
    def found(self) -> bool:
        """Whether the profile's spectrum has another shape, beyond chance and by enough to matter."""
        return self.p_value < LEVEL and bool(np.max(np.abs(np.log(self.ratio))) > WORTH_ADDING)


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
