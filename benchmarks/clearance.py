"""Extra clearance beside neighbours: how much further away a driver keeps while one is near, in tables and in profiles.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m benchmarks.clearance dlr.parquet [--profile motorway motorway-refined] [--runs 10]

Of every vehicle the mean offset while the next vehicle in the neighbouring lane is within a band of distance, less its
mean while there is none within 100 m; so a lane, or the place that a driver keeps, plays no part. Vehicles count by
their seconds in the band; intervals are of 1,000 resamples of the vehicles. Profiles run freely under the same context;
they were fitted to the same vehicles.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from xosc_lateral.formats.drives import read_drives
from xosc_lateral.formats.profiles import read_profile
from xosc_lateral.identification.residual import simulated_runs
from xosc_lateral.identification.timeline import Timeline, join_drives

BANDS = ((-1.0, 0.01), (0.01, 20.0), (20.0, 50.0), (50.0, 100.0), (100.0, 150.0))
"""Distances along the road, bumper to bumper; 0 alongside. [m]"""

FAR = 100.0
"""Beyond it, or without any, a neighbour is not near. [m]"""

LEAST_S = 3.0
"""A vehicle counts with so much driving in the band and out of reach. [s]"""

RESAMPLES = 1000


def main() -> None:
    """Print a table per side."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path)
    parser.add_argument("--profile", nargs="+", default=["motorway", "motorway-refined"])
    parser.add_argument("--runs", type=int, default=10)
    args = parser.parse_args()
    timeline = join_drives(list(read_drives(args.table)))
    offsets = {"recorded": timeline.offset[None]}
    for name in args.profile:
        offsets[name] = simulated_runs(read_profile(name), timeline, np.random.SeedSequence(1), runs=args.runs)
    for side, sign in (("right", 1.0), ("left", -1.0)):
        print(f"\nneighbour on the {side}, extra clearance in m (95 %)\n")
        print(f"| distance | vehicles | {' | '.join(offsets)} |\n|{'---|' * (len(offsets) + 2)}")
        for band in BANDS:
            rows = dict(_clearances(timeline, offsets, side, sign, band))
            count = next(iter(rows.values()))[1]
            told = " | ".join(one for one, _ in rows.values())
            low, high = max(band[0], 0.0), band[1]
            print(f"| {'alongside' if band[0] < 0 else f'{low:.0f}-{high:.0f} m'} | {count} | {told} |")


def _clearances(
    timeline: Timeline, offsets: dict[str, np.ndarray], side: str, sign: float, band: tuple[float, float]
) -> Iterator[tuple[str, tuple[str, int]]]:
    distance = timeline.context[f"{side}_distance"]
    near = timeline.valid & (distance > band[0]) & (distance <= band[1])
    far = timeline.valid & ~(distance <= max(FAR, band[1]))
    seconds = [np.bincount(timeline.drive, rows * timeline.step) for rows in (near, far)]
    used = (seconds[0] >= LEAST_S) & (seconds[1] >= LEAST_S)
    rng = np.random.default_rng(1)
    weight = seconds[0][used]
    for name, runs in offsets.items():
        own = np.mean(
            [
                np.bincount(timeline.drive, near * run)[used] / weight
                - np.bincount(timeline.drive, far * run)[used] / seconds[1][used]
                for run in runs
            ],
            axis=0,
        ) * (sign * timeline.step)
        if not used.any():
            yield name, ("", 0)
            continue
        picks = rng.integers(0, len(own), size=(RESAMPLES, len(own)))
        means = (own[picks] * weight[picks]).sum(axis=1) / weight[picks].sum(axis=1)
        low, high = np.quantile(means, [0.025, 0.975])
        yield name, (f"{np.average(own, weights=weight):+.3f} ({low:+.3f} to {high:+.3f})", int(used.sum()))


if __name__ == "__main__":
    main()
