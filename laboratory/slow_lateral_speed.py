"""Lateral speed of slow vehicles at a signalled junction, relative to that at 9 to 13 m/s, with bootstrap intervals.

    python -m laboratory.slow_lateral_speed tasi-0.15.4-py3-none-any.whl

DLR Urban Traffic v1.2.0, 15 minutes: cars, vans and trucks. Where a vehicle gets to within 2 s, across the mean way of
at least `LEAST_OTHERS` others at that place (which go within 20 degrees of it, and straight on); what the tracker's
error on standing vehicles adds is taken out. Vehicles are drawn anew, 400 times, for the intervals (95 %). Nothing of
the recording is kept but these figures.
"""

from __future__ import annotations

import argparse
import io
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from msgspec.structs import replace
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from xosc_lateral.base.segment import clock_rate
from xosc_lateral.drivers.evaluation.metrics import free_runs
from xosc_lateral.files.profiles import find_profile, read_profile

FloatArray = NDArray[np.float64]
EDGES = np.array([0.3, 1.0, 2.0, 3.0, 5.0, 7.0, 9.0, 13.0, 17.0])
REFERENCE = 6
WINDOW, NEAR, LEAST_OTHERS, DRAWN = 2.0, 1.5, 6, 400


def tracks(wheel: Path) -> pd.DataFrame:
    """Rows of motor vehicles, twice a second."""
    archive = zipfile.ZipFile(wheel)
    (inner,) = (name for name in archive.namelist() if "DLR-Urban-Traffic" in name and name.endswith(".zip"))
    data = zipfile.ZipFile(io.BytesIO(archive.read(inner)))
    (name,) = (one for one in data.namelist() if "trajectories_" in one and one.endswith(".csv"))
    rows = pd.read_csv(data.open(name))
    motor = rows[[f"classifications_{kind}" for kind in ("car", "van", "truck")]].sum(axis=1) > 0.5
    rows = rows[motor & ~rows["interpolated"]]
    stamps = pd.to_datetime(rows["timestamp"], format="ISO8601")
    return rows.assign(time=(stamps - stamps.min()).dt.total_seconds())


def chords(rows: pd.DataFrame) -> FloatArray:
    """Vehicle, middle x and y, way ahead x and y within 2 s, mean speed; shape (n, 6)."""
    found = []
    for number, (_, one) in enumerate(rows.groupby("id")):
        time, x, y = (one[name].to_numpy() for name in ("time", "center_easting", "center_northing"))
        time, first = np.unique(time, return_index=True)
        x, y = x[first], y[first]
        if len(time) < 50 or np.diff(time).max() > 1.0:
            continue
        at = np.arange(time[0], time[-1] - WINDOW, 0.5)
        ends = [(np.interp(at, time, v), np.interp(at + WINDOW, time, v)) for v in (x, y)]
        (x0, x1), (y0, y1) = ends
        speed = np.hypot(x1 - x0, y1 - y0) / WINDOW
        found.append(
            np.column_stack([np.full(len(at), number), 0.5 * (x0 + x1), 0.5 * (y0 + y1), x1 - x0, y1 - y0, speed])
        )
    return np.concatenate(found)


def across(table: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Vehicle, speed and lateral speed [m/s] of those chords that enough others went along, in a straight lane."""
    moving = table[table[:, 5] > 2.0]
    tree, direction = cKDTree(moving[:, 1:3]), np.arctan2(moving[:, 4], moving[:, 3])
    who, speeds, lateral = [], [], []
    for row in table:
        near = np.array(tree.query_ball_point(row[1:3], NEAR), dtype=np.int64)
        near = near[moving[near, 0] != row[0]]
        if not len(near):
            continue
        angle = np.arctan2(row[4], row[3])
        if row[5] < 0.3:  # standing: along whichever stream is there
            angle = direction[near[0]]
        apart = (direction[near] - angle + np.pi) % (2.0 * np.pi) - np.pi
        near, apart = near[np.abs(apart) < np.deg2rad(20.0)], apart[np.abs(apart) < np.deg2rad(20.0)]
        vehicles = np.unique(moving[near, 0])
        if len(vehicles) < LEAST_OTHERS or apart.std() > np.deg2rad(2.5):
            continue
        mean = angle + np.mean([apart[moving[near, 0] == vehicle].mean() for vehicle in vehicles])
        who.append(row[0])
        speeds.append(row[5])
        lateral.append((row[4] * np.cos(mean) - row[3] * np.sin(mean)) / WINDOW)
    return np.array(who), np.array(speeds), np.array(lateral)


def figures(speed: FloatArray, lateral: FloatArray, weight: FloatArray) -> FloatArray:
    """Relative lateral speed of each class of speeds, and the power of speed that fits best."""
    stands = speed < 0.1
    noise = float(np.average(lateral[stands] ** 2, weights=weight[stands]))
    place = np.searchsorted(EDGES, speed) - 1
    square = np.array(
        [np.average(lateral[place == k] ** 2, weights=weight[place == k]) - noise for k in range(len(EDGES) - 1)]
    )
    relative = np.sqrt(np.maximum(square, 1e-9) / square[REFERENCE])
    middle = np.log(np.sqrt(EDGES[1:] * EDGES[:-1]))
    rows = np.array([np.sum(weight[place == k]) for k in range(len(EDGES) - 1)])
    return np.append(relative, np.polyfit(middle, np.log(relative), 1, w=np.sqrt(rows))[0])


@cache
def sampled(lag: float) -> float:
    """How far drivers of `motorway` move sideways within a time [s] of their own clock, root mean square. [m]"""
    profile = replace(read_profile(find_profile("motorway")), effects=())
    runs = free_runs(profile, 1, drivers=40, duration=600.0)
    course = CubicSpline(profile.model.step * np.arange(runs.shape[1]), runs, axis=1)
    at = np.arange(5.0, 590.0, 0.5)
    return float(np.sqrt(((course(at + lag) - course(at)) ** 2).mean()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path)
    who, speed, lateral = across(chords(tracks(parser.parse_args().wheel)))
    rng, names = np.random.default_rng(1), np.unique(who)
    index = np.searchsorted(names, who)
    whole = figures(speed, lateral, np.ones(len(who)))
    drawn = [
        figures(speed, lateral, rng.multinomial(len(names), np.full(len(names), 1.0 / len(names)))[index] + 1e-9)
        for _ in range(DRAWN)
    ]
    low, high = np.quantile(drawn, [0.025, 0.975], axis=0)
    print(f"{len(names)} vehicles, {len(who)} stretches of 2 s")
    for k in range(len(EDGES) - 1):
        pace = 0.5 * (EDGES[k] + EDGES[k + 1])
        rate = float(clock_rate(np.array([pace]))[0])
        measured = f"{whole[k]:.2f} ({low[k]:.2f} to {high[k]:.2f})"
        made = sampled(WINDOW * rate) / sampled(WINDOW)
        print(f"{EDGES[k]:g} to {EDGES[k + 1]:g} m/s: {measured}, sampled {made:.2f} (clock {rate:.2f})")
    print(f"power of speed: {whole[-1]:.2f} ({low[-1]:.2f} to {high[-1]:.2f})")


if __name__ == "__main__":
    main()
