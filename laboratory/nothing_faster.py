"""Does the measure below 0.5 Hz see anything of what is faster? The recording beside itself without it.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m laboratory.nothing_faster dlr.parquet [--write PAGE.md]

What is above 0.5 Hz is taken out of the recorded runs by a filter of its own, ten times as sharp as the measure's. The
classifier is then asked to tell these runs from the recorded ones: 0.5 is blind, anything else is an error of the
measure, whatever a model does.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from laboratory.fair_null import slow_test
from laboratory.markers import show
from xosc_lateral.drivers.drives.drive import all_runs
from xosc_lateral.drivers.drives.filters import filtered, low_pass_between
from xosc_lateral.drivers.drives.resampling import STEP
from xosc_lateral.drivers.evaluation.snippets import snippets_of
from xosc_lateral.drivers.evaluation.spectra import STOP_FREQUENCY, slow_movement
from xosc_lateral.files.drives import read_drives

LENGTHS = (10.0, 30.0, 60.0)
"""Of snippets. [s]"""
TRANSITION = 0.01
"""Of the filter that takes out what is faster. [Hz]"""
ATTENUATION = 50.0
"""Of the same. [dB]"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    runs = all_runs(read_drives(args.table))
    lines = ["| snippets | AUC | 95 % interval |", "|---|---|---|"]
    kernel = low_pass_between(STOP_FREQUENCY, STOP_FREQUENCY + TRANSITION, STEP, ATTENUATION)
    own = [slow_movement(run.offset, STEP) for run in runs]
    slow = [slow_movement(filtered(run.offset, kernel), STEP) for run in runs]
    for seconds in LENGTHS:
        found = slow_test(snippets_of(runs, seconds, STEP), own, slow, STEP)
        lines.append(f"| {seconds:g} s | {found.auc:.3f} | {found.low:.3f} to {found.high:.3f} |")
    show("\n".join(lines), args.write, "nothing-faster")


if __name__ == "__main__":
    main()
