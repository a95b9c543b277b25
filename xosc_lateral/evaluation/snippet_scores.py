"""Distances of sampled snippets from measured ones, and of measured ones from each other (the floor)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.evaluation.distances import Distances, mean_distances, metric_distances, split_groups
from xosc_lateral.evaluation.metrics import METRICS, snippet_metrics

FloatArray = NDArray[np.float64]

SNIPPET = 10.0
"""The paper's. [s]"""

SPLITS = 8
"""Random halves of the drives that both are averaged over."""


@dataclass(frozen=True, eq=False)
class SnippetScores:
    """Distances for snippets of one length.

    Parameters
    ----------
    seconds : float
        Length. [s]
    count : int
    distances, floor : Distances
        Real to sampled and real to real, averaged over the same random halves of the drives.
    """

    seconds: float
    count: int
    distances: Distances
    floor: Distances

    @property
    def ratio(self) -> float:
        """Mean distance over that between measured drives. 1: as close as real data is to itself. [-]"""
        return self.distances.mean / self.floor.mean

    @property
    def worst_ratio(self) -> tuple[str, float]:
        """Metric with the largest ratio, and that. [-]"""
        ratios = {name: self.distances.by_metric[name] / self.floor.by_metric[name] for name in METRICS}
        worst = max(ratios, key=ratios.__getitem__)
        return worst, ratios[worst]


def score_snippets(
    real: FloatArray, sampled: FloatArray, group: NDArray[np.str_], *, seed: int, seconds: float = SNIPPET
) -> SnippetScores:
    """Distances of sampled snippets, and between measured ones, over random halves of the groups.

    A half of real snippets is compared with its own sampled ones, and with the other real half: both distances rest on
    as many snippets, so that their ratio is fair.

    Parameters
    ----------
    real, sampled : array, shape (n, m)
        Row k of both starts at the same offset under the same context. [m]
    group : array, shape (n,)
        Never split between halves.
    """
    rng = np.random.default_rng(seed)
    metrics, artificial = snippet_metrics(real), snippet_metrics(sampled)
    model, floor = [], []
    for _ in range(SPLITS):
        half = split_groups(group, rng)
        model.append(metric_distances(metrics[half], artificial[half]))
        floor.append(metric_distances(metrics[half], metrics[~half]))
    return SnippetScores(seconds, len(real), mean_distances(model), mean_distances(floor))
