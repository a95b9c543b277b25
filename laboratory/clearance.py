"""Extra clearance beside neighbours: how much further away a driver keeps while one is near, in tables and in profiles.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m laboratory.clearance dlr.parquet [--profile NAME...] [--runs 10]

Of every vehicle the mean offset while the next vehicle in the neighbouring lane is within a band of distance, less its
mean in the same lane while there is none within 100 m; so neither the lane nor the place that a driver keeps plays a
part. Vehicles count by
their seconds in the band; intervals are of 1,000 resamples of the vehicles. Profiles run freely under the same context;
they were fitted to the same vehicles.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.extras.loop.residual import simulated_runs
from xosc_lateral.extras.loop.timeline import Timeline, join_drives
from xosc_lateral.files.drives import read_drives
from xosc_lateral.files.profiles import read_profile

FloatArray = NDArray[np.float64]

BANDS = ((-1.0, 0.01), (0.01, 20.0), (20.0, 50.0), (50.0, 100.0), (100.0, 150.0))
"""Distances along the road, bumper to bumper; 0 alongside. [m]"""

FAR = 100.0
"""Beyond it, or without any, a neighbour is not near. [m]"""

LEAST_S = 3.0
"""A vehicle counts with so much driving in the band and out of reach. [s]"""

RESAMPLES = 1000

AWAY = {"right": 1.0, "left": -1.0}
"""Sign of an offset away from a neighbour on that side."""


@dataclass(frozen=True, slots=True)
class Clearance:
    """A mean and its 95 % interval over vehicles [m], and how many they are."""

    mean: float
    low: float
    high: float
    count: int

    def __str__(self) -> str:
        return f"{self.mean:+.3f} ({self.low:+.3f} to {self.high:+.3f})"


def main() -> None:
    """Print a table per side."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path)
    parser.add_argument("--profile", nargs="+", default=["motorway"])
    parser.add_argument("--runs", type=int, default=10)
    args = parser.parse_args()
    timeline = join_drives(list(read_drives(args.table)))
    offsets = {"recorded": timeline.offset[None]}
    for name in args.profile:
        offsets[name] = simulated_runs(read_profile(name), timeline, np.random.SeedSequence(1), runs=args.runs)
    for side in AWAY:
        print(f"\nneighbour on the {side}, extra clearance in m (95 %)\n")
        print(f"| distance | vehicles | {' | '.join(offsets)} |\n|{'---|' * (len(offsets) + 2)}")
        for band in BANDS:
            found = [within_vehicles(timeline, runs, side, band) for runs in offsets.values()]
            told = " | ".join("" if one is None else str(one) for one in found)
            print(f"| {band_name(band)} | {0 if found[0] is None else found[0].count} | {told} |")


def band_name(band: tuple[float, float]) -> str:
    """For a table's first column."""
    return "alongside" if band[0] < 0 else f"{band[0]:.0f}-{band[1]:.0f} m"


def within_vehicles(timeline: Timeline, runs: FloatArray, side: str, band: tuple[float, float]) -> Clearance | None:
    """Of the same vehicle, near less far; `runs` of shape (runs, rows) [m]. None: no vehicle is long enough in both."""
    near, far = _rows(timeline, side, band)
    seconds = [np.bincount(timeline.drive, rows * timeline.step) for rows in (near, far)]
    used = (seconds[0] >= LEAST_S) & (seconds[1] >= LEAST_S)
    if not used.any():
        return None
    own = np.mean(
        [
            np.bincount(timeline.drive, near * run)[used] / seconds[0][used]
            - np.bincount(timeline.drive, far * run)[used] / seconds[1][used]
            for run in runs
        ],
        axis=0,
    )
    return resampled(own * (AWAY[side] * timeline.step), seconds[0][used])


def resampled(values: FloatArray, weight: FloatArray) -> Clearance:
    """Weighted mean of independent values, shape (n,) [m], and its interval."""
    picks = np.random.default_rng(1).integers(0, len(values), size=(RESAMPLES, len(values)))
    means = (values[picks] * weight[picks]).sum(axis=1) / weight[picks].sum(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return Clearance(float(np.average(values, weights=weight)), float(low), float(high), len(values))


def _rows(timeline: Timeline, side: str, band: tuple[float, float]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """With a neighbour in the band; with none within reach, though there is a lane for one."""
    context = timeline.context
    index, distance = np.round(context["lane_index"]), context[f"{side}_distance"]
    lane = timeline.valid & (index > 0 if side == "right" else index < context["lane_count"] - 1)
    return lane & (distance > band[0]) & (distance <= band[1]), lane & ~(distance <= max(FAR, band[1]))


if __name__ == "__main__":
    main()
