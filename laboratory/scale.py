"""How costs grow with size: processor time, and the exponent between the last two sizes (`docs/performance.md`).

    python -m laboratory.scale [WHAT ...] [--most 1000]

Vehicles of a scenario, vehicles that arrive in a running simulation at once, roads, events, hours of drives, context
columns of the closed loop, profiles of a library. The smallest size runs first and once more, so that nothing is loaded
within a measurement.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

import xosc_lateral as xl
from examples.driver_simulator import simulate_drive
from laboratory.live import ROAD, roads
from tests.kit.scenario_files import (
    action,
    entity,
    event,
    private,
    scenario_text,
    speed_action,
    story,
    teleport,
    time_condition,
)
from xosc_lateral.base.plugins import shipped_folder
from xosc_lateral.extras.live.esmini import EsminiTraffic
from xosc_lateral.extras.live.esmini_library import open_player
from xosc_lateral.extras.live.moment import Places
from xosc_lateral.extras.live.traffic import Moment, Traffic
from xosc_lateral.workflows.options import NO_EGO

LANE = '<lane id="-{k}" type="driving">{link}<width sOffset="0" a="3.6" b="0" c="0" d="0"/></lane>'
LINKED = '<link><predecessor id="-{k}"/><successor id="-{k}"/></link>'


def _convert(folder: Path, text: str) -> float:
    (folder / "a.xosc").write_text(text, encoding="utf-8")
    return _timed(lambda: xl.convert(folder / "a.xosc", folder / "b.xosc", force=True, ego=["none"]))


def _timed(work: Callable[[], object]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def _long_road(folder: Path) -> None:
    lanes = "".join(LANE.format(k=k, link="") for k in (1, 2, 3))
    (folder / "road.xodr").write_text(ROAD.format(length=60_000.0, lanes=lanes), encoding="utf-8")


def _crowd(n: int, folder: Path) -> str:
    _long_road(folder)
    names = [f"v{k}" for k in range(n)]
    init = "".join(
        private(name, teleport(str(100 + 50 * (k // 3)), str(-1 - k % 3)), speed_action())
        for k, name in enumerate(names)
    )
    entities = "".join(map(entity, names))
    return scenario_text(entities=entities, init=init, stories=story(actors=("v0",)), minor=2)


def vehicles(n: int, folder: Path) -> float:
    """A scenario of 10 s, cars 50 m one behind the other on three lanes."""
    return _convert(folder, _crowd(n, folder))


def in_esmini(n: int, folder: Path) -> float:
    """The same, its drivers for 900 steps of 10 ms in esmini (`ESMINI_LIBRARY`); the slowest step on standard error."""
    (folder / "a.xosc").write_text(_crowd(n, folder), encoding="utf-8")
    player = open_player(os.environ["ESMINI_LIBRARY"], folder / "a.xosc")
    traffic = EsminiTraffic(player, folder / "a.xosc", xl.read_profile("motorway"), ego=NO_EGO, seed=1)
    steps = []
    for _ in range(950):
        steps.append(_timed(lambda: traffic.steer(0.01)))
        player.SE_StepDT(0.01)
        steps[-1] += _timed(lambda: traffic.settle(0.01))
    print(
        f"{n} in esmini: {1e3 * np.mean(steps[50:]):.2f} ms a step, at most {1e3 * max(steps[50:]):.1f}",
        file=sys.stderr,
    )
    return sum(steps[50:])


def arrivals(n: int, folder: Path) -> float:
    """The first step of a running simulation with so many vehicles."""
    s, lane = 10.0 + 19_900.0 * np.arange(n) / n, -1 - np.arange(n) % 3
    even, on = np.ones(n), np.ones(n, dtype=np.bool_)
    road = np.zeros(n, dtype=np.int64)
    places = Places(s, (0.5 + lane) * 3.6, 0.0 * even, road, lane, s, 4.6 * even, 1.9 * even, 1.4 * even)
    names = tuple(f"v{k}" for k in range(n))
    moment = Moment(names, 30.0 * even, 3.6 * even, 0.0 * even, on, on, ~on, places=places)
    traffic = Traffic(xl.read_profile("motorway"), seed=1, roads=roads())
    return _timed(lambda: traffic.step(0.0, moment))


def many_roads(n: int, folder: Path) -> float:
    """Roads of 100 m one behind the other; a car drives on the first ones."""
    lanes = "".join(LANE.format(k=k, link=LINKED.format(k=k)) for k in (1, 2, 3))
    text = ROAD.format(length=100.0, lanes=lanes)
    head, _, rest = text.partition("<road ")
    body = "<road " + rest.removesuffix("</OpenDRIVE>")
    made = []
    for k in range(1, n + 1):
        links = f'<predecessor elementType="road" elementId="{k - 1}" contactPoint="end"/>' if k > 1 else ""
        links += f'<successor elementType="road" elementId="{k + 1}" contactPoint="start"/>' if k < n else ""
        one = body.replace('id="1" length', f'id="{k}" length', 1).replace('x="0"', f'x="{100 * (k - 1)}"', 1)
        made.append(one.replace("<planView>", f"<link>{links}</link><planView>", 1))
    (folder / "road.xodr").write_text(f"{head}{''.join(made)}</OpenDRIVE>", encoding="utf-8")
    return _convert(folder, scenario_text(stop=time_condition(3.0)))


def events(n: int, folder: Path) -> float:
    """Changes of one car's speed, one after the other in 10 s."""
    _long_road(folder)
    made = [event(f"e{k}", action(f"a{k}", speed_action(str(25 + k % 7))), time=10.0 * k / n) for k in range(n)]
    return _convert(folder, scenario_text(stories=story(*made)))


