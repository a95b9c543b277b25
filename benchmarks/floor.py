"""Sensitivity of the floor under the noise of a drive: sizes and significance on tables as they are and smoothed ones.

    python -m benchmarks.floor [--share 0.5] [--set design_3]

Effects of the protocol (docs/validation/identification.toml) at 0.6 times their sizes, told to the regression; the
significance is that of the whole dictionary, before any refinement. Markdown, for docs/design/identification.md.
"""

from __future__ import annotations

import argparse
import tomllib
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.identification_cases import PROTOCOL, SETS, bare_drive, cases
from benchmarks.identification_drives import smoothed_tracks, with_mean
from benchmarks.identification_oracle import told_regression
from xosc_lateral.formats.drives import drives_of_table
from xosc_lateral.identification import regression
from xosc_lateral.identification.column_search import best_probability
from xosc_lateral.identification.identify import usable_columns
from xosc_lateral.identification.regression import Coarse, fit_model
from xosc_lateral.identification.search import Search
from xosc_lateral.identification.selection import ERROR_BUDGET
from xosc_lateral.identification.terms.mean import MeanTerm
from xosc_lateral.identification.timeline import join_drives
from xosc_lateral.normal import NORMAL_95

FLOORS = (0.0, 0.005, 0.01, 0.02, 0.03, 0.04)
SMALLER = 0.6


def main() -> None:
    """Print one line per floor and kind of table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--set", default="design_3", choices=SETS)
    parser.add_argument("--share", type=float, default=1.0)
    args = parser.parse_args()
    protocol = tomllib.loads(PROTOCOL.read_text(encoding="utf-8"))
    wanted = [case for case in cases(protocol, args.set, args.share) if "size" in case]
    rows = [row for case in wanted if not case["name"].startswith("slow vehicles") for row in measured(case, protocol)]
    print("| tables | floor [m] | effects | named | size found, share | z | 95 % intervals that hold the size |")
    print("|---|---|---|---|---|---|---|")
    for (kind, smooth, floor), own in pd.DataFrame(rows).groupby(["kind", "smoothed", "floor"]):
        print(
            f"| {kind}{', smoothed' if smooth else ''} | {floor} | {len(own)} | {own['named'].sum()} | "
            f"{own['share'].median():.2f} | {own['z'].median():.1f} | {100.0 * own['held'].mean():.0f} % |"
        )


def measured(case: dict[str, Any], protocol: dict[str, Any]) -> list[dict[str, Any]]:
    """One effect under every floor, on the table as it is and smoothed."""
    case = {**case, "size": SMALLER * case["size"]}
    seed, short = case["seed"], case["type"].endswith("short")
    bare = bare_drive(case, protocol, protocol["drives"]["long_s"])
    planted = with_mean(bare, case["name"], case["size"], seed)
    rows, usual = [], regression.FLOOR
    for smooth in (False, True):
        table = smoothed_tracks(planted) if smooth else planted
        coarse = Coarse.of(join_drives(drives_of_table(table, {})))
        search = Search.over(coarse, usable_columns(coarse.timeline).columns, np.random.SeedSequence(1), ERROR_BUDGET)
        for floor in FLOORS:
            regression.FLOOR = floor
            p_value = best_probability(search, MeanTerm, fit_model(coarse, ()))
            told = told_regression(case, bare, coarse, seed)
            size, error = told["size"], told["error"]
            rows.append(
                {
                    "kind": "many short drives" if short else "one long drive",
                    "smoothed": smooth,
                    "floor": floor,
                    "named": p_value <= search.level_of(MeanTerm.component),
                    "share": size / case["size"],
                    "z": size / error,
                    "held": abs(size - case["size"]) <= NORMAL_95 * error,
                }
            )
        regression.FLOOR = usual
    return rows


if __name__ == "__main__":
    main()
