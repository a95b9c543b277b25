"""Does a fitted profile move as much as the drivers it was fitted to, frequency by frequency?

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m laboratory.power_by_band dlr.parquet [--seed 0] [--draws 4] [--write PAGE.md]

A profile is fitted to a random half of the vehicles, as in `fair_measure`, and the driver alone is sampled under the
context of the same half, and of the other one. Power in windows of 30 s below 0.5 Hz, sampled over recorded [dB].
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from laboratory.fair_measure import halves
from laboratory.markers import show
from xosc_lateral.drivers.drives.drive import Run, all_runs
from xosc_lateral.drivers.drives.filters import Detrend, periodograms
from xosc_lateral.drivers.evaluation.snippets import sample_runs
from xosc_lateral.drivers.fitting.fitting import fit_profile
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.drives import read_drives

FloatArray = NDArray[np.float64]
SECONDS = 30.0
EDGES = (0.05, 0.1, 0.2, 0.3, 0.4, 0.45, 0.5)


def power(paths: Sequence[FloatArray], step: float) -> FloatArray:
    """Mean power in the bands, windows of all paths alike. [arbitrary unit]"""
    size = round(SECONDS / step)
    rows = np.concatenate([periodograms(path, size, detrend=Detrend.ENDS) for path in paths])
    frequency = np.fft.rfftfreq(size, step)
    mean = rows.mean(axis=0)
    return np.array([mean[(frequency >= low) & (frequency < high)].mean() for low, high in pairwise(EDGES)])


def lacks(profile: DriverProfile, runs: Sequence[Run], seed: int, draws: int) -> FloatArray:
    """Sampled over recorded power, mean over the draws. [dB]"""
    step = profile.model.step
    sampled = [power(sample_runs(profile, runs, seed + draw, same_start=False), step) for draw in range(draws)]
    return np.asarray(10.0 * np.log10(np.mean(sampled, axis=0) / power([run.offset for run in runs], step)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--draws", type=int, default=4)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    one, other = halves(read_drives(args.table), args.seed)
    own, others = [], []
    for fitted, held_out in ((one, other), (other, one)):
        profile = fit_profile(fitted, name="half")
        own.append(lacks(profile, all_runs(fitted), args.seed, args.draws))
        others.append(lacks(profile, all_runs(held_out), args.seed, args.draws))
    lines = ["| frequency [Hz] | vehicles of the fit [dB] | other vehicles [dB] |", "|---|---|---|"]
    for (low, high), a, b in zip(pairwise(EDGES), np.transpose(own), np.transpose(others), strict=True):
        lines.append(f"| {low:g} to {high:g} | {a[0]:.1f} / {a[1]:.1f} | {b[0]:.1f} / {b[1]:.1f} |")
    show("\n".join(lines), args.write, "power-by-band")


if __name__ == "__main__":
    main()
