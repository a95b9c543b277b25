"""Sensitivity of the memory that whitening takes out of squared innovations: p-values of effects on the spread.

    python -m benchmarks.memory_of_squares [--set design_6]

Drives of the protocol (docs/validation/identification.toml) with an effect on the spread, and long ones without any;
the significance is that of the whole dictionary, before any refinement. Markdown, for docs/design/identification.md.
"""

from __future__ import annotations

import argparse
import tomllib
from typing import Any

import numpy as np

from benchmarks.identification_cases import PROTOCOL, SETS, cases, planted_drive
from xosc_lateral.formats.drives import drives_of_table
from xosc_lateral.identification import problem
from xosc_lateral.identification.column_search import best_probability
from xosc_lateral.identification.identify import usable_columns
from xosc_lateral.identification.innovations import LONGEST
from xosc_lateral.identification.regression import Coarse, fit_model
from xosc_lateral.identification.search import Search
from xosc_lateral.identification.selection import ERROR_BUDGET
from xosc_lateral.identification.terms.spread import SpreadTerm
from xosc_lateral.identification.timeline import join_drives

MEMORIES_S = (LONGEST, 24, 12, 6, 3)


def main() -> None:
    """Print one line per memory."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--set", default="design_6", choices=SETS)
    args = parser.parse_args()
    protocol = tomllib.loads(PROTOCOL.read_text(encoding="utf-8"))
    every = list(cases(protocol, args.set, 1.0))
    spread = np.array([p_values(case, protocol) for case in every if "factor" in case])
    bare = np.array([p_values(case, protocol) for case in every if case["type"] == "null"])
    print(f"| memory [s] | typical p of {len(spread)} effects | below 0.0034 | p on {len(bare)} nulls: least, median |")
    print("|---|---|---|---|")
    for memory, own, null in zip(MEMORIES_S, spread.T, bare.T, strict=True):
        typical = float(np.exp(np.log(np.maximum(own, 1e-12)).mean()))
        print(f"| {memory} | {typical:.1e} | {(own < 0.0034).sum()} | {null.min():.1e}, {np.median(null):.2f} |")


def p_values(case: dict[str, Any], protocol: dict[str, Any]) -> list[float]:
    """Family-wise p-value of the best candidate for the spread, per memory."""
    table = planted_drive(case, protocol, protocol["drives"]["long_s"])[1]
    coarse = Coarse.of(join_drives(drives_of_table(table, {})))
    search = Search.over(coarse, usable_columns(coarse.timeline).columns, np.random.SeedSequence(1), ERROR_BUDGET)
    found, usual = [], problem.SQUARES_S
    for memory in MEMORIES_S:
        problem.SQUARES_S = memory
        found.append(best_probability(search, SpreadTerm, fit_model(coarse, ())))
    problem.SQUARES_S = usual
    return found


if __name__ == "__main__":
    main()
