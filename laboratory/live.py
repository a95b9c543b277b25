"""A thousand drivers live: processor time of `Traffic` for each second of a simulation at 100 Hz.

    python -m laboratory.live [--vehicles 1000] [--seconds 20] [--profile motorway]

Cars at 25 to 36 m/s on a three-lane motorway of 20 km, each with the vehicles around.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from xosc_lateral.extras.live.moment import OpenDriveRoads, Places
from xosc_lateral.extras.live.traffic import Moment, Traffic
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.workflows.profiles.profiles import read_profile

DT, LENGTH, LANES, WIDTH = 0.01, 20_000.0, 3, 3.6


ROAD = """<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="1" length="{length}" junction="-1">
<planView><geometry s="0" x="0" y="0" hdg="0" length="{length}"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>{lanes}</right></laneSection></lanes>
</road></OpenDRIVE>"""
LANE = '<lane id="-{k}" type="driving"><width sOffset="0" a="{width}" b="0" c="0" d="0"/></lane>'


def roads() -> OpenDriveRoads:
    lanes = "".join(LANE.format(k=k, width=WIDTH) for k in range(1, LANES + 1))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motorway.xodr"
        path.write_text(ROAD.format(length=LENGTH, lanes=lanes), encoding="utf-8")
        return OpenDriveRoads(read_opendrive(path))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--profile", default="motorway")
    given = parser.parse_args()
    n, rng = given.vehicles, np.random.default_rng(1)
    traffic = Traffic(read_profile(given.profile), seed=1, roads=roads())
    names = tuple(f"car {k}" for k in range(n))
    s, speed = rng.uniform(0.0, LENGTH, n), rng.uniform(25.0, 36.0, n)
    lane = -1 - rng.integers(0, LANES, n)
    offset, yes, spent = np.zeros(n), np.ones(n, dtype=bool), []
    for k in range(round(given.seconds / DT)):
        s = (s + speed * DT) % LENGTH
        y = (lane + 0.5) * WIDTH + offset
        size = (np.full(n, 4.6), np.full(n, 1.9), np.full(n, 1.4))
        places = Places(s, y, np.zeros(n), np.zeros(n, dtype=int), lane, s, *size)
        moment = Moment(names, speed, np.full(n, WIDTH), offset, yes, yes, ~yes, places=places)
        begin = time.process_time()
        offset = traffic.step(k * DT, moment).offset
        spent.append(time.process_time() - begin)
    later = np.array(spent[round(5.0 / DT) :])
    tick, worst, load = 1e3 * np.median(later), 1e3 * later.max(), later.mean() / DT
    print(f"{n} drivers of {given.profile}: {load:.2f} s of one core per second, {tick:.2f} ms a step,")
    print(f"at most {worst:.0f} ms, where it is one of the model's; the first one takes {spent[0]:.1f} s")


if __name__ == "__main__":
    main()
