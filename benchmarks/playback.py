"""How fast scenarios are played: all of a folder, one by one, in this process.

    python -m benchmarks.playback FOLDER [--step 0.02] [--time-limit 60] [--slowest 10] [--repeat 3]

Reading the scenario with its road and playing it are timed apart; starting Python counts in neither. A row is one
entity at one step.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from xosc_lateral.errors import XoscLateralError
from xosc_lateral.formats.opendrive import read_opendrive
from xosc_lateral.formats.openscenario.read import read_scenario
from xosc_lateral.motion.nominal import NominalMotion
from xosc_lateral.playback.player import play
from xosc_lateral.road import RoadNetwork


@dataclass(frozen=True)
class Cost:
    name: str
    reading: float  # CPU [s]
    playing: float  # CPU [s]
    rows: int
    simulated: float  # [s]

    @property
    def per_row(self) -> float:
        """Of playing. [us]"""
        return 1e6 * self.playing / self.rows


def timed(path: Path, step: float, limit: float) -> tuple[float, float, NominalMotion]:
    """CPU time of reading and of playing, and what came out. [s]"""
    begin = time.process_time()
    scenario = read_scenario(path)
    network = RoadNetwork(()) if scenario.road_file is None else read_opendrive(scenario.road_file)
    read = time.process_time()
    motion = play(scenario, network, step=step, time_limit=limit)
    return read - begin, time.process_time() - read, motion


def costs(folder: Path, step: float, limit: float, repeat: int) -> Iterator[Cost]:
    """The best of `repeat` runs of each scenario that can be played."""
    for path in sorted(folder.rglob("*.xosc")):
        try:
            runs = [timed(path, step, limit) for _ in range(repeat)]
        except XoscLateralError:  # a catalog, a distribution, or what can't be played
            continue
        motion = runs[0][2]
        rows = sum(len(entity.time) for entity in motion.entities)
        yield Cost(path.stem, min(r for r, _, _ in runs), min(p for _, p, _ in runs), rows, motion.end_time)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--step", type=float, default=0.02)
    parser.add_argument("--time-limit", type=float, default=60.0)
    parser.add_argument("--slowest", type=int, default=10)
    parser.add_argument("--repeat", type=int, default=3)
    args = parser.parse_args()
    found = list(costs(args.folder, args.step, args.time_limit, args.repeat))
    if not found:
        raise SystemExit(f"{args.folder}: nothing to play")
    print(f"{'scenario':60} {'reading s':>10} {'playing s':>10} {'rows':>8} {'us/row':>8} {'x real time':>12}")
    for cost in sorted(found, key=lambda cost: -cost.per_row)[: args.slowest]:
        factor = cost.simulated / cost.playing
        times = f"{cost.reading:10.3f} {cost.playing:10.3f}"
        print(f"{cost.name[:60]:60} {times} {cost.rows:8d} {cost.per_row:8.1f} {factor:12.0f}")
    reading, playing = sum(cost.reading for cost in found), sum(cost.playing for cost in found)
    rows, simulated = sum(cost.rows for cost in found), sum(cost.simulated for cost in found)
    print(
        f"{len(found)} scenarios, on average: reading {reading / len(found):.3f} s, "
        f"playing {playing / len(found):.3f} s, {1e6 * playing / rows:.1f} us per row, "
        f"{simulated / playing:.0f} times faster than real time"
    )


if __name__ == "__main__":
    main()
