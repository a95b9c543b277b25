"""A thousand drivers live: processor time of `Traffic` for each second of a simulation at 100 Hz.

    python -m benchmarks.live [--vehicles 1000] [--seconds 20] [--profile motorway]

Cars at 25 to 36 m/s on a three-lane motorway of 20 km that closes to a ring, everybody looked at by everybody.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from tests.road.networks import straight_road
from xosc_lateral.api.profiles import read_profile
from xosc_lateral.live.surroundings import OpenDriveRoads, Places
from xosc_lateral.live.traffic import Moment, Traffic

DT, LENGTH, LANES, WIDTH = 0.01, 20_000.0, 3, 3.6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--profile", default="motorway")
    given = parser.parse_args()
    n, rng = given.vehicles, np.random.default_rng(1)
    traffic = Traffic(read_profile(given.profile), seed=1, roads=OpenDriveRoads(straight_road(LENGTH, LANES, WIDTH)))
    names = tuple(f"car {k}" for k in range(n))
    s, speed = rng.uniform(0.0, LENGTH, n), rng.uniform(25.0, 36.0, n)
    lane = -1 - rng.integers(0, LANES, n)
    offset, yes, spent = np.zeros(n), np.ones(n, dtype=bool), []
    for k in range(round(given.seconds / DT)):
        s = (s + speed * DT) % LENGTH
        y = (lane + 0.5) * WIDTH + offset
        places = Places(s, y, np.zeros(n), np.zeros(n, dtype=int), lane, s, np.full(n, 4.6), np.full(n, 1.9), np.full(n, 1.4))
        moment = Moment(names, speed, np.full(n, WIDTH), offset, yes, yes, rng.random(n) < 0.0, places=places)
        begin = time.process_time()
        offset = traffic.step(k * DT, moment).offset
        spent.append(time.process_time() - begin)
    later = np.array(spent[round(5.0 / DT) :])
    print(f"{n} drivers of {given.profile}: {spent[0]:.1f} s for the first step; then {100.0 * later.mean():.2f} s of one")
    print(f"core per second; a step takes {1e3 * np.median(later):.2f} ms, at most {1e3 * later.max():.0f} ms (model steps)")


if __name__ == "__main__":
    main()
