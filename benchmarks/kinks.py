"""Tracks made of pieces: how much of what a recording shows at each frequency are the kinks between them?

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m benchmarks.kinks dlr.parquet [--write docs/design/sensor.md]

Jumps of the slope are read off the rows; their density over the fourth power of the frequency stands beside the density
of the runs, which is measured apart.
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.markers import write_between_markers
from xosc_lateral.driver.sensor.kinks import Kinks
from xosc_lateral.driver.sensor.kinks_fit import find_kinks
from xosc_lateral.driver.sensor.periodogram import windows_of
from xosc_lateral.driver.sensor.runs import rows_of
from xosc_lateral.drives.cuts import all_runs
from xosc_lateral.drives.resampling import STEP, passed
from xosc_lateral.formats.drives import read_drives

EDGES = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.6, 0.7, 0.8, 0.9, 0.97, 1.03, 1.1, 1.3, 1.5, 1.6, 1.9)
"""[Hz]"""


def all_of_theirs(kinks: Kinks, frequency: np.ndarray) -> np.ndarray:
    """Density of the kinks in runs, what is left to the driver included. [m2/Hz]"""
    folded = np.abs((frequency + kinks.highest) % (2.0 * kinks.highest) - kinks.highest)
    jumps = np.interp(folded, np.linspace(0.0, kinks.highest, len(kinks.densities)), kinks.densities)
    return jumps / kinks.every**2 / (2.0 * np.pi * frequency) ** 4 * passed(frequency) ** 2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    drives = read_drives(args.table)
    runs = all_runs(drives)
    rows, rate = rows_of(runs, drives)
    assert rows is not None and rate is not None
    frequency, windows = windows_of([run.offset for run in runs], STEP)
    density = windows.mean(axis=0)
    found = find_kinks(rows, rate, frequency, density)
    if found is None:
        raise SystemExit("no kinks at even times")
    kinks, noise = found
    lines = ["| frequency [Hz] | measured [m²/Hz] | of the kinks | ratio |", "|---|---|---|---|"]
    for low, high in pairwise(EDGES):
        inside = (frequency >= low) & (frequency < high)
        seen, theirs = density[inside].mean(), all_of_theirs(kinks, frequency[inside]).mean()
        lines.append(f"| {low:g} to {high:g} | {seen:.2g} | {theirs:.2g} | {theirs / seen:.2f} |")
    lines += [
        "",
        f"A kink every {kinks.every:g} s; about the pieces, rows lie within {1e3 * noise:.2f} mm rms (a millimetre's "
        f"rounding is {1e3 * 1e-3 / np.sqrt(12.0):.2f} mm). The logarithm of the squared jumps' level varies by "
        f"{kinks.level_variance:.2f} and lasts {kinks.level_duration:.0f} s.",
    ]
    text = "\n".join(lines)
    print(text)
    if args.write is not None:
        write_between_markers(args.write, text, "kinks")


if __name__ == "__main__":
    main()
