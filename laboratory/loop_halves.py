"""Halves of the vehicles of a table: what the loop finds on each, and what that tells of the other half.

xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
python -m laboratory.loop_halves dlr.parquet [--seed 1]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.stats import t

from xosc_lateral.extras.loop.identify import held_out_gain, identify
from xosc_lateral.extras.loop.model import Term, fit_model
from xosc_lateral.extras.loop.timeline import Coarse, join_drives
from xosc_lateral.files.drives import read_drives


def main() -> None:
    """Deal the vehicles at random, identify on each half, judge on the other."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    drives = {drive.name: drive for drive in read_drives(args.table)}
    everything = Coarse.of(join_drives(list(drives.values())))
    names = everything.timeline.names
    order = np.random.default_rng(args.seed).permutation(len(names))
    halves = [np.sort(order[: len(order) // 2]), np.sort(order[len(order) // 2 :])]
    for number, (own, other) in enumerate((halves, halves[::-1]), 1):
        found = identify(
            Coarse.of(join_drives([drives[names[index]] for index in own])), np.random.SeedSequence(args.seed)
        )
        print(f"half {number}, {len(own)} vehicles:")
        for one in found.selection.accepted:
            shape = getattr(getattr(one.term, "effect", None), "shape", "")
            print(f"  {one.term.component} by {' and '.join(one.term.columns) or '-'} {shape}, p = {one.p_value:.1e}")
        for component in ("mean", "spread"):
            terms = [one.term for one in found.selection.accepted if one.term.component == component]
            if terms:
                print(f"  {component}, on the other half: {judged(everything, terms, own, other)}")


def judged(coarse: Coarse, terms: Sequence[Term], own: np.ndarray, other: np.ndarray) -> str:
    """Gain in log-likelihood a vehicle, sized on one half, seen on the other; one-sided t test over vehicles."""
    here = np.isin(coarse.drive, own)
    part = coarse.only(here)
    gain = held_out_gain(fit_model(part, terms), fit_model(part, ()), coarse, ~here)
    sums = np.bincount(coarse.drive, gain, minlength=coarse.drives)[other]
    score = sums.mean() / (sums.std(ddof=1) / np.sqrt(len(sums)))
    return f"{sums.mean():+.2f} nat a vehicle, p = {t.sf(score, len(sums) - 1):.1e}"


if __name__ == "__main__":
    main()
