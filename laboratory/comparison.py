"""How two profiles differ: metrics of snippets from long free runs of both.

References
----------
.. [1] N. Neis, J. Beyerer, arXiv:2405.17080, 2024: the ten metrics of a snippet.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drivers.evaluation.metrics import (
    METRICS,
    Distances,
    cut_snippets,
    free_runs,
    metric_distances,
    snippet_metrics,
    wasserstein,
)
from xosc_lateral.drivers.model.profile import DriverProfile

FloatArray = NDArray[np.float64]

SNIPPET = 10.0
"""[s]"""


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
