"""Ten minutes of two-lane traffic in SUMO, with drivers and without: what its own FCD output shows beside the profile.

    python -m benchmarks.live_sumo [--seconds 600] [--profile motorway] [--seed 1]

Spread of the offset, power below 0.5 Hz, and time nearer than 0.3 m to a marking, of vehicles that keep their lane;
lane changes, collisions and teleports. `profile` is what `sample` gives under the same context, from the same drives.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

import xosc_lateral as xl
from tests.live.sumo_run import write_run
from xosc_lateral.live.sumo import SumoTraffic, start

STEP, NEAR, WIDTH = 0.2, 0.3, {0.0: 1.8, 1.0: 2.4}


def run(config: Path, profile: str | None, seed: int, seconds: float) -> tuple[Path, int, int, int]:
    """FCD output, lane changes, collisions and teleports of a run."""
    out = config.with_name(f"fcd_{profile}.xml")
    words = ["-c", str(config), "--fcd-output", str(out), "--fcd-output.attributes", "speed,pos,posLat,lane,type"]
    sumo = start([*words, "--precision", "4", "--seed", str(seed)])
    traffic = None if profile is None else SumoTraffic(sumo, xl.read_profile(profile), seed=seed)
    changes = collisions = teleports = 0
    before: dict[str, str] = {}
    while sumo.simulation.getTime() < seconds:
        if traffic is not None:
            traffic.steer()
        sumo.simulationStep()
        collisions += len(sumo.simulation.getCollisions())
        teleports += sumo.simulation.getStartingTeleportNumber()
        now = {name: sumo.vehicle.getLaneID(name) for name in sumo.vehicle.getIDList()}
        changes += sum(before.get(name, lane) != lane and before[name][:-1] == lane[:-1] for name, lane in now.items())
        before = now
    sumo.close()
    return out, changes, collisions, teleports


def kept(table: pd.DataFrame) -> list[pd.DataFrame]:
    """Stretches of 20 s and more in one lane, five seconds away from a change of it, every 0.2 s."""
    found = []
    for _, own in table.groupby("drive"):
        parts = (own.lane_index.diff() != 0).cumsum()
        for _, part in own.groupby(parts):
            part = part[(part.time > part.time.min() + 5.0) & (part.time < part.time.max() - 5.0)].iloc[::2]
            if len(part) * STEP > 20.0:
                found.append(part)
    return found


def measures(parts: list[pd.DataFrame], column: str) -> tuple[float, float, float]:
    """Spread [m], root of the power between 0.05 and 0.5 Hz [m], share of time near a marking [%]."""
    offset = np.concatenate([part[column].to_numpy() for part in parts])
    truck = np.concatenate([part.is_truck.to_numpy() for part in parts])
    lane = np.concatenate([part.lane_width.to_numpy() for part in parts])
    power = []
    for part in parts:
        values = part[column].to_numpy()[:100] - part[column].to_numpy()[:100].mean()
        density = np.abs(np.fft.rfft(values * np.hanning(len(values)))) ** 2
        frequency = np.fft.rfftfreq(len(values), STEP)
        band = (frequency >= 0.05) & (frequency <= 0.5)
        power.append(2.0 * density[band].sum() / len(values) / (np.hanning(len(values)) ** 2).sum())
    room = 0.5 * lane - np.abs(offset) - 0.5 * np.where(truck > 0, WIDTH[1.0], WIDTH[0.0])
    return float(offset.std()), float(np.sqrt(np.mean(power))), float(100.0 * (room < NEAR).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--profile", default="motorway")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        config = write_run(Path(folder), end=given.seconds, cars=1000, trucks=200)
        print("| run | spread [m] | 0.05 to 0.5 Hz [m] | near a marking [%] | lane changes | collisions | teleports |")
        print("|---|---|---|---|---|---|---|")
        for profile in (None, given.profile):
            out, *counts = run(config, profile, given.seed, given.seconds)
            table = xl.import_drives("fcd", out, net=Path(folder) / "run.net.xml").to_frame()
            parts = kept(table)
            words = " | ".join(f"{value:.3f}" for value in measures(parts, "offset"))
            print(f"| {'without' if profile is None else 'with drivers'} | {words} | {' | '.join(map(str, counts))} |")
        numbered = pd.concat([part.assign(drive=f"{k}") for k, part in enumerate(parts)])
        sampled = xl.sample(given.profile, context=numbered, seed=given.seed).to_frame()
        both = numbered.merge(sampled, on=["drive", "time"], suffixes=("", "_sampled"))
        words = " | ".join(
            f"{value:.3f}" for value in measures([p for _, p in both.groupby("drive")], "offset_sampled")
        )
        print(f"| profile | {words} | | | |")


if __name__ == "__main__":
    main()
