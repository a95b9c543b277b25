"""How often does `profiles compare` tell drivers apart who are one, and who are not?

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m laboratory.compare_calibration [dlr.parquet] [--pairs 40] [--halves 8]

Two drives of 50 min of a simulated driver beside two more of his: as they are, 10 % wider, 5 cm further left; halves of
one such drive with an effect of trucks; profiles of random halves of a recording's vehicles.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from examples.driver_simulator import simulate_drive
from laboratory.fair_measure import halves
from laboratory.identification_drives import moved, offset_of
from tests.kit import simulated as plants
from xosc_lateral.drivers.drives.drive import PAPER_RULES, all_runs
from xosc_lateral.drivers.evaluation.sizes import SIGNIFICANCE_LEVEL, Sizes, differences, sizes_of_runs
from xosc_lateral.drivers.fitting.fitting import fit_profile
from xosc_lateral.files.drives import drives_of_table, read_drives

FIRST_SPLIT, FIRST_SEED = 400, 950_000
"""Seeds of the first random halves of the vehicles, and of the first simulated driver."""

DRIVE_S = 3000.0


def parts_of_drive(seed: int, parts: int, seconds: float, effects: Sequence[plants.Effect] = ()) -> list[pd.DataFrame]:
    """One long drive of one driver, in parts."""
    table = simulate_drive(parts * seconds, seed, effects=list(effects)).table
    table = table.drop(columns=["steering_wheel_angle", "yaw_rate"])
    return [part for _, part in table.groupby(np.minimum(table["time"] // seconds, parts - 1))]


def sizes(tables: Sequence[pd.DataFrame], *, wider: float = 1.0, shift: float = 0.0) -> Sizes:
    """What a fit to several drives would hold of them."""
    usual = float(np.mean(np.concatenate([offset_of(table) for table in tables])))
    changed = (moved(table, (wider - 1.0) * (offset_of(table) - usual) + shift) for table in tables)
    drives = [
        drive for number, table in enumerate(changed) for drive in drives_of_table(table.assign(drive=number), {})
    ]
    return sizes_of_runs(all_runs(drives, PAPER_RULES), 0.2)


def report(name: str, pairs: Sequence[tuple[Sizes, Sizes]]) -> None:
    """A line: how many are told apart, and the least difference that would be, in the median."""
    found = [differences(*pair) for pair in pairs]
    apart = sum(min(part.p_value for part in parts) <= SIGNIFICANCE_LEVEL for parts in found)
    least = {part.quantity: [] for part in found[0]}
    for part in (part for parts in found for part in parts):
        least[part.quantity].append(float(np.exp(part.least)) if part.is_factor else part.least)
    words = ", ".join(f"{quantity} {np.median(values):.2f}" for quantity, values in least.items())
    print(f"{name}: told apart in {apart} of {len(pairs)}; least difference {words}", flush=True)


def main() -> None:
    """A line per case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="*")
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--halves", type=int, default=8)
    args = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + args.pairs)
    drivers = [parts_of_drive(seed, 4, DRIVE_S) for seed in seeds]
    for name, change in {
        "the same driver": {},
        "10 % wider": {"wider": 1.1},
        "5 cm further left": {"shift": 0.05},
    }.items():
        report(name, [(sizes(parts[:2]), sizes(parts[2:], **change)) for parts in drivers])
    trucks = [parts_of_drive(seed, 2, DRIVE_S / 2.0, [plants.truck_avoidance(0.25)]) for seed in seeds]
    report("halves of a drive with an effect", [(sizes(parts[:1]), sizes(parts[1:])) for parts in trucks])
    if args.table:
        drives = read_drives(args.table)
        fits = [
            [fit_profile(half, name="half").provenance.fit["sizes"] for half in halves(drives, FIRST_SPLIT + split)]
            for split in range(args.halves)
        ]
        report("halves of the vehicles", [tuple(map(Sizes.from_dict, pair)) for pair in fits])


if __name__ == "__main__":
    main()
