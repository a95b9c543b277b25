"""Two vehicles beside each other in converted scenarios: the clearance that they keep, beside that of real traffic.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m laboratory.converted_pairs dlr.parquet [--profile NAME...] [--seeds 20] [--scene pairs]
        [--write PAGE.md]

A car overtakes a truck and a car, then two cars drive at the same speed; in right-hand and left-hand traffic, on lanes
along the road's s and against it. Every scenario is converted with both vehicles and with one of them alone, with the
same seeds: what the other brings about is the difference, counted away from the other. Of overtaking, the mean in each
band of distance less the mean beyond 100 m, as `laboratory.clearance` has it of the recording; the last row is what is
left beyond 100 m. Intervals are of 1,000 resamples of the conversions, in the nearest row of each lane.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import xosc_lateral as xl
from laboratory.clearance import BANDS, FAR, Clearance, band_name, resampled, within_vehicles
from laboratory.markers import write_between_markers
from laboratory.pair_scenarios import FAST, ROADS, SLOW, Driven, Road, write_scenario
from laboratory.storyboard import Vehicle
from xosc_lateral.extras.loop.timeline import join_drives
from xosc_lateral.files.drives import read_drives

FloatArray = NDArray[np.float64]

PASSING_S, SLOW_SPEED, FAST_SPEED = 60.0, 25.0, 33.0
"""A scenario of a minute, as long as the recording sees a vehicle [s]; speeds of a truck and of who overtakes [m/s]."""

APART = 240.0
"""Free space that the overtaking car starts with: it is passed in the middle of the minute. [m]"""

PASSED = (Vehicle.TRUCK, Vehicle.CAR)
"""Whom a car overtakes."""

GAPS = (0.0, 10.0, 35.0, 75.0, 125.0)
"""Distances of pairs at the same speed: the middles of the recording's bands. [m]"""

PAIR_S = 40.0
SETTLED_S = 10.0
"""Length of those scenarios, and what is left out at their start, where drivers settle. [s]"""

NEIGHBOUR = {SLOW: "left", FAST: "right"}
"""On which side the other is, in right-hand traffic."""

LANES = {FAST: "overtaking", SLOW: "slow"}
"""In the order of the tables."""

Found = dict[tuple[int, int], list[float]]
"""Lane and row of a table -> one value for each conversion. [m]"""


@dataclass(frozen=True, slots=True)
class Scene:
    """Two vehicles on a road.

    Parameters
    ----------
    road : Road
    slow, fast : Driven
        In the slow and in the overtaking lane.
    duration : float
        [s]
    """

    road: Road
    slow: Driven
    fast: Driven
    duration: float

    def free(self, time: FloatArray) -> FloatArray:
        """Free space lengthwise, shape of `time` [s]; 0 while they overlap. [m]"""
        ahead = self.slow.start - self.fast.start + (self.slow.speed - self.fast.speed) * time
        return np.maximum(np.maximum(ahead - self.fast.length, -ahead - self.slow.length), 0.0)

    def moved(self, folder: Path, profile: str, seeds: range) -> Iterator[tuple[int, FloatArray, FloatArray]]:
        """Lane, times [s], and by how much the other vehicle moves this one away from it [m]; every lane and seed."""
        both = write_scenario(folder, "both", self.road, (self.slow, self.fast), self.duration)
        for lane, one in ((SLOW, self.slow), (FAST, self.fast)):
            alone = write_scenario(folder, one.name, self.road, (one,), self.duration)
            away = self.road.outwards * (1.0 if lane == SLOW else -1.0)
            for seed in seeds:
                rows, without = (
                    frame[frame["name"] == one.name]
                    for frame in (xl.convert(path, profile=profile, seed=seed).to_frame() for path in (both, alone))
                )
                difference = rows["offset"].to_numpy() - without["offset"].to_numpy()
                yield lane, rows["time"].to_numpy(), away * difference


def overtaking(road: Road, passed: Vehicle) -> Scene:
    """A car comes from behind, and is out of reach at both ends of the minute."""
    slow = Driven("Slow", passed, SLOW, 100.0 + APART, SLOW_SPEED)
    fast = Driven("Fast", Vehicle.CAR, FAST, 100.0 - Vehicle.CAR.front - Vehicle.CAR.rear, FAST_SPEED)
    return Scene(road, slow, fast, PASSING_S)


