"""Does the loop name a lane-keeping assist as the cause? Made drives in OpenLKA's layout, with known truth.

    python -m benchmarks.assist [--drives 4] [--seconds 1800] [--write PAGE.md]

Three kinds: an assist with a place of its own that is tighter than the driver, one that is only tighter, and a flag
that does nothing. Beside it the spread of either's own profile within runs, sampled over measured.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.markers import write_between_markers
from benchmarks.simulated.assist import FLAG, OPENLKA_MAP, LaneKeepingAssist, openlka_layout
from examples.driver_simulator.simulator import simulate_drive
from xosc_lateral.driver.fitting import fit_profile
from xosc_lateral.drives.cuts import all_runs
from xosc_lateral.evaluation.snippets import sample_runs
from xosc_lateral.formats.drives import drives_of_table
from xosc_lateral.formats.mapping import parse_map
from xosc_lateral.identification.close import close_loop

KINDS = {
    "0.2 m further left, 0.4 of the error": LaneKeepingAssist(0.2, 0.4),
    "0.4 of the error": LaneKeepingAssist(0.0, 0.4),
    "nothing": LaneKeepingAssist(0.0, 1.0),
}


def found_by_the_loop(table: pd.DataFrame) -> tuple[str, bool, bool]:
    """In words; whether the flag is among it; whether anything else is."""
    result = close_loop(drives_of_table(table, parse_map(OPENLKA_MAP)), seed=1)
    words = [f"{one.effect} ({one.size_m:.2f})" for one in result.findings]
    named = [one.columns == (FLAG,) for one in result.findings]
    return "; ".join(words) or "nothing", any(named), not all(named)


def spread_of_profiles(table: pd.DataFrame, seed: int) -> list[float]:
    """Sampled over measured standard deviation within runs, of human and assist."""
    ratios = []
    for on in (False, True):
        drives = drives_of_table(table[table[FLAG] == on], parse_map(OPENLKA_MAP))
        runs = all_runs(drives)
        free = sample_runs(fit_profile(drives, name="part"), runs, seed, same_start=False)
        within = [np.concatenate([one - one.mean() for one in some]).std() for some in (free, [r.offset for r in runs])]
        ratios.append(float(within[0] / within[1]))
    return ratios


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", type=int, default=4, help="of each kind; seeds from 1 on")
    parser.add_argument("--seconds", type=float, default=1800.0)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    lines = [
        "| the assist does | seed | the loop finds | profile of the human, of the assist: spread over measured |",
        "|---|---|---|---|",
    ]
    counts = {kind: [0, 0] for kind in KINDS}
    for kind, plant in KINDS.items():
        for seed in range(1, args.drives + 1):
            table = openlka_layout(simulate_drive(args.seconds, seed, effects=[plant]).table)
            words, named, other = found_by_the_loop(table)
            counts[kind][0] += named
            counts[kind][1] += other
            ratios = " / ".join(f"{one:.2f}" for one in spread_of_profiles(table, seed))
            lines.append(f"| {kind} | {seed} | {words} | {ratios} |")
            print(lines[-1], flush=True)
    summary = "; ".join(f"{kind}: {named} of {args.drives}" for kind, (named, _) in counts.items())
    others = sum(other for _, other in counts.values())
    lines += [
        "",
        f"The assist is named ({summary}); something else beside or instead on {others} of {len(KINDS) * args.drives}.",
    ]
    print(lines[-1])
    if args.write is not None:
        write_between_markers(args.write, "\n".join(lines), "assist")


if __name__ == "__main__":
    main()