def hours(n: int, folder: Path) -> float:
    """Read and fitted, an hour a drive at 10 Hz."""
    hour = simulate_drive(3600.0, 3).table.iloc[::2][["time", "distance_left", "distance_right", "speed"]]
    tables = [hour.assign(drive=f"d{k}") for k in range(n)]
    pd.concat(tables).to_parquet(folder / "d.parquet")
    return _timed(lambda: xl.fit(folder / "d.parquet", name="all"))


def columns(n: int, folder: Path) -> float:
    """The closed loop on 20 minutes with so many context columns of chance."""
    table = simulate_drive(1200.0, 3).table.iloc[::2][["time", "distance_left", "distance_right", "speed"]]
    rng = np.random.default_rng(1)
    walks = np.cumsum(rng.normal(size=(len(table), n)), axis=0)
    more = pd.DataFrame(walks, columns=[f"c{k}" for k in range(n)], index=table.index)
    pd.concat([table, more], axis=1).to_parquet(folder / "d.parquet")
    return _timed(lambda: xl.close_loop(folder / "d.parquet"))


def library(n: int, folder: Path) -> float:
    """Listed, and one found by its name."""
    values = json.loads((shipped_folder("driver_profiles") / "motorway-vehicle-1.json").read_text("utf-8"))
    (folder / "team").mkdir()
    for k in range(n):
        (folder / "team" / f"p{k}.json").write_text(json.dumps(values | {"id": f"p{k}"}), encoding="utf-8")
    return _timed(lambda: (xl.list_profiles(folder / "team"), xl.read_profile(f"p{n - 1}", library=folder / "team")))


SIZES: dict[Callable[[int, Path], float], tuple[int, ...]] = {
    vehicles: (1, 10, 100, 1000), in_esmini: (10, 50, 200), arrivals: (10, 100, 1000, 10_000),
    many_roads: (1, 50, 500, 5000),
    events: (1, 50, 500, 5000), hours: (1, 10, 100), columns: (5, 50, 500), library: (10, 100, 1000),
}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", nargs="*", help=", ".join(one.__name__ for one in SIZES))
    parser.add_argument("--most", type=int, default=10_000, help="leave larger sizes out")
    given = parser.parse_args()
    print("| what | size: processor time | exponent |\n|---|---|---|")
    for measure, sizes in SIZES.items():
        if measure.__name__ not in (given.what or ({each.__name__ for each in SIZES} - {"in_esmini"})):
            continue
        found: list[tuple[int, float]] = []
        for n in (sizes[0], *(n for n in sizes if n <= given.most)):
            with tempfile.TemporaryDirectory() as folder:
                found.append((n, measure(n, Path(folder))))
        listed = ", ".join(f"{n}: {seconds:.2f} s" for n, seconds in found[1:])
        (a, before), (b, after) = found[-2:]
        exponent = f"{math.log(after / before) / math.log(b / a):.2f}" if b > a else ""
        print(f"| {measure.__doc__} | {listed} | {exponent} |", flush=True)


if __name__ == "__main__":
    main()
