"""Is a profile of one vehicle told from another's? All pairs of vehicles with long drives.

    python -m laboratory.driver_discrimination dlr.parquet [--seconds 140] [--model best] [--write PAGE.md]

Each vehicle's profile is fitted to the first 60 % of its drive. Snippets sampled from it freely (no start given) are
compared with the held-out last 40 % of its own drive and of every other vehicle's.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from laboratory.comparison import driver_distances
from laboratory.library import sliding_snippets, split_in_time
from laboratory.markers import show
from xosc_lateral.drivers.drives.drive import STEP, Run, all_runs
from xosc_lateral.drivers.fitting.fitting import fit_runs
from xosc_lateral.files.drives import read_drives


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path)
    parser.add_argument("--seconds", type=float, default=140.0)
    parser.add_argument("--model", default="best")
    parser.add_argument("--write", type=Path, help="document with the markers")
    args = parser.parse_args()
    by_vehicle: dict[str, list[Run]] = {}
    for run in all_runs(read_drives(args.table)):
        by_vehicle.setdefault(run.drive, []).append(run)
    parts = {
        name: split_in_time(runs) for name, runs in by_vehicle.items() if sum(map(len, runs)) * STEP >= args.seconds
    }
    parts = {name: part for name, part in parts.items() if max(map(len, part[1])) * STEP > 10.0}
    profiles = [fit_runs(early, name=name, model=args.model) for name, (early, _) in parts.items()]
    distance = driver_distances(profiles, [sliding_snippets(late) for _, late in parts.values()])
    own = np.diag(distance)[:, None]
    others = ~np.eye(len(own), dtype=bool)
    right = (own < distance)[others].mean()
    first = (distance.argmin(axis=1) == np.arange(len(own))).mean()
    text = (
        f"{len(own)} vehicles with at least {args.seconds:g} s, model `{args.model}`: the profile is nearer to its own "
        f"driver's held-out part than to another's in {100 * right:.0f} % of {others.sum()} ordered pairs; its own "
        f"driver is the nearest of all {len(own)} for {100 * first:.0f} % (chance: {100 / len(own):.0f} %)."
    )
    show(text, args.write, "told-apart")


if __name__ == "__main__":
    main()