def beside(road: Road, gap: float) -> Scene:
    """Two cars at the same speed, the one in the overtaking lane ahead by a gap. [m]"""
    slow = Driven("Slow", Vehicle.CAR, SLOW, 100.0, SLOW_SPEED)
    fast = Driven("Fast", Vehicle.CAR, FAST, slow.front + gap if gap else slow.start, SLOW_SPEED)
    return Scene(road, slow, fast, PAIR_S)


def overtaking_clearances(scene: Scene, folder: Path, profile: str, seeds: range) -> Found:
    """By lane and band; the last is beyond all, against none at all. [m]"""
    found: Found = {}
    for lane, time, moved in scene.moved(folder, profile, seeds):
        free = scene.free(time)
        far = float(moved[free > FAR].mean())
        for number, (low, high) in enumerate(BANDS):
            found.setdefault((lane, number), []).append(float(moved[(free > low) & (free <= high)].mean()) - far)
        found.setdefault((lane, len(BANDS)), []).append(far)
    return found


def pair_clearances(road: Road, folder: Path, profile: str, seeds: range) -> Found:
    """By lane and gap, once drivers have settled. [m]"""
    found: Found = {}
    for number, gap in enumerate(GAPS):
        for lane, time, moved in beside(road, gap).moved(folder, profile, seeds):
            found.setdefault((lane, number), []).append(float(moved[time >= SETTLED_S].mean()))
    return found


def interval(values: list[float]) -> Clearance:
    """Mean of conversions."""
    return resampled(np.array(values), np.ones(len(values)))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path)
    parser.add_argument("--profile", nargs="+", default=["motorway"])
    parser.add_argument("--seeds", type=int, default=20, help="conversions of each scenario")
    parser.add_argument("--scene", choices=("overtaking", "pairs", "both"), default="both")
    parser.add_argument("--write", type=Path, metavar="PAGE.md", help="page with the markers")
    args = parser.parse_args()
    timeline, seeds = join_drives(list(read_drives(args.table))), range(args.seeds)
    recorded = {
        (lane, number): within_vehicles(timeline, timeline.offset[None], side, band)
        for lane, side in NEIGHBOUR.items()
        for number, band in enumerate(BANDS)
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for passed in PASSED if args.scene != "pairs" else ():
            found = {
                (profile, road): overtaking_clearances(overtaking(road, passed), folder, profile, seeds)
                for profile in args.profile
                for road in ROADS
            }
            names = [*map(band_name, BANDS), f"beyond {FAR:g} m"]
            _show(f"pairs-{passed.value[1]}", names, found, recorded, args.write)
        if args.scene != "overtaking":
            found = {
                (profile, road): pair_clearances(road, folder, profile, seeds)
                for profile in args.profile
                for road in ROADS
            }
            _show("pairs-beside", [f"{gap:g} m" for gap in GAPS], found, {}, args.write)


def _show(
    scene: str,
    names: Sequence[str],
    found: Mapping[tuple[str, Road], Found],
    recorded: Mapping[tuple[int, int], Clearance | None],
    page: Path | None,
) -> None:
    """Print the table, and every road by itself while alongside; write the table where asked."""
    text = "\n".join(table(names, found, recorded))
    print(f"\n{scene}\n\n{text}\n")
    for lane, lane_name in LANES.items():
        for profile in dict.fromkeys(profile for profile, _ in found):
            each = ", ".join(f"{road} {interval(found[profile, road][lane, 0])}" for road in ROADS)
            print(f"Alongside, {lane_name} lane, `{profile}`, road by road: {each}")
    if page is not None:
        write_between_markers(page, text, scene)


def table(
    names: Sequence[str],
    found: Mapping[tuple[str, Road], Found],
    recorded: Mapping[tuple[int, int], Clearance | None],
) -> list[str]:
    """Lanes one below the other, hands side by side. [m]"""
    profiles = list(dict.fromkeys(profile for profile, _ in found))
    heads = [f"`{profile}`, {hand}" for profile in profiles for hand in ("right-hand", "left-hand")]
    heads = ["lane", "distance", *(["recorded"] if recorded else []), *heads]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for lane, lane_name in LANES.items():
        for number, name in enumerate(names):
            cells = [str(recorded.get((lane, number)) or "")] if recorded else []
            for profile in profiles:
                for left_hand in (False, True):
                    roads = [road for road in ROADS if road.left_hand == left_hand]
                    shown = interval([value for road in roads for value in found[profile, road][lane, number]])
                    cells.append(str(shown) if number == 0 else f"{shown.mean:+.3f}")
            lines.append(f"| {lane_name if number == 0 else ''} | {name} | {' | '.join(cells)} |")
    return lines


if __name__ == "__main__":
    main()
