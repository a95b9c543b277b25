"""What a profile does in even traffic, from long free runs of several drivers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.sampling import sample_offsets
from xosc_lateral.driver.seeds import child
from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]

SPEED = 30.0
"""Of the free runs: about 108 km/h. [m/s]"""

DRIVERS, DURATION = 60, 300.0
"""Free runs of a profile and their length [s]: 5 h, so that drivers who differ are all met."""


@dataclass(frozen=True)
class MovementSummary:
    """What a profile does in even traffic, in figures that a person can picture.

    Parameters
    ----------
    mean_offset : float
        Positive: left of the lane centre. [m]
    spread : float
        Standard deviation over all drivers and times. [m]
    spread_within : float
        Mean standard deviation of one driver over 5 min. [m]
    low, high : float
        5 % and 95 % quantile. [m]
    lateral_speed : float
        Root mean square. [m/s]
    """

    mean_offset: float
    spread: float
    spread_within: float
    low: float
    high: float
    lateral_speed: float


def free_runs(profile: DriverProfile, seed: int, *, drivers: int = DRIVERS, duration: float = DURATION) -> FloatArray:
    """Offsets of several drivers in even traffic, shape (drivers, n). [m]"""
    segment = Segment.even(duration, profile.model.step, profile.lane_width, SPEED)
    root = np.random.SeedSequence(seed)
    return np.array([sample_offsets(profile, segment, child(root, k)) for k in range(drivers)])


def summary_of(profile: DriverProfile, seed: int = 0) -> MovementSummary:
    """Sample free runs and sum them up."""
    return summarise(free_runs(profile, seed), profile.model.step)


def summarise(runs: FloatArray, step: float) -> MovementSummary:
    """Sum up free runs, shape (drivers, n) [m], with rows `step` seconds apart."""
    low, high = np.quantile(runs, [0.05, 0.95])
    return MovementSummary(
        mean_offset=float(runs.mean()),
        spread=float(runs.std()),
        spread_within=float(runs.std(axis=1).mean()),
        low=float(low),
        high=float(high),
        lateral_speed=float(np.sqrt((np.diff(runs, axis=1) ** 2).mean()) / step),
    )
