"""Live against played, over everything: each scenario in the reference player's library, with drivers and without.

    python -m laboratory.live_everywhere SCENARIO_OR_FOLDER... --library libesminiLib.so [--catalog FILE] [--csv FILE]
        [--written]

Once with nobody else, and once, where there is an entity `Ego`, with an ego that somebody drives: it brakes to a stop
after a second, stands for two, and goes on. `--catalog` adds a scenario for every vehicle of a catalog, which changes
lanes before an ego, beside a car that stands. Per vehicle that a driver of ours has:

- way: the difference of what it drives, by its speed. [m]
- moved: of who stands as played, how far it is moved. [m]
- lane: whether it ends in another one.
- a: its largest acceleration across its played path, at 20 Hz. [m/s2]
- off: steps on no road, more than played.

Per scenario: events of the storyboard that are lost, and new ones. With `--written` live runs are compared not with the
scenario as it is, but with what `convert --ego Ego` makes of it, under the same ego.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from lxml import etree
from numpy.typing import NDArray

import xosc_lateral as xl
from xosc_lateral.extras.live.esmini import EsminiTraffic
from xosc_lateral.extras.live.esmini_library import EsminiLibrary, open_player
from xosc_lateral.files.openscenario.read import read_scenario

STEP, EVERY = 0.01, 5
"""Of the player [s], and steps between looks at the acceleration."""
NO_ROAD, LEAP = 2**32 - 1, 4.0
"""What the player calls no road; farther within 0.05 s, a vehicle was placed anew. [m]"""
COLUMNS = ["time", "name", "x", "y", "h", "speed", "road", "lane", "steered"]
WAY, MOVED, HARD, STANDING = 0.1, 0.01, 1.0, 0.01
"""What is asked [m], [m], [m/s2]; slower all the time than this, somebody stands. [m/s]"""
COMPARED = ["scenario", "ego", "vehicle", "way", "moved", "lane", "a", "a_beside", "off"]
HEAD = ("ego", "scenarios", "vehicles", "events lost, new", f"way > {WAY} m", "other lane", "stands, and is moved",
        f"a more than {HARD:g} m/s2 beyond played", "off the road")  # fmt: skip


@dataclass(slots=True)
class Run:
    """One run in the library."""

    rows: pd.DataFrame
    events: Counter[tuple[str, int]]
    warnings: list[str]


@dataclass(slots=True)
class Ego:
    """Brakes to a stop and goes on, in its lane."""

    number: int
    road: int
    lane: int
    s: float
    speed: float
    usual: float
    along: float
    stood: float = 0.0

    def drive(self, player: Any, library: Any, now: float) -> None:
        """On by a step."""
        if now > 1.0 and self.stood < 2.0:
            self.speed = max(self.speed - 4.0 * STEP, 0.0)
            self.stood += STEP * (self.speed <= 0.0)
        elif now > 1.0:
            self.speed = min(self.speed + 2.0 * STEP, self.usual)
        self.s += self.along * self.speed * STEP
        library.SE_ReportObjectRoadPos(self.number, self.road, self.lane, 0.0, self.s)
        player.SE_ReportObjectSpeed(self.number, self.speed)


def play(library: Path, scenario: Path, *, drivers: bool, ego: bool, seconds: float, seed: int) -> Run:
    """Play in this process."""
    import ctypes

    player: EsminiLibrary = open_player(library, scenario)
    raw = ctypes.CDLL(str(library))
    raw.SE_ReportObjectRoadPos.argtypes = [
        ctypes.c_int,
        ctypes.c_uint32,
        ctypes.c_int,
        ctypes.c_double,
        ctypes.c_double,
    ]
    events: Counter[tuple[str, int]] = Counter()

    def note(_name: bytes, _kind: int, state: int, path: bytes) -> None:
        events[path.decode(errors="replace"), state] += 1

    profile = xl.read_profile("motorway")
    model = read_scenario(scenario, allowed=[Path(scenario.anchor)])
    traffic = EsminiTraffic(player, model, profile, ego="Ego" if ego else (), seed=seed, on_element=note)
    driven = None
    if ego:
        one = traffic.states()["Ego"]
        along = 1.0 if np.cos(one.h - _road_heading(traffic, one)) >= 0.0 else -1.0
        driven = Ego(one.id, one.road, one.lane, one.s, one.speed, one.speed, along)
    rows: list[tuple[Any, ...]] = []
    if drivers:
        traffic.steer(0.0)
    for k in range(round(seconds / STEP) + 1):
        for name, state in traffic.states().items():
            steered = traffic.moves.get(name, (0.0, False))[1]
            rows.append((k * STEP, name, state.x, state.y, state.h, state.speed, state.road, state.lane, steered))
        if player.SE_GetQuitFlag() == 1:
            break
        if driven is not None:
            driven.drive(player, raw, k * STEP)
        if drivers:
            traffic.steer(STEP)
        if player.SE_StepDT(STEP) != 0:
            break
        if drivers:
            traffic.settle(STEP)
    player.SE_Close()
    warnings = [*traffic.warnings, *traffic.traffic.fault_lines()]
    return Run(pd.DataFrame(rows, columns=COLUMNS), events, warnings)


def _road_heading(traffic: EsminiTraffic, state: Any) -> float:
    index = traffic.network.index_of(str(state.road))
    return float(traffic.network.road_pose_at(index, state.s).heading + traffic.network.header_offset.heading)


def played(library: Path, scenario: Path, **how: Any) -> Run | None:
    """The same in a process of its own: the library keeps things from run to run. None: it can't be played."""
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / "run.pickle"
        child = get_context("fork").Process(target=_play, args=(library.resolve(), scenario.resolve(), how, found))
        child.start()
        child.join()
        return None if not found.is_file() else pd.read_pickle(found)


