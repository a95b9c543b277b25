"""Ten minutes of two-lane traffic in SUMO, with drivers and without: what its own FCD output shows beside the profile.

    python -m laboratory.live_sumo [--seconds 600] [--profile motorway] [--seeds 5] [--sublane 4.0]

Spread of the offset, power between 0.05 and 0.5 Hz, and time nearer than 0.3 m to a marking, of vehicles that keep
their lane; lane changes, collisions and teleports, by SUMO's seed. `driver's answer`: where the same drivers wanted to
be at the same moments, giving way included. `sample`: what the profile gives under the context of the FCD output;
nobody gives way there. `aligned`: SUMO alone, its vehicles at constant places up to 0.45 m from the middle by its own
alignment, which shows how many lane changes are the sublane model's own answer to vehicles off the middle.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

import xosc_lateral as xl
from tests.kit.sumo_run import write_run
from xosc_lateral.extras.live.sumo import SumoTraffic, start

STEP, NEAR, WIDTH = 0.2, 0.3, {0.0: 1.8, 1.0: 2.4}
ALIGNED = 0.45
"""Largest distance from the middle in `aligned`. [m]"""


class Run(NamedTuple):
    """FCD output, what drivers wanted (drive, time, driver), lane changes, collisions and teleports."""

    out: Path
    wanted: pd.DataFrame
    counts: tuple[int, int, int]


def run(config: Path, kind: str, profile: str, seed: int, seconds: float) -> Run:
    """One run of a kind: without, aligned, with drivers."""
    out = config.with_name("fcd.xml")
    words = ["-c", str(config), "--fcd-output", str(out), "--fcd-output.attributes", "speed,pos,posLat,lane,type"]
    sumo = start([*words, "--precision", "4", "--seed", str(seed)])
    traffic = SumoTraffic(sumo, xl.read_profile(profile), seed=seed) if kind == "with drivers" else None
    rng = np.random.default_rng(seed)
    changes = collisions = teleports = 0
    before: dict[str, str] = {}
    wanted = []
    while sumo.simulation.getTime() < seconds:
        if traffic is not None:
            traffic.steer()
            time = round(sumo.simulation.getTime(), 2)  # SUMO writes a step under the time at which it began
            wanted += [(name, time, place) for name, (place, steered) in traffic.moves.items() if steered]
        sumo.simulationStep()
        collisions += len(sumo.simulation.getCollisions())
        teleports += sumo.simulation.getStartingTeleportNumber()
        now = {name: sumo.vehicle.getLaneID(name) for name in sumo.vehicle.getIDList()}
        changes += sum(before.get(name, lane) != lane and before[name][:-1] == lane[:-1] for name, lane in now.items())
        if kind == "aligned":
            for name in now.keys() - before.keys():
                sumo.vehicle.setLateralAlignment(name, f"{rng.uniform(-ALIGNED, ALIGNED):.2f}")
        before = now
    sumo.close()
    return Run(out, pd.DataFrame(wanted, columns=["drive", "time", "driver"]), (changes, collisions, teleports))


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


def measures(parts: list[pd.DataFrame], column: str) -> str:
    """Spread [m], root of the power between 0.05 and 0.5 Hz [m], share of time near a marking [%]; cells."""
    whole = pd.concat(parts).dropna(subset=[column])
    power = []
    for part in parts:
        values = part[column].to_numpy()[:100] - part[column].to_numpy()[:100].mean()
        if len(values) < 100 or np.isnan(values).any():
            continue
        density = np.abs(np.fft.rfft(values * np.hanning(len(values)))) ** 2
        frequency = np.fft.rfftfreq(len(values), STEP)
        band = (frequency >= 0.05) & (frequency <= 0.5)
        power.append(2.0 * density[band].sum() / len(values) / (np.hanning(len(values)) ** 2).sum())
    half = 0.5 * np.where(whole.is_truck > 0, WIDTH[1.0], WIDTH[0.0])
    near = 100.0 * (0.5 * whole.lane_width - whole[column].abs() - half < NEAR).mean()
    return f"{whole[column].std():.3f} | {np.sqrt(np.mean(power)):.3f} | {near:.1f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--profile", default="motorway")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--sublane", type=float, default=4.0)
    given = parser.parse_args()
    changes: dict[str, list[int]] = {}
    print("| seed | run | spread [m] | 0.05 to 0.5 Hz [m] | near [%] | lane changes | collisions | teleports |")
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        config = write_run(Path(folder), end=given.seconds, cars=1000, trucks=200, sublane=given.sublane)
        for seed in range(1, given.seeds + 1):
            for kind in ("without", "aligned", "with drivers"):
                out, wanted, counts = run(config, kind, given.profile, seed, given.seconds)
                changes.setdefault(kind, []).append(counts[0])
                table = xl.import_drives("fcd", out, net=Path(folder) / "run.net.xml").to_frame()
                table["time"] = table.time.round(2)
                parts = kept(table)
                cells = " | ".join(map(str, counts))
                print(f"| {seed} | {kind} | {measures(parts, 'offset')} | {cells} |", flush=True)
            numbered = pd.concat([part.assign(drive=f"{k}", name=part.drive) for k, part in enumerate(parts)])
            sampled = xl.sample(given.profile, context=numbered.drop(columns="name"), seed=seed).to_frame()
            both = numbered.merge(sampled, on=["drive", "time"], suffixes=("", "_sampled"))
            both = both.merge(
                wanted, left_on=["name", "time"], right_on=["drive", "time"], suffixes=("", "_"), how="left"
            )
            for word, column in (("driver's answer", "driver"), ("sample", "offset_sampled")):
                print(
                    f"| {seed} | {word} | {measures([p for _, p in both.groupby('drive')], column)} | | | |", flush=True
                )
    for kind, found in changes.items():
        print(f"\n{kind}: {np.mean(found):.0f} lane changes, standard deviation {np.std(found, ddof=1):.0f}")


if __name__ == "__main__":
    main()
