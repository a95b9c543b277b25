"""Several profiles beside one another: how each moves, how far each is from each, which are alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.evaluation import sizes
from xosc_lateral.drivers.evaluation.lane_keeping import (
    HIGHWAY_SPEED,
    LaneKeeping,
    MovementSummary,
    figures_of,
    highway_drives,
)
from xosc_lateral.drivers.evaluation.metrics import (
    DRIVER_COUNT,
    METRICS,
    RUN_SECONDS,
    cut_snippets,
    free_runs,
    snippet_metrics,
    wasserstein_columns,
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
    """Profiles and how they differ."""

    profiles: tuple[ComparedProfile, ...]
    # Wasserstein distance per metric, shape (k, k, 10), in standard deviations over all profiles' snippets. On the
    # diagonal: of a profile from itself, as much driving as it was fitted on from as much other driving, half of its
    # drivers at most, where the mean over the metrics is the 95 % quantile of random choices.
    metrics: FloatArray
    scale: FloatArray  # Those standard deviations, shape (10,). [m]
    # What each pair differs by at one speed: of the drives that both were fitted on, else of drives sampled from both.
    differences: Mapping[tuple[str, str], list[sizes.Difference]]
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
        """Profiles that are alike, each with each (complete linkage): they differ no more than two fits of a driver."""
        from scipy.cluster.hierarchy import fcluster, linkage

        apart = np.array([sizes.surest(parts) for parts in self.differences.values()])
        labels = fcluster(linkage(1.0 - apart, "complete"), 1.0 - sizes.SIGNIFICANCE_LEVEL, "distance")
        names = self.names
        return tuple(tuple(names[k] for k in np.flatnonzero(labels == label)) for label in dict.fromkeys(labels))


def compare(profiles: Sequence[DriverProfile], seed: int) -> Compared:
    """Sample every profile in even traffic and measure each against each; the first's luck is no other's."""
    compared = []
    for number, profile in enumerate(profiles):
        runs = free_runs(profile, seed + number)
        figures = figures_of(profile, seed, highway_drives(profile, seed))
        compared.append(ComparedProfile(profile, runs, *figures, spectrum(list(runs), profile.model.step)))
    distances = _distances(compared, seed)
    return Compared(tuple(compared), *distances, _differences(profiles, seed), seed)


def _differences(profiles: Sequence[DriverProfile], seed: int) -> dict[tuple[str, str], list[sizes.Difference]]:
    measured = {each.name: _measured(each) for each in profiles}
    free = {each.name: _sampled(replace(each, effects=()), seed) for each in profiles}
    pairs = {}
    for first, second in combinations(profiles, 2):
        speed, both, pair = common_speed(first, second), list[sizes.Sizes](), (first.name, second.name)
        for each in (first, second):
            of_drives, sampled = measured[each.name], _sampled(each, seed, speed) if each.effects else free[each.name]
            if of_drives is not None and all(measured[name] is not None for name in pair):
                # The drives are known as they are without any effect; by how much effects change them, by sampling.
                sampled = sizes.Sizes(of_drives.values + sampled.values - free[each.name].values, of_drives.errors)
            both.append(sampled)
        pairs[pair] = sizes.differences(*both)
    return pairs


def common_speed(first: DriverProfile, second: DriverProfile) -> float:
    """In the middle of the speeds that both have been driven at, or between these where none is shared. [m/s]

    That of the one whose speeds are known, else of the highway driving test.
    """
    known = [each.validity.speed for each in (first, second) if each.validity.speed is not None]
    return HIGHWAY_SPEED if not known else 0.5 * (max(low for low, _ in known) + min(high for _, high in known))


def _measured(profile: DriverProfile) -> sizes.Sizes | None:
    """Of the drives that it was fitted on, where it knows them."""
    known = profile.provenance.fit
    return None if "derived_from" in known else sizes.Sizes.from_dict(known.get("sizes", {}))


def _sampled(profile: DriverProfile, seed: int, speed: float = HIGHWAY_SPEED) -> sizes.Sizes:
    """Of its own drives at a speed [m/s], as sure as if it had been fitted on such."""
    drives = highway_drives(profile, seed, speed=speed)
    return sizes.sizes_of_samples(drives, profile.model.step, *_fitted_drives(profile))


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
        fitted = round(_fitted_drives(profiles[row].profile)[1] / RUN_SECONDS)
        distances[row, row] = _from_itself(drivers[row], fitted, scale, np.random.default_rng([seed, row]))
        for column in range(row):
            distances[row, column] = distances[column, row] = wasserstein_columns(pooled[row], pooled[column]) / scale
    return distances, scale


def _fitted_drives(profile: DriverProfile) -> tuple[int, float]:
    """How many drives a profile was fitted on, and how long they are [s]; half of the free runs' if unknown."""
    known = profile.provenance
    if not known.hours or "derived_from" in known.fit:
        return DRIVER_COUNT // 2, RUN_SECONDS * (DRIVER_COUNT // 2)
    return max(known.drives, 1), 3600.0 * known.hours


def _from_itself(drivers: Sequence[FloatArray], fitted: int, scale: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Distance per metric, shape (10,), between those random pieces that are further apart than 95 % of them."""
    count = min(max(fitted, 1), len(drivers) // 2)
    distances = []
    for _ in range(HALVINGS):
        order = rng.permutation(len(drivers)).tolist()
        half, rest = order[:count], order[-count:]
        distances.append(
            wasserstein_columns(*(np.concatenate([drivers[k] for k in part]) for part in (half, rest))) / scale
        )
    means = [float(gaps.mean()) for gaps in distances]
    return distances[int(np.argsort(means)[round(HALVING_COUNT_AND_SHARE * (HALVINGS - 1))])]