def _play(library: Path, scenario: Path, how: dict[str, Any], found: Path) -> None:
    os.chdir(found.parent)  # the player writes files where it is
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    pd.to_pickle(play(library, scenario, **how), found)


@dataclass(slots=True)
class Compared:
    """One scenario with one ego."""

    scenario: str
    ego: str
    lost: int = 0
    new: int = 0
    vehicles: list[dict[str, Any]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def compare(name: str, ego: str, plain: Run, live: Run, *, written: bool = False) -> Compared:
    """What is other with drivers; events that a written scenario has in other words are no difference."""
    result = Compared(name, ego, notes=live.warnings)
    both_have = {path for path, _ in plain.events} & {path for path, _ in live.events}
    lost, new = plain.events - live.events, live.events - plain.events
    result.lost, result.new = (
        sum(n for (path, _), n in more.items() if path in both_have or not written) for more in (lost, new)
    )
    before = dict(tuple(plain.rows.groupby("name")))
    for who, after in live.rows.groupby("name"):
        if not after["steered"].any() or who not in before:
            continue
        both = after.merge(before[who], on="time", suffixes=("", "_played"))
        at = both["time"].to_numpy()
        ways = [float(np.trapezoid(np.abs(both[column]), at)) for column in ("speed", "speed_played")]
        x, y, h = (both[f"{column}_played"].to_numpy() for column in "xyh")
        dx, dy = both["x"].to_numpy() - x, both["y"].to_numpy() - y
        stands = bool((both["speed_played"].abs() < STANDING).all())
        result.vehicles.append({
            "scenario": name, "ego": ego, "vehicle": who, "way": abs(ways[0] - ways[1]),
            "moved": float(np.hypot(dx, dy).max()) if stands else 0.0,
            "lane": both["lane"].iloc[-1] != both["lane_played"].iloc[-1],
            "a": _across(both, "") - _across(both, "_played"), "a_beside": _beside(dx, dy, h),
            "off": int((both["road"] == NO_ROAD).sum() - (both["road_played"] == NO_ROAD).sum()),
        })  # fmt: skip
    return result


def _across(rows: pd.DataFrame, suffix: str) -> float:
    """Largest acceleration across a path at 20 Hz. [m/s2]"""
    x, y, h = (rows[f"{column}{suffix}"].to_numpy()[::EVERY] for column in "xyh")
    across = np.abs(np.diff(y, 2) * np.cos(h[1:-1]) - np.diff(x, 2) * np.sin(h[1:-1])) / (STEP * EVERY) ** 2
    step = np.hypot(np.diff(x), np.diff(y))
    leaps = (step[1:] > LEAP) | (step[:-1] > LEAP)  # placed anew
    return float(across[~leaps].max(initial=0.0))


def _beside(dx: NDArray[np.float64], dy: NDArray[np.float64], h: NDArray[np.float64]) -> float:
    """The same of the way from where it is played, across that. [m/s2]"""
    beside = (dy * np.cos(h) - dx * np.sin(h))[::EVERY]
    bent = np.abs(np.diff(beside, 2)) / (STEP * EVERY) ** 2
    return float(bent[np.abs(np.diff(beside))[1:] < 0.3].max(initial=0.0))


ROAD = """<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="1" length="1500" junction="-1">
<planView><geometry s="0" x="0" y="0" hdg="0" length="1500"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>{}</right></laneSection></lanes>
</road></OpenDRIVE>"""
LANE = '<lane id="-{}" type="driving"><width sOffset="0" a="3.75" b="0" c="0" d="0"/></lane>'
PLACE = """<Private entityRef="{}"><PrivateAction><TeleportAction><Position><LanePosition roadId="1" laneId="{}" s="{}"
offset="0"/></Position></TeleportAction></PrivateAction><PrivateAction><LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/><SpeedActionTarget>
<AbsoluteTargetSpeed value="{}"/></SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction></Private>"""
AFTER = """<StartTrigger><ConditionGroup><Condition name="c{0}" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="{0}" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup>
</StartTrigger>"""
SCENARIO = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" description="" author=""/>
<CatalogLocations><VehicleCatalog><Directory path="{folder}"/></VehicleCatalog></CatalogLocations>
<RoadNetwork><LogicFile filepath="road.xodr"/></RoadNetwork>
<Entities>{entities}</Entities><Storyboard><Init><Actions>{places}</Actions></Init>
<Story name="s"><Act name="a"><ManeuverGroup name="g" maximumExecutionCount="1">
<Actors selectTriggeringEntities="false"><EntityRef entityRef="X"/></Actors><Maneuver name="m">
<Event name="e" priority="overwrite"><Action name="change"><PrivateAction><LateralAction><LaneChangeAction>
<LaneChangeActionDynamics dynamicsShape="sinusoidal" dynamicsDimension="time" value="4"/>
<LaneChangeTarget><AbsoluteTargetLane value="-2"/></LaneChangeTarget></LaneChangeAction></LateralAction></PrivateAction>
</Action>{event}</Event></Maneuver></ManeuverGroup>{act}</Act></Story>
<StopTrigger><ConditionGroup><Condition name="stop" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="20" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup></StopTrigger>
</Storyboard></OpenSCENARIO>"""
ENTITY = '<ScenarioObject name="{}"><CatalogReference catalogName="{}" entryName="{}"/></ScenarioObject>'


def of_catalog(catalog: Path, folder: Path) -> Iterator[tuple[str, Path]]:
    """A scenario for every vehicle of a catalog."""
    root = etree.parse(str(catalog)).getroot().find("{*}Catalog")
    assert root is not None
    entries = [str(one.get("name")) for one in root.findall("{*}Vehicle")]
    car = next(str(one.get("name")) for one in root.findall("{*}Vehicle") if one.get("vehicleCategory") == "car")
    for entry in entries:
        own = folder / entry
        own.mkdir(parents=True)
        (own / "road.xodr").write_text(ROAD.format("".join(LANE.format(k) for k in (1, 2, 3))))
        who = (("X", entry, -1, 150.0, 22.0), ("Ego", car, -2, 60.0, 22.0), ("Stands", car, -3, 300.0, 0.0))
        text = SCENARIO.format(
            folder=catalog.resolve().parent, event=AFTER.format(4), act=AFTER.format(0),
            entities="".join(ENTITY.format(name, root.get("name"), kind) for name, kind, *_ in who),
            places="".join(PLACE.format(name, *place) for name, _, *place in who),
        )  # fmt: skip
        (own / f"{entry}.xosc").write_text(text)
        yield f"catalog: {entry}", own / f"{entry}.xosc"


def written(scenario: Path, folder: Path, seed: int) -> Path | None:
    """What is made of a scenario; None: nothing can be."""
    output = folder / f"written_{scenario.parent.name}_{scenario.name}"
    try:
        xl.convert(scenario, output, ego=["Ego"], seed=seed, force=True)
    except xl.XoscLateralError:
        return None
    return output


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", type=Path, nargs="*", metavar="SCENARIO_OR_FOLDER")
    parser.add_argument("--library", type=Path, required=True)
    parser.add_argument("--catalog", type=Path)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--minutes", type=float, default=1e3, help="what is not reached by then is counted as left out")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--written", action="store_true", help="compare with converted scenarios")
    parser.add_argument("--csv", type=Path)
    given = parser.parse_args()
    found: list[Compared] = []
    apart: Counter[str] = Counter()
    until = time.monotonic() + 60.0 * given.minutes
    with tempfile.TemporaryDirectory() as folder:
        paths = [
            one for place in given.places for one in (sorted(place.rglob("*.xosc")) if place.is_dir() else [place])
        ]
        sources = [(one.stem, one) for one in paths if b"<Storyboard" in one.read_bytes()]
        sources = [*(of_catalog(given.catalog, Path(folder)) if given.catalog else []), *sources]
        for name, path in sources:
            for ego in ("nobody", "brakes") if b'name="Ego"' in path.read_bytes() else ("nobody",):
                if time.monotonic() > until:
                    apart["left out: no time"] += 1
                    continue
                how = {"ego": ego != "nobody", "seconds": given.seconds, "seed": given.seed}
                source = written(path, Path(folder), given.seed) if given.written else path
                plain = None if source is None else played(given.library, source, drivers=False, **how)
                live = played(given.library, path, drivers=True, **how)
                if plain is None or live is None:
                    apart["not played without drivers" if plain is None else f"not with drivers: {name}"] += 1
                    continue
                found.append(compare(name, ego, plain, live, written=given.written))
                for line in _remarkable(found[-1]):
                    print(line, flush=True)
    vehicles = pd.DataFrame([row for one in found for row in one.vehicles], columns=COMPARED)
    if given.csv is not None:
        vehicles.to_csv(given.csv, index=False)
    print(f"\n| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}")
    for ego in ("brakes", "nobody"):
        rows = vehicles[vehicles["ego"] == ego]
        own = [one for one in found if one.ego == ego]
        counts = (rows["way"] > WAY, rows["lane"], rows["moved"] > MOVED, hard(rows), rows["off"] > 0)
        events = f"{sum(one.lost for one in own)}, {sum(one.new for one in own)}"
        print(f"| {ego} | {len(own)} | {len(rows)} | {events} | {' | '.join(str(int(n.sum())) for n in counts)} |")
    way, moved = vehicles["way"].max(), vehicles["moved"].max()
    print(f"\nlargest: way {way:.3f} m, standing {moved:.4f} m; apart: {dict(apart)}")


def hard(row: Any) -> Any:
    """Where drivers add an acceleration that nobody drives, of one vehicle or many."""
    return (row["a"] > HARD) & (row["a_beside"] > HARD)


def _remarkable(one: Compared) -> Iterator[str]:
    head = f"{one.scenario[:40]:40} {one.ego:7}"
    if one.lost or one.new:
        yield f"{head} events: {one.lost} lost, {one.new} new"
    for row in one.vehicles:
        if row["way"] > WAY or row["lane"] or row["moved"] > MOVED or row["off"] > 0 or hard(row):
            where = f"way {row['way']:.3f} m, moved {row['moved']:.3f} m, other lane {row['lane']}, off {row['off']}"
            yield f"{head} {row['vehicle']}: {where}, a {row['a']:+.1f} m/s2, beside {row['a_beside']:.1f}"
    for note in one.notes:
        yield f"{head} {note}"


if __name__ == "__main__":
    main()
