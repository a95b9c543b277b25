"""How true a profile is to measured drives: distances, the paper's four evaluations, and beyond.

The paper (arXiv:2405.17080, section IV) compares ten metrics of 10 s snippets in four evaluations; before them comes
the fair measure (`realism`), beside them spectrum, autocorrelation and the lane's margins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, all_significant, significant
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.evaluation import spectra
from xosc_lateral.drivers.evaluation.lane_keeping import UNITS, Margins, margins
from xosc_lateral.drivers.evaluation.metrics import (
    METRICS,
    Distances,
    mean_distances,
    metric_distances,
    snippet_metrics,
    split_groups,
)
from xosc_lateral.drivers.evaluation.realism import ConditionScores, Realism, WithFloor, score_realism
from xosc_lateral.drivers.evaluation.snippets import (
    PartEvaluation,
    SnippetCondition,
    Snippets,
    evaluate_parts,
    sample_runs,
    sample_snippets,
    sensor_noise,
    snippets_of,
)
from xosc_lateral.drivers.model.profile import DriverProfile

SNIPPET = 10.0  # The paper's. [s]
SPLITS = 8  # Random halves of the drives that both are averaged over.


@dataclass(frozen=True, eq=False)
class SnippetScores:
    """Distances for snippets of one length."""

    seconds: float  # Length. [s]
    count: int
    distances: Distances  # Real to sampled and real to real, averaged over the same random halves of the drives.
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
    """Distances of sampled snippets, and between measured ones, shape (n, m) each, over random halves of the groups.

    A half of real snippets is compared with its own sampled ones, and with the other real half: both distances rest on
    as many snippets. Row k of both starts at the same offset under the same context.
    """
    rng = np.random.default_rng(seed)
    metrics, artificial = snippet_metrics(real), snippet_metrics(sampled)
    model, floor = [], []
    for _ in range(SPLITS):
        half = split_groups(group, rng)
        model.append(metric_distances(metrics[half], artificial[half]))
        floor.append(metric_distances(metrics[half], metrics[~half]))
    beside = mean_distances(floor)
    if not all(beside.by_metric[name] > 0.0 for name in METRICS):
        raise NotEnoughDataError(
            "the drives are all the same, so none tells how real drivers differ; is one there twice?"
        )
    return SnippetScores(seconds, len(real), mean_distances(model), beside)


LONG_SNIPPET = 60.0  # [s]
LAGS = (0.2, 0.4, 0.6, 1.0, 1.4, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0)  # Of the autocorrelation. [s]
TRACE_COUNT, TRACE_SECONDS = 6, 120.0  # Drives of which a trace is kept for the eye, and its length. [s]
MIN_SNIPPETS = 20  # Fewer say nothing about a distribution.


@dataclass(frozen=True, eq=False)
class Trace:
    """A measured stretch of one drive, and what the profile does from the same start under the same context."""

    drive: str
    step: float  # [s]
    real: FloatArray  # shape (n,): Offsets. [m]
    sampled: FloatArray  # shape (n,). [m]


@dataclass(frozen=True, eq=False)
class ProfileScores:
    """Everything that `evaluate` finds."""

    profile: str  # Its name.
    drives: int  # What was measured, and how many hours of it.
    runs: int
    hours: float
    realism: Realism  # The headline: free runs and shared starts beside other real drivers.
    verdict: spectra.Verdict  # Up to which frequency free runs are like other real drivers.
    snippets: SnippetScores  # 10 s.
    long_snippets: SnippetScores | None  # 60 s; None with fewer than `MIN_SNIPPETS`.
    evaluations: tuple[PartEvaluation, ...]
    spectrum_real: spectra.Spectrum
    spectrum_sampled: spectra.Spectrum
    lags: FloatArray  # shape (k,). [s]
    autocorrelation_real: FloatArray  # shape (k,). [-]
    autocorrelation_sampled: FloatArray  # shape (k,). [-]
    margins_real: Margins
    margins_sampled: Margins
    traces: tuple[Trace, ...]  # The longest run of each of the first `TRACE_COUNT` drives, for the eye.
    seed: int
    # Movement below this alone was compared in `snippets` and `realism`: 0.5 Hz or, of free runs, less. [Hz]
    below: float = spectra.STOP_FREQUENCY

    @property
    def classifier_auc(self) -> float | None:
        """Area under the ROC curve of snippets of 10 s with the same start; None: not trained. [-]"""
        shared = self.realism.of(SnippetCondition(SNIPPET, True))
        return None if shared is None or shared.alone is None else shared.alone.auc

    @property
    def spectrum_error(self) -> float:
        """Root mean square of the spectra's difference over the bands that the recording is valid in. [dB]"""
        real = self.spectrum_real
        common = len(real.density) if self.below == spectra.STOP_FREQUENCY else int((real.frequency < self.below).sum())
        ratio = self.spectrum_sampled.density[:common] / real.density[:common]
        return float(np.sqrt(np.mean((10.0 * np.log10(ratio)) ** 2)))


