"""Twins of a recorded window beside the recording: in-lane movement and gaps.

    python -m laboratory.twins WHEEL [--begin 0] [--variants 20] [--write PAGE.md]

WHEEL is `tasi-0.15.4-py3-none-any.whl`; 6 minutes of processor time. The window is reconstructed and played once, and
enriched with each variant as `convert` does it (which also plays its output again, to see that the same happens).
A classifier is shown snippets of 10 s, below 0.5 Hz as in the fair measure, of the recorded road-following and of the
twin's at the same times. The null is the same test of a twin against the next twin: a model that is the truth.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from laboratory.fair_null import slow_test
from laboratory.markers import show
from laboratory.reconstruction import WINDOW, write
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.evaluation.snippets import Snippets, snippets_of
from xosc_lateral.drivers.evaluation.spectra import slow_movement
from xosc_lateral.extras.recordings.page import recorded_path
from xosc_lateral.extras.recordings.reconstruct import STEP, in_lane_offsets, reconstruct_recording
from xosc_lateral.extras.recordings.reconstruction import Reconstruction
from xosc_lateral.extras.recordings.recordings import read_recording
from xosc_lateral.extras.recordings.settings import ReconstructSettings
from xosc_lateral.files.profiles import read_profile
from xosc_lateral.workflows.conversion.enrich import SegmentedRun, enrich
from xosc_lateral.workflows.conversion.load import Played, play_scenario
from xosc_lateral.workflows.conversion.result import Enriched
from xosc_lateral.world.motion.gaps import Gap, gaps_of

FloatArray = NDArray[np.float64]

SECONDS = 10.0
AROUND = 5.0  # before and after a cut-in [s]
EVERY = 0.1  # [s], the step of the published models


@dataclass(frozen=True)
class Twins:
    """A window, its maneuvers as played, and every variant of them."""

    made: Reconstruction
    played: Played
    variants: list[Enriched]


def twins_of(source: Path, begin: float, variants: int) -> Twins:
    made = reconstruct_recording(read_recording(source), ReconstructSettings(begin=begin, end=begin + WINDOW))
    with tempfile.TemporaryDirectory() as folder:
        played = play_scenario(write(made, Path(folder)))
    chosen = {plan.name: one.profile for plan, one in zip(made.plans, made.drivers, strict=True) if one.profile}
    profiles = {name: read_profile(name) for name in set(chosen.values())}
    drivers = {name: profiles[profile] for name, profile in chosen.items()}
    made_up = [enrich(SegmentedRun(played.motion, played.network), drivers, seed=1, variant=k) for k in range(variants)]
    return Twins(made, played, made_up)


# ---- in-lane movement ------------------------------------------------------------------------------------------------
def in_lane_runs(twins: Twins) -> tuple[list[Run], list[list[FloatArray]]]:
    """Recorded road-following of those that a profile drives, and each variant's offsets at the same times. [m]"""
    runs = []
    for plan in twins.made.plans:
        if twins.variants[0].entity(plan.name).is_enriched:
            stretches = enumerate(in_lane_offsets(plan))
            runs += [Run(plan.name, number, *stretch) for number, stretch in stretches]
    time = twins.played.motion.entities[0].time
    paths = [
        [np.interp(run.time, time, variant.entity(run.drive).deviation) for run in runs] for variant in twins.variants
    ]
    return runs, paths


def told_apart(cut: Snippets, one: Sequence[FloatArray], other: Sequence[FloatArray], seed: int) -> float:
    return slow_test(cut, one, other, STEP, seed=seed).auc


def movement_lines(twins: Twins) -> list[str]:
    runs, paths = in_lane_runs(twins)
    cut = snippets_of(runs, SECONDS, STEP)
    real = [slow_movement(run.offset, STEP) for run in runs]
    made_up = [[slow_movement(path, STEP) for path in variant] for variant in paths]
    areas = [told_apart(cut, real, one, seed) for seed, one in enumerate(made_up)]
    null = [told_apart(cut, one, made_up[seed - 1], seed) for seed, one in enumerate(made_up)]
    spreads = [float(np.std(np.concatenate(one))) for one in (real, *made_up)]
    count = f"{len(cut.items)} snippets of {len({run.drive for run in runs})} vehicles"
    return [
        "| in-lane movement | AUC, mean | 5 to 95 % of the variants | spread [m] |",
        "|---|---|---|---|",
        f"| twin against recorded ({count}) | {_mean_and_range(areas)} | {np.mean(spreads[1:]):.3f}, recorded "
        f"{spreads[0]:.3f} |",
        f"| null: twin against another twin | {_mean_and_range(null)} | |",
    ]


def _mean_and_range(values: Sequence[float]) -> str:
    low, high = np.quantile(values, [0.05, 0.95])
    return f"{np.mean(values):.3f} | {low:.3f} to {high:.3f}"


# ---- gaps ------------------------------------------------------------------------------------------------------------
def gap_lines(twins: Twins) -> list[str]:
    motion, by_name = twins.played.motion, {plan.name: plan for plan in twins.made.plans}
    paths = [recorded_path(by_name[one.name], one.time, one) for one in motion.entities]
    recorded, nominal = gaps_of(motion, paths), twins.variants[0].gaps_before
    pairs = {gap.names for gap in recorded} & {gap.names for gap in nominal}
    lines = ["| smallest gap of a pair [m] | least | 5 % | half | pairs below 0.5 m |", "|---|---|---|---|---|"]
    for name, several in (
        ("recorded", [recorded]),
        ("maneuvers alone", [nominal]),
        (f"{len(twins.variants)} twins, mean", [one.gaps_after for one in twins.variants]),
    ):
        numbers = np.array([_gap_numbers(gaps, pairs) for gaps in several]).mean(axis=0)
        lines.append(f"| {name} | " + " | ".join(f"{value:.2f}" for value in numbers[:3]) + f" | {numbers[3]:.1f} |")
    return lines


def _gap_numbers(gaps: Sequence[Gap], pairs: set[tuple[str, str]]) -> list[float]:
    values = np.array([gap.distance for gap in gaps if gap.names in pairs])
    return [*np.quantile(values, [0.0, 0.05, 0.5]), float((values < 0.5).sum())]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path)
    parser.add_argument("--begin", type=float, default=0.0)
    parser.add_argument("--variants", type=int, default=20)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    twins = twins_of(args.source, args.begin, args.variants)
    parts = movement_lines(twins), gap_lines(twins)
    show("\n\n".join("\n".join(part) for part in parts), args.write, "twins")


if __name__ == "__main__":
    main()
