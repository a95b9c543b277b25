"""Does the measure below 0.5 Hz see anything of what is faster? The recording beside itself without it.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m benchmarks.nothing_faster dlr.parquet [--write docs/validation/realism.md]

What is above 0.5 Hz is taken out of the recorded runs by a filter of its own, ten times as sharp as the measure's. The
classifier is then asked to tell these runs from the recorded ones: 0.5 is blind, anything else is an error of the
measure, whatever a model does.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.markers import show
from xosc_lateral.drives.cuts import all_runs
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.filters import kaiser_design, low_pass, mirrored
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.evaluation.classifier import TwoSampleResult, classifier_two_sample_test
from xosc_lateral.evaluation.filters import HIGHEST, below_half_hertz, thinned
from xosc_lateral.evaluation.snippets import snippets_of
from xosc_lateral.formats.drives import read_drives

FloatArray = NDArray[np.float64]
LENGTHS = (10.0, 30.0, 60.0)
"""Of snippets. [s]"""
TRANSITION = 0.01
"""Of the filter that takes out what is faster. [Hz]"""
ATTENUATION = 50.0
"""Of the same. [dB]"""


def without_faster(path: FloatArray, step: float) -> FloatArray:
    """A path without its movement above 0.5 Hz, and with all that is below. [m]"""
    nyquist = 0.5 / step
    half, beta = kaiser_design(ATTENUATION, TRANSITION / nyquist)
    kernel = low_pass(half, (HIGHEST + 0.5 * TRANSITION) / nyquist, beta)
    return np.convolve(mirrored(path, half), kernel, mode="valid")


def told(runs: Sequence[Run], seconds: float) -> TwoSampleResult | None:
    """How well runs are told from themselves without what is faster, both below 0.5 Hz."""
    cut = snippets_of(runs, seconds, STEP)
    own = [run.offset for run in runs]
    slow = [without_faster(path, STEP) for path in own]
    shown = [thinned(cut.cut_from([below_half_hertz(path, STEP) for path in paths]), STEP) for paths in (own, slow)]
    return classifier_two_sample_test(shown[0], shown[1], cut.group, cut.group, seed=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    runs = all_runs(read_drives(args.table))
    lines = ["| snippets | AUC | 95 % interval |", "|---|---|---|"]
    areas = [(seconds, found) for seconds in LENGTHS if (found := told(runs, seconds)) is not None]
    lines += [f"| {seconds:g} s | {one.auc:.3f} | {one.low:.3f} to {one.high:.3f} |" for seconds, one in areas]
    show("\n".join(lines), args.write, "nothing-faster")


if __name__ == "__main__":
    main()