def score_profile(profile: DriverProfile, runs: Sequence[Run], *, seed: int, classify: bool = True) -> ProfileScores:
    """Evaluate a profile on measured runs at its step.

    Raises `NotEnoughDataError` with fewer than `MIN_SNIPPETS` snippets of 10 s. `classify`: train the classifiers too.
    The profile's sensor is that of the runs' recording, where it is known (`fitting.driver_runs`).
    """
    step, below = profile.model.step, spectra.comparison_band(runs)
    short = snippets_of(runs, SNIPPET, step)
    if len(short) < MIN_SNIPPETS:
        raise NotEnoughDataError(
            f"{len(short)} snippets of {SNIPPET:g} s are left after cutting; {MIN_SNIPPETS} are needed to compare"
        )
    long = snippets_of(runs, LONG_SNIPPET, step)
    sampled = sample_snippets(profile, short, seed)
    recorded = sampled if profile.sensor is None else sample_snippets(profile, short, seed, with_sensor=True)
    free = sample_runs(profile, runs, seed + 1)
    widths = [run.lane_width for run in runs]
    offsets = [run.offset for run in runs]
    real, made = (
        [spectra.slow_movement(path, step, spectra.RECORDED_BELOW) for path in paths]
        for paths in (offsets, _recorded(profile, free, seed + 1))
    )
    lags = [round(lag / step) for lag in LAGS]
    unbound = sample_runs(profile, runs, seed + 4, same_start=False)
    slow = None
    if below < spectra.STOP_FREQUENCY:
        slow = tuple(
            [spectra.slow_movement(path, step, below) for path in paths]
            for paths in (offsets, _recorded(profile, unbound, seed + 4))
        )

    def scored(cut: Snippets, made: FloatArray, seconds: float) -> SnippetScores:
        if slow is not None:
            real, made = (cut.cut_from(paths) for paths in slow)
        else:
            real, made = (spectra.in_band(rows, step) for rows in (cut.offset, made))
        return score_snippets(real, made, cut.group, seed=seed, seconds=seconds)

    long_scores = None
    if len(long) >= MIN_SNIPPETS and len(np.unique(long.group)) >= 2:
        long_scores = scored(long, sample_snippets(profile, long, seed + 2, with_sensor=True), LONG_SNIPPET)
    return ProfileScores(
        profile=profile.name,
        drives=len({run.drive for run in runs}),
        runs=len(runs),
        hours=sum(map(len, runs)) * step / 3600.0,
        realism=score_realism(profile, runs, seed=seed + 4, classify=classify),
        snippets=scored(short, recorded, SNIPPET),
        long_snippets=long_scores,
        evaluations=evaluate_parts(profile, short, sampled, seed=seed + 3),
        spectrum_real=spectra.spectrum(real, step),
        spectrum_sampled=spectra.spectrum(made, step),
        lags=np.array(LAGS),
        autocorrelation_real=spectra.autocorrelation(real, lags),
        autocorrelation_sampled=spectra.autocorrelation(made, lags),
        margins_real=margins(offsets, widths, step),
        margins_sampled=margins(_recorded(profile, unbound, seed + 4), widths, step),
        traces=_traces(runs, free, step),
        seed=seed,
        below=below,
        verdict=verdict(profile, runs, seed),
    )


