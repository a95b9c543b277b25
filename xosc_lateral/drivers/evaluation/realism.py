"""How near sampled driving is to real driving, beside how near other real drivers are: the fair measure.

Snippets of 10, 30 and 60 s are compared under three conditions: sampled from where the real ones start; cut from free
runs; and free runs again, movement below 0.5 Hz alone. Every number stands beside that of real snippets of other
drivers that know as much about the start. Recordings hold driver and sensor, so what is sampled has the recording's
sensor too, where it is known, and both sides are compared in one band: below 1.5 Hz, or below 0.5 Hz, where it is the
driver who is seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import NORMAL_95, FloatArray
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.evaluation import snippets, spectra
from xosc_lateral.drivers.evaluation.classifier import TwoSampleResult, classifier_two_sample_test, context_features
from xosc_lateral.drivers.evaluation.metrics import SCORE_UNITS, proper_scores, split_groups
from xosc_lateral.drivers.evaluation.snippets import SnippetCondition, Snippets
from xosc_lateral.drivers.model.profile import DriverProfile


@dataclass(frozen=True)
class VarianceParts:
    """Where the variance of the offset lies."""

    between: float  # Of the drivers' own means. [m²]
    within: float  # Of a driver's windows about that mean. [m²]
    inside: float  # About a window's own mean. [m²]


def variance_parts(windows: FloatArray, drivers: NDArray[np.generic]) -> VarianceParts:
    """Variance of windows, shape (n, m) [m], between drivers, within drivers, and inside windows.

    One-way random effects on the windows' means, by the method of moments for unequal counts (Searle, Casella and
    McCulloch, "Variance Components", 1992, 3.6). `between` holds what changes more slowly than a drive is long.
    """
    means = windows.mean(axis=1)
    names, member, counts = np.unique(drivers, return_inverse=True, return_counts=True)
    driver_means = np.bincount(member, means) / counts
    inside = float(windows.var(axis=1).mean())
    n, k = len(means), len(names)
    if k < 2 or n == k:
        return VarianceParts(float(means.var()), 0.0, inside)
    within = float(((means - driver_means[member]) ** 2).sum() / (n - k))
    among = float((counts * (driver_means - means.mean()) ** 2).sum() / (k - 1))
    effective = (n - (counts**2).sum() / n) / (k - 1)
    return VarianceParts(max((among - within) / float(effective), 0.0), within, inside)


SPLITS = 8  # Random halves of the drives that both are averaged over.
MINIMUM_GROUPS = 20  # Fewer snippets of a length: it is left out.
# Sampled snippets for each of so many real ones of 10 s, spread evenly: proper scores need several of each.
ENSEMBLE_SIZE, SCORED_SNIPPETS = 8, 200


@dataclass(frozen=True)
class WithFloor:
    """A number, and what real driving of other drivers gets (the floor). Unit in its name's table."""

    value: float
    floor: float
    unit: str = "sd"
    error: float = np.nan  # Standard error of the ratio's logarithm, from random halves of the drives. [-]

    @property
    def ratio(self) -> float:
        """Value over that of real drivers; 1: as near as other real drivers. [-]"""
        return self.value / self.floor if self.floor > 0.0 else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Of 95 %, of the ratio. [-]"""
        wide = float(np.exp(NORMAL_95 * self.error))
        return self.ratio / wide, self.ratio * wide


@dataclass(frozen=True, eq=False)
class ConditionScores:
    """What was found under one condition."""

    condition: SnippetCondition
    with_sensor: bool  # Whether what was sampled holds a sensor.
    count: int  # Snippets.
    # `metrics`, `lane_keeping` [sd], `spectrum` [dB], `memory` [-]; see `snippets.differences`. With the same start and
    # 10 s, also the proper scores [m].
    families: Mapping[str, WithFloor]
    named: Mapping[str, WithFloor]  # Distance of each of the ten metrics and of each lane-keeping indicator. [sd]
    # Mean of each lane-keeping indicator, real and sampled; units in `lane_keeping.UNITS`.
    means: Mapping[str, tuple[float, float]]
    # Classifier on movement, and on context and movement jointly (below 0.5 Hz). None: not trained.
    alone: TwoSampleResult | None
    jointly: TwoSampleResult | None
    # A classifier between two halves of the real drivers, by movement. Jointly it is 0.5: both kinds have the same
    # context. With the same start it is as with any: both halves start alike.
    floor: TwoSampleResult | None


@dataclass(frozen=True, eq=False)
class Realism:
    """The fair measure of a profile."""

    conditions: tuple[ConditionScores, ...]  # Those with enough snippets.
    variance_real: VarianceParts  # Between drivers, within drivers and inside snippets of 10 s, of free runs. [m2]
    variance_sampled: VarianceParts

    def of(self, condition: SnippetCondition) -> ConditionScores | None:
        """Scores under a condition, None where there were too few snippets."""
        wanted = replace(condition, below=0.0)
        return next((one for one in self.conditions if replace(one.condition, below=0.0) == wanted), None)


def score_realism(profile: DriverProfile, runs: Sequence[Run], *, seed: int, classify: bool = True) -> Realism:
    """Compare a profile's snippets with real ones under every condition that has enough of them.

    `runs`: measured, at the profile's step; `classify`: whether to train classifiers too, most of the work.
    """
    step, below, resolution = profile.model.step, spectra.comparison_band(runs), spectra.resolution_of(runs)
    driver = snippets.sample_runs(profile, runs, seed, same_start=False)
    noise = snippets.sensor_noise(profile, driver, seed)
    real = spectra.dithered([run.offset for run in runs], resolution, seed + 2)
    driver = spectra.dithered(driver, resolution, seed + 3)
    recorded = [path + error for path, error in zip(driver, noise, strict=True)]
    slow_real, slow_made = ([spectra.slow_movement(path, step, below) for path in paths] for paths in (real, recorded))
    conditions = []
    for seconds in snippets.LENGTHS:
        cut = snippets.snippets_of(runs, seconds, step)
        if len(cut) < MINIMUM_GROUPS or len(np.unique(cut.group)) < 2:
            continue
        slow = SnippetCondition(seconds, False, slow=True, below=below)
        pairs = [(slow, cut.cut_from(slow_real), cut.cut_from(slow_made))]
        if below == spectra.STOP_FREQUENCY:  # a recording that is valid to less shows nothing else
            same_start = snippets.sample_snippets(profile, cut, seed + 1, with_sensor=True)
            same = np.array(spectra.dithered(list(same_start), resolution, seed + 4))
            shown = cut.cut_from(real), cut.cut_from(recorded), same
            measured, free, same = (spectra.in_band(rows, step) for rows in shown)
            fast = SnippetCondition(seconds, False, below=spectra.RECORDED_BELOW)
            pairs[:0] = [(replace(fast, same_start=True), measured, same), (fast, measured, free)]
        conditions += [
            _under(condition, cut, own, sampled, profile, seed, classify) for condition, own, sampled in pairs
        ]
    short = snippets.snippets_of(runs, snippets.LENGTHS[0], step)
    whose = np.array([str(number) for number, _ in short.place])
    if conditions and conditions[0].condition.same_start and conditions[0].condition.seconds == snippets.LENGTHS[0]:
        conditions[0] = _with_proper_scores(conditions[0], profile, short, seed)
    return Realism(
        tuple(conditions), variance_parts(short.offset, whose), variance_parts(short.cut_from(recorded), whose)
    )


MINIMUM_ROWS = 6  # Of a snippet that a classifier is shown. [-]


def _under(
    condition: SnippetCondition,
    cut: Snippets,
    real: FloatArray,
    sampled: FloatArray,
    profile: DriverProfile,
    seed: int,
    classify: bool,
) -> ConditionScores:
    """Scores of one condition; `real` and `sampled` of shape (n, m). [m]"""
    step = profile.model.step
    highest = spectra.PASS_FREQUENCY / spectra.STOP_FREQUENCY * condition.below
    measured = snippets.features_of(real, cut.lane_width, step, highest=highest)
    made = snippets.features_of(sampled, cut.lane_width, step, highest=highest)
    families, named = _distances(condition, measured, made, real, cut.group, seed)
    alone = jointly = floor = None
    stop = condition.below if condition.slow else spectra.CLASSIFIED_BELOW
    drives, copies = (
        spectra.thinned(rows if condition.slow else spectra.in_band(rows, step, stop), step, stop)
        for rows in (real, sampled)
    )
    if classify and drives.shape[1] >= MINIMUM_ROWS:
        fast, group = not condition.slow, cut.group
        alone = classifier_two_sample_test(drives, copies, group, group, fast=fast, seed=seed)
        if not condition.same_start:
            half = split_groups(group, np.random.default_rng(seed))
            sides, drivers = (drives[half], drives[~half]), (group[half], group[~half])
            floor = classifier_two_sample_test(*sides, *drivers, fast=fast, seed=seed)
        if condition.slow:
            context = context_features(cut, real), context_features(cut, sampled)
            jointly = classifier_two_sample_test(drives, copies, group, group, context=context, seed=seed)
    means = snippets.named_means(measured, made)
    return ConditionScores(
        condition, profile.sensor is not None, len(cut), families, named, means, alone, jointly, floor
    )


def _distances(
    condition: SnippetCondition,
    measured: snippets.Features,
    made: snippets.Features,
    real: FloatArray,
    group: NDArray[np.str_],
    seed: int,
) -> tuple[dict[str, WithFloor], dict[str, WithFloor]]:
    """Over random halves: a half beside its own sampled snippets, and beside the other half; equally many in both."""
    rng = np.random.default_rng(seed)
    values, floors, named, named_floors = [], [], [], []
    for _ in range(SPLITS):
        half = split_groups(group, rng)
        rows, others = np.flatnonzero(half), np.flatnonzero(~half)
        stand_ins = None
        if condition.same_start:  # other drivers' snippets that start there too
            count, first = min(snippets.FLOOR_DRAWS, len(others)), real[:, 0]
            starts = first[rows], group[rows], first[others], group[others]
            stand_ins = others[snippets.windows_with_the_same_start(*starts, rng, count=count)]
        values.append(snippets.differences(measured, made, rows, rows))
        floors.append(snippets.real_against_real(measured, measured, rows, others, stand_ins))
        named.append(snippets.named_distances(measured.take(rows), made.take(rows)))
        beside = others if stand_ins is None else stand_ins[:, 0]
        named_floors.append(snippets.named_distances(measured.take(rows), measured.take(beside)))
    return _beside(values, floors, snippets.UNITS), _beside(named, named_floors, {})


def _beside(
    values: Sequence[Mapping[str, float]], floors: Sequence[Mapping[str, float]], units: Mapping[str, str]
) -> dict[str, WithFloor]:
    """Means over random halves; halves differ as much as wholes drawn anew do (delete-half jackknife)."""
    measures = {}
    for name in values[0]:
        value, floor = (np.array([one[name] for one in several]) for several in (values, floors))
        with np.errstate(divide="ignore", invalid="ignore"):
            error = float(np.log(value / floor).std(ddof=1))
        measures[name] = WithFloor(float(value.mean()), float(floor.mean()), units.get(name, "sd"), error)
    return measures


def _with_proper_scores(scores: ConditionScores, profile: DriverProfile, cut: Snippets, seed: int) -> ConditionScores:
    """Energy and variogram score of several sampled snippets, beside other drivers' snippets with the same start."""
    chosen = np.unique(np.linspace(0, len(cut) - 1, min(len(cut), SCORED_SNIPPETS)).astype(np.int64))
    begin, every, step = cut.offset[chosen, 0], cut.segments, profile.model.step
    segments = [every[row] for row in chosen]
    members = [
        spectra.in_band(np.array(snippets.sample_recorded(profile, segments, begin, seed + 10 + k)), step)
        for k in range(ENSEMBLE_SIZE)
    ]
    rng, starts = np.random.default_rng(seed), (begin, cut.group[chosen], cut.offset[:, 0], cut.group)
    drivers = snippets.windows_with_the_same_start(*starts, rng, count=ENSEMBLE_SIZE)
    seen = spectra.in_band(cut.offset, step)
    sampled = proper_scores(seen[chosen], np.stack(members, axis=1))
    real = proper_scores(seen[chosen], seen[drivers])
    added = {name: WithFloor(sampled[name], real[name], SCORE_UNITS[name]) for name in sampled}
    return replace(scores, families={**scores.families, **added})
