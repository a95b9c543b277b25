"""The ten metrics of 10 s snippets on held-out blocks, before and after, beside the floor.

References
----------
.. [1] N. Neis, J. Beyerer, arXiv:2405.17080, 2024: the ten metrics of a snippet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.evaluation.distances import Distances, mean_distances, metric_distances
from xosc_lateral.evaluation.metrics import METRICS, snippet_metrics
from xosc_lateral.identification.timeline import Timeline

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

SNIPPET_ROWS = 51
"""10 s at 5 Hz, both ends included."""

SPLITS = 6
"""Random halves of the blocks that distances are averaged over."""


@dataclass(frozen=True, eq=False)
class Scorecard:
    """Wasserstein distances per metric, in standard deviations of the measured metric.

    Parameters
    ----------
    before, after, floor : Distances, or None when there are too few snippets
    real, sampled_before, sampled_after : array, shape (snippets, 10)
        For violins. [m]
    """

    before: Distances | None
    after: Distances | None
    floor: Distances | None
    real: FloatArray
    sampled_before: FloatArray
    sampled_after: FloatArray


def score_runs(
    timeline: Timeline, before: FloatArray, after: FloatArray, blocks: IntArray, rng: np.random.Generator
) -> Scorecard:
    """Cut offsets [m], shape (n,), and runs, shape (runs, n), into the same snippets and compare."""
    starts = _starts(timeline)
    rows = starts[:, None] + np.arange(SNIPPET_ROWS)
    if len(starts) < 8:
        empty = np.zeros((0, len(METRICS)))
        return Scorecard(None, None, None, empty, empty, empty)
    real = snippet_metrics(timeline.offset[rows])
    one, other = snippet_metrics(before[0][rows]), snippet_metrics(after[0][rows])
    of_block = blocks[starts]
    numbers = np.unique(of_block)
    gathered: tuple[list[Distances], list[Distances], list[Distances]] = ([], [], [])
    for split in range(SPLITS):
        half = np.isin(of_block, rng.permutation(numbers)[: max(1, len(numbers) // 2)])
        if half.sum() < 3 or (~half).sum() < 3:
            continue
        run = split % len(before)
        sampled = (snippet_metrics(runs[run][rows[~half]]) for runs in (before, after))
        for place, metrics in zip(gathered, (*sampled, real[~half]), strict=True):
            place.append(metric_distances(real[half], metrics))
    if not gathered[0]:
        return Scorecard(None, None, None, real, one, other)
    means = [mean_distances(several) for several in gathered]
    return Scorecard(means[0], means[1], means[2], real, one, other)


def _starts(timeline: Timeline) -> IntArray:
    starts, at, n = [], 0, len(timeline)
    sums = np.concatenate([[0], np.cumsum(timeline.valid)])
    while at + SNIPPET_ROWS <= n:
        inside = sums[at + SNIPPET_ROWS] - sums[at] == SNIPPET_ROWS
        if inside:
            starts.append(at)
        at += SNIPPET_ROWS if inside else 1
    return np.asarray(starts, dtype=np.intp)