def _recorded(profile: DriverProfile, paths: Sequence[FloatArray], seed: int) -> list[FloatArray]:
    """Paths as the recording's sensor has them. [m]"""
    return [path + error for path, error in zip(paths, sensor_noise(profile, paths, seed), strict=True)]


LEAST_DRIVES, MOST_TIMES = 60, 8
"""Sampled for a verdict, as far as so many times the measured ones suffice: what is sampled then adds little chance."""


def verdict(profile: DriverProfile, runs: Sequence[Run], seed: int) -> spectra.Verdict:
    """Free runs with the recording's sensor beside the measured ones, both at the recording's resolution."""
    step, resolution = profile.model.step, spectra.resolution_of(runs)
    drives = {run.drive for run in runs}
    groups = [run.drive if len(drives) > 3 else f"{run.drive} {run.index}" for run in runs]
    sampled = []
    for k in range(min(-(-LEAST_DRIVES // len(drives)), MOST_TIMES)):
        band_seed = seed + 5 + 100 * k
        free = spectra.dithered(sample_runs(profile, runs, band_seed, same_start=False), resolution, band_seed + 2)
        sampled.append((free, sensor_noise(profile, free, band_seed)))
    measured = spectra.dithered([run.offset for run in runs], resolution, seed + 6)
    limits = [run.valid_below for run in runs if run.valid_below is not None]
    return spectra.verdict_of(measured, sampled, groups, step, min([np.inf, *limits]))


def _traces(runs: Sequence[Run], sampled: Sequence[FloatArray], step: float) -> tuple[Trace, ...]:
    longest: dict[str, int] = {}
    for k, run in enumerate(runs):
        if run.drive not in longest or len(run) > len(runs[longest[run.drive]]):
            longest[run.drive] = k
    rows = slice(0, round(TRACE_SECONDS / step) + 1)
    return tuple(
        Trace(drive, step, np.array(runs[k].offset[rows]), np.array(sampled[k][rows]))
        for drive, k in list(longest.items())[:TRACE_COUNT]
    )


# ---- Scores as plain values: what `evaluate --json` prints ----
def scores_to_dict(scores: ProfileScores) -> dict[str, Any]:
    """Plain JSON values, for `--json` and for a profile's provenance (without the single snippets)."""
    return {
        "profile": scores.profile,
        "seed": scores.seed,
        "drives": scores.drives,
        "runs": scores.runs,
        "hours": round(scores.hours, 4),
        "verdict": {
            "words": scores.verdict.in_words(),
            "driver": scores.verdict.judged(spectra.DRIVER),
            "recording": scores.verdict.judged(spectra.RECORDING),
            "compared_below_hz": scores.verdict.highest,
            "like_up_to_hz": scores.verdict.like_up_to(),
            "ratios": [
                {
                    "of": one.of,
                    "what": one.name,
                    "low_hz": one.low,
                    "high_hz": one.high,
                    "ratio": significant(one.ratio, 3),
                    "interval": list(all_significant(np.array(one.interval), 3)),
                    "cause": one.cause,
                    "judged": one.judged,
                }
                for one in scores.verdict.ratios
            ],
            "alarms_per_hour": {
                f"{speed:g}": {
                    "real": round(real, 1) if scores.verdict.shows_alarms else None,
                    "sampled": round(made, 1),
                }
                for speed, (real, made) in scores.verdict.alarms.items()
            },
        },
        "compared_below_hz": scores.below,
        "realism": [_condition_to_dict(each) for each in scores.realism.conditions],
        "variance_m2": {
            side: {
                "between_drivers": round(parts.between, 6),
                "within_drivers": round(parts.within, 6),
                "inside_snippets": round(parts.inside, 6),
            }
            for side, parts in (("real", scores.realism.variance_real), ("sampled", scores.realism.variance_sampled))
        },
        "snippets": _snippets_to_dict(scores.snippets),
        "long_snippets": None if scores.long_snippets is None else _snippets_to_dict(scores.long_snippets),
        "evaluations": [
            {
                "number": each.number,
                "coarse": each.coarse,
                "fine": each.fine,
                "distances": _rounded(each.distances.by_metric),
            }
            for each in scores.evaluations
        ],
        "spectrum": {
            "frequency_hz": [round(float(f), 5) for f in scores.spectrum_real.frequency],
            "real_m2_per_hz": list(all_significant(scores.spectrum_real.density, 4)),
            "sampled_m2_per_hz": list(all_significant(scores.spectrum_sampled.density, 4)),
            "error_db": round(scores.spectrum_error, 3),
        },
        "autocorrelation": {
            "lag_s": list(LAGS),
            "real": [round(float(v), 4) for v in scores.autocorrelation_real],
            "sampled": [round(float(v), 4) for v in scores.autocorrelation_sampled],
        },
        "margins": {
            side: {
                "share_near_marking": round(used.share_near, 5),
                "excursions_per_hour": round(used.excursions_per_hour, 2),
                "largest_offset_m": round(used.largest, 3),
            }
            for side, used in (("real", scores.margins_real), ("sampled", scores.margins_sampled))
        },
        "classifier_auc": None if scores.classifier_auc is None else round(scores.classifier_auc, 4),
    }


def _snippets_to_dict(scores: SnippetScores) -> dict[str, Any]:
    worst, ratio = scores.worst_ratio
    return {
        "seconds": scores.seconds,
        "count": scores.count,
        "distance": _rounded(scores.distances.by_metric),
        "floor": _rounded(scores.floor.by_metric),
        "mean_distance": round(scores.distances.mean, 4),
        "mean_floor": round(scores.floor.mean, 4),
        "mean_ratio": round(scores.ratio, 3),
        "worst_metric": worst,
        "worst_ratio": round(ratio, 3),
    }


def _condition_to_dict(scores: ConditionScores) -> dict[str, Any]:
    areas = {"movement": scores.alone, "with_context": scores.jointly, "real_drivers": scores.floor}
    return {
        "seconds": scores.condition.seconds,
        "start": "same" if scores.condition.same_start else "free",
        "band": f"below {scores.condition.below:g} Hz",
        "sampled": "driver and sensor" if scores.with_sensor else "driver",
        "count": scores.count,
        "families": {name: {**_beside_to_dict(value), "unit": value.unit} for name, value in scores.families.items()},
        "distances": {name: _beside_to_dict(value) for name, value in scores.named.items()},
        "indicators": {
            name: {"real": round(real, 5), "sampled": round(sampled, 5), "unit": unit}
            for (name, (real, sampled)), unit in zip(scores.means.items(), UNITS, strict=True)
        },
        "auc": None
        if scores.alone is None
        else {name: None if area is None else _rounded(asdict(area)) for name, area in areas.items()},
    }


def _beside_to_dict(number: WithFloor) -> dict[str, Any]:
    ratio = round(number.ratio, 3) if isfinite(number.ratio) else None
    interval = list(all_significant(np.array(number.interval), 3)) if isfinite(number.error) else None
    return {"value": round(number.value, 4), "floor": round(number.floor, 4), "ratio": ratio, "interval": interval}


def _rounded(values: Mapping[str, float]) -> dict[str, float]:
    return {name: round(value, 4) for name, value in values.items()}
