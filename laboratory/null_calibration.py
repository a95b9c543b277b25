"""p-values of every component on drives where nothing acts: how often each is below a level, beside what it should be.

    python -m laboratory.null_calibration [--drives N] [--block S] [--part K/N] [-o OUT.jsonl]
    python -m laboratory.null_calibration --table OUT.jsonl...

Every movement of the protocol's last design set in turn, every other drive of each smoothed; one line per drive goes
to OUT.jsonl as it is finished. A drive takes 2 s. What a table is asked first is asked here: no term is in the model.
"""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from laboratory.identification_cases import PROTOCOL
from laboratory.identification_drives import long_drive, smoothed_tracks
from laboratory.identification_oracle import coarse_of
from laboratory.outcome_lines import append_outcome, read_outcomes
from xosc_lateral.extras.loop import significance
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.identify import usable_columns
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.selection import ERROR_BUDGET, STAGES

FIRST_SEED = 310_000
"""Of drives that serve for nothing else; those from 300,000 on were what the null was mended with."""

LEVELS = (0.001, 0.003, 0.01, 0.05)


def probabilities(movement: str, seed: int, seconds: float, smoothed: bool) -> dict[str, float]:
    """Smallest p-value of each component on one drive."""
    from threadpoolctl import threadpool_limits

    table = long_drive(movement, seconds, seed)
    coarse = coarse_of(smoothed_tracks(table) if smoothed else table)
    found: dict[str, float] = {}
    with threadpool_limits(1, user_api="blas"):
        columns = usable_columns(coarse.timeline).columns
        search = Search.over(coarse, columns, np.random.SeedSequence(1), ERROR_BUDGET)
        fitted = fit_model(coarse, ())
        for kind in {kind.component: kind for stage in STAGES for kind in stage}.values():
            if (test := kind.test(search, fitted)) is not None:
                found[kind.component] = test.p_value
    return found


def main() -> None:
    """Run, or print the table of what was run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", type=int, default=560)
    parser.add_argument(
        "--block", type=int, default=significance.BLOCK_S, help="length of what is dealt anew, in seconds"
    )
    parser.add_argument("--part", default="0/1", help="K/N: every N-th drive from the K-th on")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--table", type=Path, nargs="+")
    args = parser.parse_args()
    if args.table is not None:
        print(table(read_outcomes(args.table)))
        return
    significance.BLOCK_S = args.block
    protocol = tomllib.loads(PROTOCOL.read_text(encoding="utf-8"))
    movements = protocol["movements"]["design_9"]
    part, parts = map(int, args.part.split("/"))
    outcomes = []
    for place in range(part, args.drives, parts):
        movement, smoothed = movements[place % len(movements)], bool(place // len(movements) % 2)
        found = probabilities(movement, FIRST_SEED + place, protocol["drives"]["long_s"], smoothed)
        outcomes.append({"seed": FIRST_SEED + place, "movement": movement, "smoothed": smoothed, "p": found})
        append_outcome(args.output, outcomes[-1])
    print(table(outcomes))


def table(outcomes: list[dict[str, Any]]) -> str:
    """Markdown: share of drives below each level, by component."""
    names = list(dict.fromkeys(name for one in outcomes for name in one["p"]))
    lines = [f"| component | drives | {' | '.join(f'below {level:g}' for level in LEVELS)} | median |"]
    lines.append("|---" * (len(LEVELS) + 3) + "|")
    for name in names:
        p = np.array([one["p"][name] for one in outcomes if name in one["p"]])
        below = " | ".join(f"{(p < level).sum()} ({level * len(p):.1f})" for level in LEVELS)
        lines.append(f"| {name} | {len(p)} | {below} | {np.median(p):.2f} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
