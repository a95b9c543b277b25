"""Tracks made of pieces: how much of what a recording shows at each frequency are the slope jumps between them?

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m benchmarks.slope_jumps dlr.parquet [--write PAGE.md]

Jumps of the slope are read off the rows; their density over the fourth power of the frequency stands beside the density
of the runs, which is measured apart.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.markers import show
from xosc_lateral.driver.sensor.periodogram import windows_of
from xosc_lateral.driver.sensor.runs import rows_of
from xosc_lateral.driver.sensor.slope_jumps import SlopeJumps, mean_square
from xosc_lateral.driver.sensor.slope_jumps_fit import SHORTEST, bends_at, find_slope_jumps, flat_jumps, jumps_of
from xosc_lateral.drives.cuts import all_runs
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.formats.drives import read_drives

EDGES = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.6, 0.7, 0.8, 0.9, 0.97, 1.03, 1.1, 1.3, 1.5, 1.6, 1.9)
"""[Hz]"""


FIFTHS = 5
"""Parts that the slope jumps are dealt into by how much the path bends at them. [-]"""


def by_bend(slope_jumps: SlopeJumps, rows: Sequence[np.ndarray], rate: float) -> list[str]:
    """How large jumps are where the path bends so much, and what the profile makes of it."""
    size = round(slope_jumps.every * rate)
    found = [(one, *jumps_of(one, size, rate)) for one in rows if len(one) >= SHORTEST * size]
    jumps = np.concatenate(
        [flat_jumps(jump, np.array(slope_jumps.densities), slope_jumps.every) for _, jump, _ in found]
    )
    bends = np.concatenate([bends_at(one, jump, first, size, rate) for one, jump, first in found])
    jumps, bends = jumps[np.isfinite(bends)], np.abs(bends[np.isfinite(bends)])
    lines = [
        "| acceleration of the path at the slope jump [m/s²] | mean square of the jumps | in the profile |",
        "|---|---|---|",
    ]
    for low, high in pairwise(np.quantile(bends, np.linspace(0.0, 1.0, FIFTHS + 1)).tolist()):
        inside = (bends >= low) & (bends <= high)
        expected = mean_square(slope_jumps.with_movement, (bends[inside] / slope_jumps.acceleration) ** 2)
        lines.append(f"| {low:.3f} to {high:.3f} | {(jumps[inside] ** 2).mean():.2f} | {expected.mean():.2f} |")
    return lines


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
    found = find_slope_jumps(rows, rate, [run.offset for run in runs])
    if found is None:
        raise SystemExit("no slope jumps at even times")
    slope_jumps, noise = found
    lines = ["| frequency [Hz] | measured [m²/Hz] | of the slope jumps | ratio |", "|---|---|---|---|"]
    for low, high in pairwise(EDGES):
        inside = (frequency >= low) & (frequency < high)
        seen, theirs = density[inside].mean(), slope_jumps.of_jumps(frequency[inside]).mean()
        lines.append(f"| {low:g} to {high:g} | {seen:.2g} | {theirs:.2g} | {theirs / seen:.2f} |")
    lines += [
        "",
        f"A slope jump every {slope_jumps.every:g} s; about the pieces, rows lie within {1e3 * noise:.2f} mm rms (a "
        f"millimetre's rounding is {1e3 * 1e-3 / np.sqrt(12.0):.2f} mm). The logarithm of the squared jumps' level "
        f"varies by {slope_jumps.level_variance:.2f} and lasts {slope_jumps.level_duration:.0f} s; what lasts all "
        f"along a track varies by {slope_jumps.track_variance:.2f} from track to track; "
        f"{100 * slope_jumps.with_movement:.0f} % of the squares go with the square of the path's acceleration, "
        f"{slope_jumps.acceleration:.3f} m/s² rms (mean square of all: 1):",
        "",
        *by_bend(slope_jumps, rows, rate),
    ]
    show("\n".join(lines), args.write, "slope-jumps")


if __name__ == "__main__":
    main()
