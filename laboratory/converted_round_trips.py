"""Do drivers come back through the whole chain? A profile is converted with, played, imported as tracks, fitted again.

    python -m laboratory.converted_round_trips [--esmini PATH] [--seeds 3] [--only NAME ...]

Cars 300 m apart on one straight lane, each with a driver of its own, at 24 m/s. With PATH, esmini's executable plays
the output and its log is what is imported, else our own player. Noise is added to x and y of the tracks, ten rows a
second; with cuts, two seconds are gone after every forty. The fitted profile is sampled freely at the same speed. All
are ratios to what was written; see `laboratory.round_trips`, whose planted drivers these are.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from msgspec.structs import replace
from numpy.typing import NDArray

import xosc_lateral as xl
from laboratory.agreement import own_rows, reference_rows
from laboratory.round_trips import BANDS, SETS, planted, powers, wander
from laboratory.storyboard import Actor, Plot, Vehicle
from xosc_lateral.drivers.drives.drive import STEP
from xosc_lateral.drivers.evaluation.metrics import free_runs
from xosc_lateral.files.profiles import find_profile, read_profile
from xosc_lateral.files.templates.template import Motorway, Straight
from xosc_lateral.workflows.conversion.load import play_scenario

FloatArray = NDArray[np.float64]
SPEED, APART, ROW = 24.0, 300.0, 0.1
"""[m/s], [m], [s]"""
EVERY, GAP = 40.0, 2.0
"""Of the cuts. [s]"""
DRIVERS = 300
"""Sampled from what was fitted."""
TRIPS = (
    ("rural", 9, 600.0, 0.0, False),
    ("rural", 4, 600.0, 0.05, False),
    ("rural", 9, 600.0, 0.05, True),
    ("rural", 40, 200.0, 0.05, True),
    ("motorway", 9, 600.0, 0.0, False),
    ("motorway", 4, 600.0, 0.05, True),
    ("motorway", 40, 200.0, 0.05, True),
    ("one vehicle", 4, 600.0, 0.0, True),
    ("drivers far apart", 9, 600.0, 0.05, True),
    ("drivers alike", 9, 600.0, 0.05, True),
    ("wide", 20, 300.0, 0.05, True),
    ("calm", 20, 300.0, 0.05, True),
    ("lively above 0.4 Hz", 9, 600.0, 0.0, True),
    ("volatile", 20, 300.0, 0.05, True),
)
"""Drivers of `round_trips.SETS`, their number, seconds of each, noise [m], cuts."""


def plot(folder: Path, cars: int, seconds: float, width: float) -> Path:
    """The maneuver-based scenario beside its road."""
    length = 500.0 + APART * cars + SPEED * seconds
    road = Motorway(alignment=(Straight(length),), lanes=1, lane_width=width, left_hand=False)
    actors = tuple(Actor(f"Car{k}", Vehicle.CAR, 0, 50.0 + APART * k, SPEED) for k in range(cars))
    (folder / "plain.xodr").write_text(road.to_xml("plain"))
    path = folder / "plain.xosc"
    path.write_text(Plot("Cars far apart", road, actors, (), duration=seconds).to_xml("plain.xodr"))
    return path


def tracks(output: Path, esmini: Path | None, seconds: float) -> pd.DataFrame:
    """Rows of the output as it is played, `ROW` apart."""
    rows = own_rows(play_scenario(output)) if esmini is None else reference_rows(esmini, output, ROW, seconds)
    rows = rows.assign(row=np.rint(rows["time"] / (0.5 * ROW)).astype(int)).drop_duplicates(["name", "row"])
    return rows[rows["row"] % 2 == 0].rename(columns={"name": "vehicle", "h": "heading"}).drop(columns="row")


def there_and_back(
    title: str, cars: int, seconds: float, noise: float, is_cut: bool, seed: int, esmini: Path | None
) -> list[float]:
    """Ratios of wander, deviation within a drive, between drives and in bands; the mean's change. [-], [m]"""
    (name, factors), _ = SETS[title]
    profile = replace(read_profile(find_profile(name)), name="planted", model=planted(name, factors)[0])
    with tempfile.TemporaryDirectory() as where:
        folder = Path(where)
        made = xl.convert(
            plot(folder, cars, seconds, profile.lane_width),
            output=folder / "moved.xosc",
            profile=profile,
            seed=seed,
            ego=["none"],
            mode="trajectory",
            neighbours="none",
        )
        rows = tracks(folder / "moved.xosc", esmini, seconds)
        if is_cut:
            rows = rows[rows["time"] % (EVERY + GAP) < EVERY]
        rng = np.random.default_rng([64, seed])
        rows = rows.assign(**{axis: rows[axis] + rng.normal(0.0, noise, len(rows)) for axis in "xy"})
        rows[["time", "vehicle", "x", "y"]].to_csv(folder / "tracks.csv", index=False)
        drives = xl.import_drives("tracks", folder / "tracks.csv", road=folder / "plain.xodr").table
        again = xl.fit(drives, name="again")
    at = np.arange(0.0, seconds - 1.0, STEP)
    written = np.array([np.interp(at, one.motion.time, one.deviation) for one in made.movement.entities])
    back = free_runs(again, 10_000 + seed, drivers=DRIVERS, duration=float(at[-1]), speed=SPEED)
    return [
        wander(back, seconds) / wander(written, seconds),
        float(np.sqrt(back.var(axis=1).mean() / written.var(axis=1).mean())),
        float(back.mean(axis=1).std() / written.mean(axis=1).std(ddof=1)),
        *np.sqrt(powers(back[:, : written.shape[1]]) / powers(written)),
        float(back.mean() - written.mean()),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--esmini", type=Path, help="executable of the reference player")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only", nargs="+", help="drivers of these names")
    args = parser.parse_args()
    bands = " | ".join(f"{low:g} to {high:g} Hz" for low, high in BANDS)
    print(f"| drives of | set | wander | least, largest | within | between | {bands} |\n{'|---' * 10}|")
    for title, cars, seconds, noise, is_cut in TRIPS:
        if args.only and title not in args.only:
            continue
        found = np.array(
            [there_and_back(title, cars, seconds, noise, is_cut, k, args.esmini) for k in range(1, args.seeds + 1)]
        )
        middle = np.median(found, axis=0)
        said = f"{cars} of {seconds:g} s" + (f", {100.0 * noise:g} cm noise" if noise else "") + ", cuts" * is_cut
        numbers = " | ".join(f"{value:.2f}" for value in middle[1:-1])
        least, largest = found[:, 0].min(), found[:, 0].max()
        print(f"| {title} | {said} | {middle[0]:.2f} | {least:.2f}, {largest:.2f} | {numbers} |", flush=True)


if __name__ == "__main__":
    main()
