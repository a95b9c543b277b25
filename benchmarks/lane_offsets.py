"""How exactly the reference player follows what ``--mode lane-offset`` writes, and how sharply that turns the cars.

    python benchmarks/lane_offsets.py SCENARIO... --esmini PATH [--seed N] [--time-limit 22]

For every stretch of road-following: the largest distance to the sides between where the car is in the player and where
it was meant to be, from 2.6 s after the stretch's start; and how much more than without offsets its direction changes
in 0.01 s at most.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from agreement import reference_rows

import xosc_lateral as xl

STEP = 0.01
"""Of the player. [s]"""
SETTLED = 2.6
"""After the start of a stretch. [s]"""


def directions(rows: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Middle times and directions of travel between rows. [s], [rad]"""
    x, y, time = (rows[name].to_numpy() for name in ("x", "y", "time"))
    return 0.5 * (time[1:] + time[:-1]), np.unwrap(np.angle(np.diff(x) + 1j * np.diff(y)))


def measured(meant: pd.DataFrame, played: pd.DataFrame, plain: pd.DataFrame, span: tuple[float, float]) -> list[float]:
    """Largest distance to the sides [m] and largest turn in a step [rad] within a span of time. [s]"""
    time, direction = directions(played)
    inside = (time > span[0]) & (time < span[1])
    if inside.sum() < 3:
        return [np.nan, np.nan]
    at = {axis: np.interp(time, played["time"], played[axis]) for axis in "xy"}
    ahead = {axis: np.interp(time, meant["time"], meant[axis]) - at[axis] for axis in "xy"}
    aside = ahead["y"] * np.cos(direction) - ahead["x"] * np.sin(direction)
    turned = np.abs(np.diff(direction - np.interp(time, *directions(plain))))
    return [float(np.abs(aside[inside]).max()), float(turned[inside[1:]].max())]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", type=Path, nargs="+")
    parser.add_argument("--esmini", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--time-limit", type=float, default=22.0)
    options = parser.parse_args()
    esmini, limit = options.esmini.resolve(), options.time_limit
    print(f"{'scenario':30} {'entity':12} {'stretch [s]':>14} {'aside [cm]':>10} {'turn in 0.01 s [mrad]':>22}")
    for path in options.scenario:
        with tempfile.TemporaryDirectory() as folder:
            output = Path(folder) / path.name
            made = xl.convert(
                path, output, mode="lane-offset", seed=options.seed, time_limit=limit, allow=[path.parent]
            )
            played = reference_rows(esmini, output, STEP, limit)
            plain = reference_rows(esmini, path, STEP, limit)
        meant = made.to_frame()
        for entity in made.to_dict()["entities"]:
            name = entity["name"]
            frames = [frame[frame["name"] == name].drop_duplicates("time") for frame in (meant, played, plain)]
            for start, end in entity["segments"]:
                aside, turn = measured(*frames, (start + SETTLED, end - 0.1))
                stretch = f"{start:.2f}-{end:.2f}"
                print(f"{path.stem[:30]:30} {name[:12]:12} {stretch:>14} {100 * aside:10.1f} {1e3 * turn:22.2f}")


if __name__ == "__main__":
    main()
