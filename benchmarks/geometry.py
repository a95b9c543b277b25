"""Speed of the road geometry, beside plain numpy in the same run: `python -m benchmarks.geometry [ROAD.xodr ...]`."""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from xosc_lateral.formats.opendrive import read_opendrive
from xosc_lateral.road import DRIVING, RoadNetwork

ROOT = Path(__file__).resolve().parents[1]
PUBLIC = ROOT.parent / "shared" / "corpus" / "esmini" / "xodr"
DEFAULTS = [PUBLIC / "e6mini.xodr", PUBLIC / "curves_elevation.xodr", PUBLIC / "multi_intersections.xodr"]
POINTS = 1_000_000
REPEATS = 5


def seconds(call: Callable[[], object], repeats: int = REPEATS) -> float:
    """Median time of a call."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def microseconds(call: Callable[[], object], number: int = 5000) -> float:
    """Time of one of many calls."""

    def many() -> None:
        for _ in range(number):
            call()

    return seconds(many, 3) / number * 1e6


def places(network: RoadNetwork, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Random places in driving lanes, all roads mixed."""
    lanes = [
        (index, lane.id, section.start, section.end)
        for index, road in enumerate(network.roads)
        for section in road.sections
        for lane in section.lanes
        if lane.type in DRIVING
    ]
    road, lane, start, end = (np.array(column) for column in zip(*lanes, strict=True))
    pick = rng.integers(len(lanes), size=POINTS)
    s = start[pick] + rng.random(POINTS) * (end[pick] - start[pick]) * (1.0 - 1e-12)
    return road[pick].astype(np.int32), lane[pick].astype(np.int32), s, rng.normal(0.0, 0.3, POINTS)


def report(path: Path) -> None:
    """Measure one file."""
    rng = np.random.default_rng(1)
    reading = seconds(lambda: read_opendrive(path))
    network = read_opendrive(path)
    road, lane, s, offset = places(network, rng)
    network.lane_to_world(road[:1], lane[:1], s[:1])
    plain = seconds(lambda: (np.sin(s), np.cos(s)))
    mixed = seconds(lambda: network.lane_to_world(road, lane, s, offset))
    own = np.flatnonzero((road == road[0]) & (lane == lane[0]))
    along = np.sort(np.resize(s[own], POINTS))
    one_road, one_lane = int(road[0]), int(lane[0])
    single = seconds(lambda: network.lane_to_world(one_road, one_lane, along, offset))
    poses = network.lane_to_world(road, lane, s, offset)
    part = slice(0, POINTS // 10)
    network.world_to_lane(poses.x[:1], poses.y[:1])
    back = seconds(lambda: network.world_to_lane(poses.x[part], poses.y[part]), 3) * 10
    follow = seconds(lambda: network.path_to_lane(poses.x[part], poses.y[part], road[part], s[part] + 1.0), 3) * 10

    print(f"{path.name}: {len(network.roads)} roads, read in {reading * 1e3:.1f} ms; {POINTS:,} places")
    print(f"  numpy sin and cos of as many numbers       {POINTS / plain / 1e6:8.2f} M/s")
    for name, time_ in (
        ("lane_to_world, one lane in order", single),
        ("lane_to_world, all lanes at random", mixed),
        ("path_to_lane, guess 1 m off", follow),
        ("world_to_lane", back),
    ):
        print(f"  {name:<42} {POINTS / time_ / 1e6:8.2f} M/s   {time_ / plain:6.1f} x sin and cos")
    r, n, at, off = int(road[0]), int(lane[0]), float(s[0]), float(offset[0])
    x, y = float(poses.x[0]), float(poses.y[0])
    calls: dict[str, Callable[[], object]] = {
        "pose_at": lambda: network.pose_at(r, n, at, off),
        "curvature_at": lambda: network.curvature_at(r, at),
        "lane_state_at": lambda: network.lane_state_at(r, n, at),
        "lane_at": lambda: network.lane_at(r, at, off),
        "advance": lambda: network.advance(r, n, at, 0.5),
        "world_to_lane_at, with hint": lambda: network.world_to_lane_at(x, y, near=(r, at + 0.5)),
    }
    print("  one at a time [us]: " + ", ".join(f"{name} {microseconds(call):.2f}" for name, call in calls.items()))


def main() -> None:
    """Measure the files named, else public ones beside the project."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("roads", nargs="*", type=Path)
    paths = parser.parse_args().roads or [path for path in DEFAULTS if path.exists()]
    for path in paths or sorted((ROOT / "tests" / "data" / "xodr" / "valid").glob("*.xodr")):
        report(path)


if __name__ == "__main__":
    main()
