"""How often does `profiles compare` call profiles different that are not? One profile twice, and fits of both halves.

xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
python -m laboratory.compare_calibration dlr.parquet [--twice 10] [--halves 8]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from msgspec.structs import replace

from laboratory.fair_measure import halves
from xosc_lateral.drivers.evaluation.profile_comparison import compare
from xosc_lateral.drivers.fitting.fitting import fit_profile
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.drives import read_drives

FIRST_SPLIT = 400
"""Seed of the first random halves of the vehicles."""


def distance_and_floor(one: DriverProfile, other: DriverProfile, seed: int) -> tuple[float, float]:
    """As `profiles compare` has them, seeds far enough apart. [-]"""
    compared = compare([replace(one, name="one"), replace(other, name="other")], 10 * seed)
    return float(compared.distance[0, 1]), float(compared.floors[0, 1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--twice", type=int, default=10)
    parser.add_argument("--halves", type=int, default=8)
    args = parser.parse_args()
    drives = read_drives(args.table)
    whole = fit_profile(drives, name="all")
    cases = {"one profile, sampled twice": [distance_and_floor(whole, whole, seed) for seed in range(args.twice)]}
    split = [halves(drives, FIRST_SPLIT + seed) for seed in range(args.halves)]
    cases["profiles of both halves of the vehicles"] = [
        distance_and_floor(fit_profile(one, name="one"), fit_profile(other, name="other"), seed)
        for seed, (one, other) in enumerate(split)
    ]
    for name, found in cases.items():
        different = sum(distance > floor for distance, floor in found)
        print(f"{name}: said to differ in {different} of {len(found)}")


if __name__ == "__main__":
    main()
