"""What would the fair measure say of a model that is the truth? The recording replaced by sampled drives.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m laboratory.fair_null dlr.parquet [--repeats 12] [--no-neighbours]
        [--write PAGE.md]

A profile is fitted to all vehicles, and stands for the truth: each recorded run is replaced by one that it sampled
under the same context. These drives are halved, fitted and judged as the recording is (free runs below 0.5 Hz, both
halves). What is left above 0.5 is chance: of the vehicles that a half holds, of the fit, and of the classifier.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from laboratory.markers import show
from xosc_lateral.drivers.drives.drive import Run, all_runs
from xosc_lateral.drivers.evaluation.classifier import TwoSampleResult, classifier_two_sample_test, context_features
from xosc_lateral.drivers.evaluation.snippets import Snippets, sample_runs, snippets_of
from xosc_lateral.drivers.evaluation.spectra import slow_movement, thinned
from xosc_lateral.drivers.fitting.fitting import fit_population, fit_profile
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.drives import read_drives

FloatArray = NDArray[np.float64]

FIRST_SEED = 300
"""Of the drives that stand for a recording; one more for each repeat."""

MEASURES = ((10.0, False), (10.0, True), (30.0, False), (30.0, True), (60.0, False))
"""Length of the snippets [s], and whether the classifier sees the context, too."""


def slow_test(
    cut: Snippets,
    real: Sequence[FloatArray],
    made: Sequence[FloatArray],
    step: float,
    *,
    jointly: bool = False,
    seed: int = 0,
) -> TwoSampleResult:
    """How well paths [m] beside runs are told from the runs' own, both below 0.5 Hz already, as in `score_realism`."""
    own, others = cut.cut_from(real), cut.cut_from(made)
    context = (context_features(cut, own), context_features(cut, others)) if jointly else None
    shown = thinned(own, step), thinned(others, step)
    result = classifier_two_sample_test(*shown, cut.group, cut.group, context=context, seed=seed)
    assert result is not None
    return result


def areas(profile: DriverProfile, runs: Sequence[Run], seed: int) -> FloatArray:
    """Area under the ROC curve for each of `MEASURES`. [-]"""
    step = profile.model.step
    real = [slow_movement(run.offset, step) for run in runs]
    made = [slow_movement(path, step) for path in sample_runs(profile, runs, seed, same_start=False)]
    cuts = [(snippets_of(runs, seconds, step), jointly) for seconds, jointly in MEASURES]
    return np.array([slow_test(cut, real, made, step, jointly=jointly, seed=seed).auc for cut, jointly in cuts])


def under_the_truth(
    truth: DriverProfile,
    runs: Sequence[Run],
    seed: int,
    *,
    neighbours: bool | None = None,
) -> FloatArray:
    """Areas for both halves of drives that a known profile sampled, shape (2, measures). [-]"""
    sampled = sample_runs(truth, runs, seed, same_start=False)
    drives = [replace(run, offset=path) for run, path in zip(runs, sampled, strict=True)]
    names = sorted({run.drive for run in drives})
    chosen = set(np.random.default_rng(seed).permutation(names)[: len(names) // 2].tolist())
    one = [run for run in drives if run.drive in chosen]
    other = [run for run in drives if run.drive not in chosen]
    pairs = ((one, other), (other, one))
    return np.array([areas(fit_population(a, name="half", neighbours=neighbours), b, 0) for a, b in pairs])


def table(found: FloatArray) -> list[str]:
    """Of areas, shape (repeats, 2, measures)."""
    lines = [
        "| snippets | mean | 95 % of the halves | 95 % of the means of both |",
        "|---|---|---|---|",
    ]
    for k, (seconds, jointly) in enumerate(MEASURES):
        single, both = found[:, :, k].ravel(), found[:, :, k].mean(axis=1)
        intervals = [" to ".join(f"{end:.3f}" for end in np.quantile(part, [0.025, 0.975])) for part in (single, both)]
        name = f"{seconds:g} s" + (", with context" if jointly else "")
        lines.append(f"| {name} | {single.mean():.3f} | {intervals[0]} | {intervals[1]} |")
    return [*lines, "", f"{len(found)} repeats."]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--repeats", type=int, default=12)
    parser.add_argument("--no-neighbours", dest="neighbours", action="store_false", default=None)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    drives = read_drives(args.table)
    truth, runs = fit_profile(drives, name="all", neighbours=args.neighbours), all_runs(drives)
    seeds = range(FIRST_SEED, FIRST_SEED + args.repeats)
    found = np.array([under_the_truth(truth, runs, seed, neighbours=args.neighbours) for seed in seeds])
    show("\n".join(table(found)), args.write, "fair-null")


if __name__ == "__main__":
    main()
