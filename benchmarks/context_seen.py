"""What a classifier gains from the context: by which columns, with and without neighbours' effects and zones.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m benchmarks.context_seen dlr.parquet [--seeds 30 31 32 33] [--write PAGE.md]

Free runs of the driver alone beside recorded ones, as in `fair_measure`; mean over several random halvings of the
vehicles, each half in its turn held out, with the standard error over halvings. Some columns say where a vehicle is:
the map's (the road's curvature, and its lanes' width, which tells the carriageway), and speed and acceleration, which
the same cameras saw there. The context is shown with them and without.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.fair_measure import halves
from benchmarks.markers import show
from xosc_lateral.driver.fitting import fit_profile
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.drives.cuts import all_runs
from xosc_lateral.drives.drive import Drive, Run
from xosc_lateral.evaluation.classifier import classifier_two_sample_test, context_features
from xosc_lateral.evaluation.filters import below_half_hertz, thinned
from xosc_lateral.evaluation.snippets import sample_runs, snippets_of
from xosc_lateral.formats.drives import read_drives

FloatArray = NDArray[np.float64]
LENGTHS = (10.0, 30.0, 60.0)
"""Of snippets. [s]"""
CONDITIONS = ((False, True), (True, False), (True, True))
"""Whether neighbours are fitted, and whether zones are known."""
OF_MAP = frozenset({"curvature", "lane_width"})
OF_PLACE = OF_MAP | {"speed", "acceleration"}
EACH = 3
"""Features of a context column. [-]"""


def areas(profile: DriverProfile, runs: Sequence[Run], seed: int, seconds: float) -> list[float]:
    """Without context, with all of it, without the map's columns, without the place's."""
    step = profile.model.step
    cut, paths = snippets_of(runs, seconds, step), sample_runs(profile, runs, seed, same_start=False)
    real = cut.cut_from([below_half_hertz(run.offset, step) for run in runs])
    made = cut.cut_from([below_half_hertz(path, step) for path in paths])
    context = context_features(cut, real), context_features(cut, made)
    names = sorted({name for one in cut.items for name in one.run.context})
    shown, found = (thinned(real, step), thinned(made, step)), []
    for left_out in (None, frozenset[str](), OF_MAP, OF_PLACE):
        seen = None
        if left_out is not None:
            kept = np.repeat([name not in left_out for name in names], EACH)
            seen = [part[:, kept] for part in context]
        result = classifier_two_sample_test(*shown, cut.group, cut.group, context=seen, seed=seed)
        assert result is not None
        found.append(result.auc)
    return found


def without_zones(drives: Sequence[Drive]) -> list[Drive]:
    return [replace(drive, zone=None) for drive in drives]


def table(found: dict[tuple[bool, bool], FloatArray]) -> list[str]:
    """Of areas, shape (halvings, 2, lengths, 4) each, by what was known."""
    lines = [
        "| snippets | neighbours fitted | zones known | alone | with context | without map | without place |",
        "|---|---|---|---|---|---|---|",
    ]
    for number, seconds in enumerate(LENGTHS):
        for (neighbours, zones), several in found.items():
            means = several[:, :, number].mean(axis=1)
            errors = means.std(axis=0, ddof=1) / np.sqrt(len(means))
            cells = " | ".join(f"{a:.3f} ± {b:.3f}" for a, b in zip(means.mean(axis=0), errors, strict=True))
            known = " | ".join("yes" if one else "no" for one in (neighbours, zones))
            lines.append(f"| {seconds:g} s | {known} | {cells} |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--seeds", type=int, nargs="+", default=[30, 31, 32, 33], help="one halving each")
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    drives = read_drives(args.table)
    found: dict[tuple[bool, bool], list[list[list[float]]]] = {known: [] for known in CONDITIONS}
    for known, seed in product(CONDITIONS, args.seeds):
        one, other = halves(drives if known[1] else without_zones(drives), seed)
        for fitted, held_out in ((one, other), (other, one)):
            profile, runs = fit_profile(fitted, name="half", neighbours=known[0]), all_runs(held_out)
            found[known].append([areas(profile, runs, 0, seconds) for seconds in LENGTHS])
            print(seed, known, np.round(found[known][-1], 3).tolist(), file=sys.stderr, flush=True)
    shape = (len(args.seeds), 2, len(LENGTHS), -1)
    show(
        "\n".join(table({known: np.array(several).reshape(shape) for known, several in found.items()})),
        args.write,
        "context-seen",
    )


if __name__ == "__main__":
    main()
