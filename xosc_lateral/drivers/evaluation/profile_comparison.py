"""Several profiles beside one another: how each moves, how far each is from each, which are alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.evaluation.lane_keeping import LaneKeeping, MovementSummary, figures_of
from xosc_lateral.drivers.evaluation.metrics import (
    DRIVERS,
    DURATION,
    METRICS,
    cut_snippets,
    free_runs,
    snippet_metrics,
    wasserstein,
)
from xosc_lateral.drivers.evaluation.scores import SNIPPET
from xosc_lateral.drivers.evaluation.spectra import Spectrum, spectrum
from xosc_lateral.drivers.model.profile import DriverProfile

HALVINGS, HALVING_COUNT_AND_SHARE = 40, 0.95
"""Random halves of a profile's drivers, and how many of them are no further apart than what counts as alike. [-]"""


@dataclass(frozen=True, eq=False, slots=True)
class ComparedProfile:
    """A profile and its free runs in even traffic."""

    profile: DriverProfile
    runs: FloatArray  # Shape (drivers, n). [m]
    summary: MovementSummary
    keeping: LaneKeeping
    spectrum: Spectrum


@dataclass(frozen=True, eq=False, slots=True)
class Compared:
    """Profiles and how they differ.

    Parameters
    ----------
    profiles : tuple of ComparedProfile
    metrics : array, shape (k, k, 10)
        Wasserstein distance per metric, in standard deviations over all profiles' snippets. On the diagonal: of a
        profile from itself, as much driving as it was fitted on from as much other driving, half of its drivers at
        most, where the mean over the metrics is the 95 % quantile of random choices.
    scale : array, shape (10,)
        Those standard deviations. [m]
    seed : int
    """

    profiles: tuple[ComparedProfile, ...]
    metrics: FloatArray
    scale: FloatArray
    seed: int

    @property
    def names(self) -> list[str]:
        """Of the profiles."""
        return [each.profile.name for each in self.profiles]

    @property
    def distance(self) -> FloatArray:
        """Mean over the ten metrics, shape (k, k). [-]"""
        return np.asarray(self.metrics.mean(axis=2))

    @property
    def floors(self) -> FloatArray:
        """Up to which distance two profiles are alike, shape (k, k): root mean square of both from themselves. [-]"""
        itself = np.diag(self.distance)
        return np.sqrt(0.5 * (itself[:, None] ** 2 + itself[None, :] ** 2))

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Profiles that are alike, each with each (complete linkage): no further apart than halves of their drivers."""
        from scipy.cluster.hierarchy import fcluster, linkage
        from scipy.spatial.distance import squareform

        between = self.distance / np.maximum(self.floors, 1e-12)
        np.fill_diagonal(between, 0.0)
        labels = fcluster(linkage(squareform(between, checks=False), "complete"), 1.0, "distance")
        names = self.names
        return tuple(tuple(names[k] for k in np.flatnonzero(labels == label)) for label in dict.fromkeys(labels))


def compare(profiles: Sequence[DriverProfile], seed: int) -> Compared:
    """Sample every profile in even traffic and measure each against each; the first's luck is no other's."""
    compared = []
    for number, profile in enumerate(profiles):
        runs = free_runs(profile, seed + number)
        compared.append(
            ComparedProfile(profile, runs, *figures_of(profile, seed), spectrum(list(runs), profile.model.step))
        )
    return Compared(tuple(compared), *_distances(compared, seed), seed)


def _distances(profiles: Sequence[ComparedProfile], seed: int) -> tuple[FloatArray, FloatArray]:
    """Distance per metric in standard deviations, shape (k, k, metrics), and these [m]; the diagonal is of halves."""
    drivers = [
        [snippet_metrics(cut_snippets(run, round(SNIPPET / each.profile.model.step) + 1)) for run in each.runs]
        for each in profiles
    ]
    pooled = [np.concatenate(metrics) for metrics in drivers]
    scale = np.concatenate(pooled).std(axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    distances = np.empty((len(profiles), len(profiles), len(METRICS)))
    for row in range(len(profiles)):
        fitted = _fitted_drivers(profiles[row].profile)
        distances[row, row] = _from_itself(drivers[row], fitted, scale, np.random.default_rng([seed, row]))
        for column in range(row):
            distances[row, column] = distances[column, row] = _per_metric(pooled[row], pooled[column]) / scale
    return distances, scale


def _fitted_drivers(profile: DriverProfile) -> int:
    """Of how many free runs a profile's drives are worth, half of them where that is not known."""
    known = profile.provenance
    return round(3600.0 * known.hours / DURATION) if known.hours and "derived_from" not in known.fit else DRIVERS // 2


def _from_itself(drivers: Sequence[FloatArray], fitted: int, scale: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Distance per metric, shape (10,), between those random pieces that are further apart than 95 % of them."""
    count = min(max(fitted, 1), len(drivers) // 2)
    distances = []
    for _ in range(HALVINGS):
        order = rng.permutation(len(drivers)).tolist()
        half, rest = order[:count], order[-count:]
        distances.append(_per_metric(*(np.concatenate([drivers[k] for k in part]) for part in (half, rest))) / scale)
    means = [float(gaps.mean()) for gaps in distances]
    return distances[int(np.argsort(means)[round(HALVING_COUNT_AND_SHARE * (HALVINGS - 1))])]


def _per_metric(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.array([wasserstein(one[:, k], other[:, k]) for k in range(one.shape[1])])
