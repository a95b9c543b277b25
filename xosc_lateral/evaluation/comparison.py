"""How two profiles differ: metrics of snippets from long free runs of both.

References
----------
.. [1] N. Neis, J. Beyerer, arXiv:2405.17080, 2024: the ten metrics of a snippet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.sampling import sample_offsets
from xosc_lateral.driver.seeds import child
from xosc_lateral.evaluation.distances import Distances, metric_distances, wasserstein
from xosc_lateral.evaluation.metrics import METRICS, cut_snippets, snippet_metrics
from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]

SNIPPET = 10.0
"""[s]"""
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
    step = profile.model.step
    n = round(duration / step) + 1
    time: FloatArray = step * np.arange(n, dtype=np.float64)
    segment = Segment(time, np.full(n, profile.lane_width), np.full(n, SPEED))
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


def free_metrics(profile: DriverProfile, seed: int = 0) -> FloatArray:
    """Ten metrics of all 10 s snippets of free runs, shape (n, 10). [m]"""
    length = round(SNIPPET / profile.model.step) + 1
    return snippet_metrics(np.concatenate([cut_snippets(run, length) for run in free_runs(profile, seed)]))


def compare_profiles(one: DriverProfile, other: DriverProfile, seed: int = 0) -> Distances:
    """Distance per metric from one profile's snippets to the other's, in standard deviations of the first's."""
    return metric_distances(free_metrics(one, seed), free_metrics(other, seed + 1))


def driver_distances(
    profiles: Sequence[DriverProfile], held_out: Sequence[FloatArray], seed: int = 0
) -> NDArray[np.float64]:
    """Mean distance from each profile's snippets to each driver's held-out ones.

    Parameters
    ----------
    profiles : sequence of DriverProfile
        One per driver, fitted on another part of the drive.
    held_out : sequence of array, shape (n_i, m)
        Snippets of the same drivers, in the same order. [m]

    Returns
    -------
    array, shape (k, k)
        Row: profile, column: driver. Small on the diagonal if profiles know their drivers. In standard deviations
        over all held-out snippets, so that columns can be compared.
    """
    measured = [snippet_metrics(snippets) for snippets in held_out]
    scale = np.concatenate(measured).std(axis=0)
    distance = np.empty((len(profiles), len(measured)))
    for row, profile in enumerate(profiles):
        sampled = free_metrics(profile, seed + row)
        for column, real in enumerate(measured):
            gaps = [wasserstein(real[:, k], sampled[:, k]) for k in range(len(METRICS))]
            distance[row, column] = np.mean(np.array(gaps) / scale)
    return distance
