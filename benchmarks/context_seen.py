"""What a classifier gains from the context: by which columns, and in which movement.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m benchmarks.context_seen dlr.parquet [--seed 0] [--write docs/validation/realism.md]

Free runs of the driver alone beside recorded ones, snippets of 10 s, as in `fair_measure`, below 0.5 Hz and below
0.25 Hz. Columns that say where a vehicle is (the road's curvature, its lanes' width, and speed and acceleration, which
traffic has in common at a place) and all others are shown apart.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.fair_measure import halves
from benchmarks.markers import write_between_markers
from xosc_lateral.driver.fitting import fit_profile
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.drives.cuts import all_runs
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.filters import kaiser_design, low_pass
from xosc_lateral.evaluation.classifier import classifier_two_sample_test, context_features
from xosc_lateral.evaluation.filters import ATTENUATION, CUTOFF, THINNED, TRANSITION
from xosc_lateral.evaluation.sampled_snippets import sample_runs
from xosc_lateral.evaluation.snippets import snippets_of
from xosc_lateral.formats.drives import read_drives

FloatArray = NDArray[np.float64]
SECONDS = 10.0
FACTORS = (1.0, 0.5)
"""Of the frequency below which movement is shown; all else goes with it. [-]"""
OF_PLACE = ("curvature", "lane_width", "speed", "acceleration")
EACH = 3
"""Features of a context column. [-]"""


def slow(path: FloatArray, step: float, factor: float) -> FloatArray:
    """As `below_half_hertz`, with another border. [m]"""
    nyquist = 0.5 / step
    half, beta = kaiser_design(ATTENUATION, factor * TRANSITION / nyquist)
    kernel = low_pass(half, factor * CUTOFF / nyquist, beta)
    half = min(half, len(path) - 1)
    middle = len(kernel) // 2
    kernel = kernel[middle - half : middle + half + 1] / kernel[middle - half : middle + half + 1].sum()
    return np.convolve(np.pad(path, half, mode="reflect", reflect_type="odd"), kernel, mode="valid")


def areas(profile: DriverProfile, runs: Sequence[Run], seed: int, factor: float) -> list[float]:
    """Without context, with all of it, with columns of the place, with the others."""
    step = profile.model.step
    cut = snippets_of(runs, SECONDS, step)
    every = round(THINNED / factor / step)
    real = cut.cut_from([slow(run.offset, step, factor) for run in runs])
    made = cut.cut_from([slow(path, step, factor) for path in sample_runs(profile, runs, seed, same_start=False)])
    context = context_features(cut, real), context_features(cut, made)
    names = sorted({name for one in cut.items for name in one.run.context})
    of_place = np.repeat([name in OF_PLACE for name in names], EACH)
    found = []
    for chosen in (None, np.ones(len(of_place), dtype=bool), of_place, ~of_place):
        seen = None if chosen is None else [part[:, chosen] for part in context]
        shown = real[:, ::every], made[:, ::every]
        result = classifier_two_sample_test(*shown, cut.group, cut.group, context=seen, seed=seed)
        assert result is not None
        found.append(result.auc)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    one, other = halves(read_drives(args.table), args.seed)
    pairs = [(fit_profile(a, name="half"), all_runs(b)) for a, b in ((one, other), (other, one))]
    lines = [
        "| movement below | alone | with all context | with the place's | with the rest |",
        "|---|---|---|---|---|",
    ]
    for factor in FACTORS:
        found = np.array([areas(profile, runs, args.seed, factor) for profile, runs in pairs])
        cells = " | ".join(f"{a:.3f} / {b:.3f}" for a, b in found.T)
        lines.append(f"| {factor * CUTOFF:g} Hz | {cells} |")
    text = "\n".join(lines)
    print(text)
    if args.write is not None:
        write_between_markers(args.write, text, "context-seen")


if __name__ == "__main__":
    main()
