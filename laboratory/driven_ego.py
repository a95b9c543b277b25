"""A vehicle under test drives itself in the reference player's library: is all around it as in the source?

    python -m laboratory.driven_ego SCENARIO_OR_FOLDER... --library libesminiLib.so [--made] [--csv FILE]

Each scenario that has an entity `Ego` is converted with `--ego Ego`; source and output are played with frames of
0.01 s, while `Ego` drives, from 1 s on, at 0.7, 1 and 1.3 of its initial speed; brakes to a stop at 5 s and goes on 2 s
later ("stops"); or goes to the next lane within 4 s at 5 s ("changes"), and back 10 s later. `--made` adds the
scenarios of `tests.kit.made.reactive`; a file of parameter distributions stands for its first, middle and last
set. Per scenario and speed:

- late: the largest difference of a change of state of the source's storyboard elements, and of the stop. [s]
- lost: changes of state that are missing or that come once more, and last lanes that differ.
- kick: by how much more a car's heading changes within 0.01 s, above 5 m/s, than around that time in the source. [mrad]
- moves: the smallest share of a car's road-following time (above 40 km/h, none of its own lateral actions) within
  `WINDOW` of which its place in the lane changes by more than `MOVED`.
- contacts: steps in which cars touch that do not in the source.
- along: how far along the lane a car is from where it is in the source, less what its way beside the middle makes in
  bends: its place beside it times each change of heading. Asked where no event is a frame late or more. [m]
- slow: by how much it is turned against the source, below 2 m/s. [mrad]
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from lxml import etree

import xosc_lateral as xl
from laboratory.in_player import STEP, Span, sharpest, within
from laboratory.player_outputs import LATERAL, OURS, actions
from tests.kit.made.reactive import reactive_scenarios
from xosc_lateral.base.segment import MINIMUM_SPEED

EGOS: tuple[str, ...] = ("0.7", "1.0", "1.3", "stops", "changes")
BRAKING, GOING = 5.0, 3.0
"""Of an ego that stops, and goes on. [m/s2]"""
START, STANDS, CROSSING, STAYS = 5.0, 2.0, 4.0, 10.0
"""When it does something else, how long it stands, is on its way to the next lane, and stays there. [s]"""
SLOW, ALONG = 2.0, 0.05
"""[m/s], [m]"""
WINDOW = 1.0
"""In which somebody who drives is seen to move. [s]"""
MOVED = 0.001
"""So far at least: the smallest change that is written. [m]"""
LATE, KICK, MOVES = 0.05, 1.0, 0.9
"""What is asked. [s], [mrad], [-]"""
RUNNING = 2


@dataclass(slots=True)
class Drive:
    """One run in the library: rows by entity, changes of state as (element, kind, state) -> times, contacts, end."""

    rows: dict[str, pd.DataFrame]
    states: dict[tuple[str, int, int], list[float]]
    contacts: set[tuple[str, str]]
    end: float


class _State(ctypes.Structure):
    """`SE_ScenarioObjectState`."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("id", "model", "control")),
        *((name, ctypes.c_double) for name in ("stamp", "x", "y", "z", "h", "p", "r")),
        ("road", ctypes.c_uint32),
        ("junction", ctypes.c_uint32),
        ("t", ctypes.c_double),
        ("lane", ctypes.c_int),
        *((name, ctypes.c_double) for name in ("offset", "s", "speed")),
        ("rest", ctypes.c_double * 24),
    )


def wanted_speed(ego: str, first: float, time: float) -> tuple[float, float]:
    """Speed to drive at and how fast to change to it. [m/s], [m/s2]"""
    if ego == "changes" or time <= 1.0:
        return first, GOING
    if ego != "stops":
        return float(ego) * first, GOING
    over = START + first / BRAKING + STANDS
    return (0.0, BRAKING) if START <= time < over else (first, GOING)


def crossed(ego: str, time: float) -> float:
    """Share of the way to the next lane. [-]"""
    if ego != "changes":
        return 0.0
    there, back = ((time - start) / CROSSING for start in (START, START + CROSSING + STAYS))
    return float(0.5 * (np.cos(np.pi * np.clip(back, 0.0, 1.0)) - np.cos(np.pi * np.clip(there, 0.0, 1.0))))


def drive(library: str, scenario: str, ego_drives: str, seconds: float) -> dict[str, Any]:
    """Play in this process, which can be done once."""
    se = ctypes.CDLL(library)
    se.SE_StepDT.argtypes = [ctypes.c_double]
    se.SE_ReportObjectRoadPos.argtypes = [ctypes.c_int, ctypes.c_uint32, ctypes.c_int, ctypes.c_double, ctypes.c_double]
    se.SE_ReportObjectSpeed.argtypes = [ctypes.c_int, ctypes.c_double]
    se.SE_GetObjectName.restype = ctypes.c_char_p
    se.SE_GetSimulationTime.restype = ctypes.c_double
    se.SE_SetLogFilePath.argtypes = [ctypes.c_char_p]
    se.SE_SetLogFilePath(os.devnull.encode())
    se.SE_SetSeed(1)
    se.SE_CollisionDetection(ctypes.c_bool(True))
    states: list[tuple[str, int, int, float]] = []

    def changed(name: bytes, kind: int, state: int, path: bytes) -> None:
        states.append((f"{path.decode()}/{name.decode()}", kind, state, round(se.SE_GetSimulationTime(), 3)))

    callback = ctypes.CFUNCTYPE(None, ctypes.c_char_p, ctypes.c_int, ctypes.c_int, ctypes.c_char_p)(changed)
    se.SE_RegisterStoryBoardElementStateChangeCallback(callback)
    if se.SE_Init(scenario.encode(), 0, 0, 0, 0) != 0:
        return {"refused": True}
    one = _State()
    ids = [se.SE_GetId(k) for k in range(se.SE_GetNumberOfObjects())]
    names = {number: se.SE_GetObjectName(number).decode() for number in ids}
    ego = next((number for number in ids if names[number] == "Ego"), None)
    if ego is None:
        return {"refused": True}
    se.SE_GetObjectState(ego, ctypes.byref(one))
    s, lane, road, first = one.s, one.lane, one.road, one.speed
    x, y, heading, speed = one.x, one.y, one.h, first
    se.SE_ReportObjectRoadPos(ego, road, lane, 0.0, s + 0.1)
    se.SE_GetObjectState(ego, ctypes.byref(one))
    along = 1.0 if (one.x - x) * np.cos(heading) + (one.y - y) * np.sin(heading) >= 0.0 else -1.0
    lanes = []
    for other in (lane + 1, lane - 1) if ego_drives == "changes" else ():
        se.SE_ReportObjectRoadPos(ego, road, other, 0.0, s)
        se.SE_GetObjectState(ego, ctypes.byref(one))
        if one.lane == other and other * lane > 0:
            lanes.append((other, float(np.cos(heading) * (one.y - y) - np.sin(heading) * (one.x - x))))
    se.SE_ReportObjectRoadPos(ego, road, lane, 0.0, s)
    rows: dict[str, list[tuple[float, ...]]] = {name: [] for name in names.values() if name != "Ego"}
    contacts: set[tuple[str, str]] = set()
    k = 0
    for k in range(int(seconds / STEP)):
        target, rate = wanted_speed(ego_drives, first, k * STEP)
        speed += max(-rate * STEP, min(rate * STEP, target - speed))
        s += along * speed * STEP
        share = crossed(ego_drives, k * STEP) if lanes else 0.0
        beside, across = lanes[0] if lanes else (lane, 0.0)
        across *= along if lane < 0 else -along  # offsets count along t
        place = (beside, (share - 1.0) * across) if share > 0.5 else (lane, share * across)
        se.SE_ReportObjectRoadPos(ego, road, *place, s)
        se.SE_ReportObjectSpeed(ego, speed)
        se.SE_StepDT(STEP)
        if se.SE_GetQuitFlag() == 1:
            break
        for number in (se.SE_GetId(j) for j in range(se.SE_GetNumberOfObjects())):
            name = names.setdefault(number, se.SE_GetObjectName(number).decode())
            for j in range(se.SE_GetObjectNumberOfCollisions(number)):
                other = se.SE_GetObjectCollision(number, j)
                contacts.add(tuple(sorted((name, names.get(other, "")))))  # type: ignore[arg-type]
            if number != ego:
                se.SE_GetObjectState(number, ctypes.byref(one))
                row = (k * STEP, one.x, one.y, one.h, one.speed, one.lane, one.offset)
                rows.setdefault(name, []).append(row)
    return {"rows": rows, "states": states, "contacts": sorted(contacts), "end": k * STEP}


def driven(library: Path, scenario: Path, ego: str, seconds: float) -> Drive | None:
    """Play in a process of its own; None where the player can't."""
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / "drive.json"
        # Forked: what is imported here needs no time there.
        child = get_context("fork").Process(target=_drive, args=(library, scenario, ego, seconds, found))
        child.start()
        child.join()
        played = json.loads(found.read_text()) if found.is_file() else {"refused": True}
    if "refused" in played:
        return None
    columns = ["time", "x", "y", "h", "speed", "lane", "offset"]
    states: dict[tuple[str, int, int], list[float]] = {}
    for name, kind, state, time in played["states"]:
        states.setdefault((name, kind, state), []).append(time)
    rows = {name: pd.DataFrame(one, columns=columns) for name, one in played["rows"].items() if one}
    return Drive(rows, states, {(a, b) for a, b in played["contacts"]}, played["end"])


def _drive(library: Path, scenario: Path, ego: str, seconds: float, found: Path) -> None:
    os.chdir(found.parent)  # the player writes files where it is
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    found.write_text(json.dumps(drive(str(library), str(scenario), ego, seconds)))


@dataclass(slots=True)
class Measured:
    """One scenario under one ego, or why it is apart."""

    scenario: str
    ego: str
    late_s: float = 0.0
    lost: int = 0
    kick_mrad: float = 0.0
    moves: float = 1.0
    contacts: int = 0
    along_m: float = 0.0
    slow_mrad: float = 0.0
    what: list[str] = field(default_factory=list)
    apart: str = ""

    def row(self) -> str:
        """For people."""
        if self.apart:
            return f"{self.scenario[:52]:52} {self.apart}"
        numbers = f"{self.late_s:6.3f} s {self.lost:3d} lost {self.kick_mrad:6.2f} mrad {self.moves:5.2f} moves"
        more = f"{self.contacts} contacts {self.along_m:5.3f} m {self.slow_mrad:5.1f} mrad slow"
        return f"{self.scenario[:52]:52} {self.ego:7} {numbers} {more} {'; '.join(self.what)}"


def lateral_spans(scenario: Path, played: Drive, parameters: Mapping[str, str]) -> dict[str, list[Span]]:
    """When a source's own lateral actions run, by entity."""
    values = {
        item.get("name"): item.get("value") for item in etree.parse(str(scenario)).iter("{*}ParameterDeclaration")
    }
    values |= parameters
    found: dict[str, list[Span]] = {}
    for name, action, actors in actions(scenario):
        if not any(action.find(f".//{{*}}{tag}") is not None for tag in LATERAL):
            continue
        for (path, kind, state), starts in played.states.items():
            if kind != 7 or state != RUNNING or path.rpartition("/")[2] != name:
                continue
            ends = played.states.get((path, kind, 3), [])
            for start in starts:
                end = min((one for one in ends if one >= start), default=np.inf)
                for actor in actors:
                    actor = values.get(actor.lstrip("$"), actor) if actor.startswith("$") else actor
                    found.setdefault(str(actor), []).append((start - 0.05, end + 0.05))
    return found


def moving_share(rows: pd.DataFrame, own: Sequence[Span]) -> tuple[float, float]:
    """Share of the road-following time in which a car moves in its lane, and that time. [-], [s]"""
    time, offset = rows["time"].to_numpy(), rows["offset"].to_numpy()
    follows = (rows["speed"].to_numpy() >= MINIMUM_SPEED - 1e-3) & ~within(time, own)
    cut = np.flatnonzero(np.diff(follows.astype(int)) | (np.diff(rows["lane"]) != 0) | (np.abs(np.diff(offset)) > 0.3))
    moves = total = 0
    for part in np.split(np.arange(len(time)), cut + 1):
        if len(part) and follows[part[0]]:
            width = min(round(WINDOW / STEP), len(part))
            around = pd.Series(offset[part]).rolling(width, center=True, min_periods=width // 2 + 1)
            moves += int((around.max() - around.min() > MOVED * width / round(WINDOW / STEP)).sum())
            total += len(part)
    return (moves / total if total else 1.0), total * STEP


def compare(
    result: Measured,
    source: Path,
    output: Path,
    before: Drive,
    after: Drive,
    spans: Mapping[str, Sequence[Span]],
    exempt: set[str],
) -> None:
    """Fill in what differs."""
    there = {item.get("name") for item in etree.parse(str(output)).iter() if isinstance(item.tag, str)}
    due = min(before.end, after.end) - LATE
    for key in sorted(before.states.keys() | after.states.keys()):
        name = key[0].rpartition("/")[2]
        if OURS in key[0] or name not in there:
            continue
        then, now = before.states.get(key, []), after.states.get(key, [])
        for a, b in zip(then, now, strict=False):
            if abs(a - b) > result.late_s:
                result.late_s = abs(a - b)
                if result.late_s > LATE:
                    result.what.append(f"{name} {a:.2f} -> {b:.2f} s")
        more = [time for time in (then[len(now) :] or now[len(then) :]) if time < due]
        result.lost += len(more)
        result.what += [f"{name} ({key[1]}, {key[2]}) at {time:.2f} s: {len(then)} -> {len(now)}" for time in more]
    if abs(before.end - after.end) > max(LATE, result.late_s):
        result.late_s = abs(before.end - after.end)
        result.what.append(f"the end {before.end:.2f} -> {after.end:.2f} s")
    for name, rows in after.rows.items():
        if name not in before.rows:
            continue
        old = before.rows[name]
        last = min(old["time"].iloc[-1], rows["time"].iloc[-1])
        lanes = [one["lane"][one["time"] <= last + 1e-6].iloc[-1] for one in (old, rows)]
        if lanes[0] != lanes[1]:
            result.lost += 1
            result.what.append(f"{name} ends in lane {lanes[1]}, not {lanes[0]}")
        time, turn = sharpest(rows, [old], by_path=False)
        worst = int(np.argmax(turn)) if len(turn) else 0
        if len(turn) and 1e3 * turn[worst] > result.kick_mrad:
            result.kick_mrad = 1e3 * float(turn[worst])
            if result.kick_mrad > KICK:
                result.what.append(f"kick of {name} {result.kick_mrad:.2f} at {time[worst]:.2f} s")
        n = min(len(old), len(rows))
        plain, lively = old.iloc[:n], rows.iloc[:n]
        dx, dy, heading = lively["x"] - plain["x"], lively["y"] - plain["y"], plain["h"]
        beside = dy * np.cos(heading) - dx * np.sin(heading)
        bend = np.diff(np.unwrap(heading), prepend=heading.iloc[:1])
        ahead = dx * np.cos(heading) + dy * np.sin(heading) - np.cumsum(beside * bend)
        turned = np.abs(np.angle(np.exp(1j * (lively["h"] - heading))))
        slow = (plain["speed"] < SLOW) & (lively["speed"] < SLOW)
        result.along_m = max(result.along_m, float(ahead.abs().max()))
        result.slow_mrad = max(result.slow_mrad, 1e3 * float(turned[slow.to_numpy()].max(initial=0.0)))
        share, total = moving_share(rows, spans.get(name, ()))
        if total > 1.0 and name not in exempt and share < result.moves:
            result.moves = share
            if share < MOVES:
                result.what.append(f"{name} moves {share:.2f} of {total:.1f} s")
    new = after.contacts - before.contacts
    result.contacts = len(new)
    result.what += [f"contact {a} {b}" for a, b in sorted(new)]


def measure(
    source: Path, name: str, folder: Path, options: argparse.Namespace, parameters: Mapping[str, str]
) -> Iterator[Measured]:
    """Convert one scenario, and compare it under all egos."""
    output = folder / f"{name.replace('/', '_')}.xosc"
    if driven(options.library, source, "1.0", 0.1) is None:
        yield Measured(name, "1.0", apart="not played by the player, or no Ego")
        return
    try:
        made = xl.convert(
            source, output, ego=["Ego"], seed=options.seed, allow=options.allowed, force=True, mode=options.mode,
        )  # fmt: skip
    except xl.XoscLateralError as error:
        yield Measured(name, "1.0", apart=f"refused: {' '.join(str(error).split())[-150:]}")
        return
    said = [
        line for line in made.warnings if "stays as it is" in line or "with the offsets" in line or "times what" in line
    ]
    left = {line.split("'")[1] for line in said if "stays as it is" in line}
    kinds = {item["name"] for item in made.to_dict()["entities"] if item.get("category") in ("pedestrian", "misc")}
    trees = etree.parse(str(source)).iter("{*}ScenarioObject")
    kinds |= {
        item.get("name")
        for item in trees
        if item.find("{*}Pedestrian") is not None or item.find("{*}MiscObject") is not None
    }
    for ego in options.ego or EGOS:
        before, after = (driven(options.library, one, ego, options.seconds) for one in (source, output))
        result = Measured(name, ego, what=said if ego == (options.ego or EGOS)[0] else [])
        if before is None or after is None:
            result.apart = "the player can't play " + ("the source" if before is None else "the output")
        else:
            compare(result, source, output, before, after, lateral_spans(source, before, parameters), left | kinds)
        yield result


def chosen(options: argparse.Namespace, folder: Path) -> Iterator[tuple[str, Path]]:
    """Scenarios with an Ego."""
    paths = [
        path for place in options.places for path in (sorted(place.rglob("*.xosc")) if place.is_dir() else [place])
    ]
    for path in paths:
        text = path.read_text(encoding="utf-8", errors="replace")
        if 'name="Ego"' in text and "<Storyboard" in text:
            yield path.stem if path.stem != "scenario" else path.parent.name, path
    for name, road, scenario in reactive_scenarios() if options.made else ():
        own = folder / "made" / name.replace(" ", "_")
        own.mkdir(parents=True)
        (own / "road.xodr").write_text(road)
        (own / "scenario.xosc").write_text(scenario)
        yield name, own / "scenario.xosc"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", type=Path, nargs="*", metavar="SCENARIO_OR_FOLDER")
    parser.add_argument("--made", action="store_true", help="those of tests.kit.made.reactive, too")
    parser.add_argument("--library", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--mode", default="auto")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--ego", action="append", help="a factor, stops or changes")
    parser.add_argument("--keep", type=Path, help="folder for the outputs")
    parser.add_argument("--csv", type=Path)
    options = parser.parse_args()
    options.library = options.library.resolve()
    options.allowed = [(place if place.is_dir() else place.parent).resolve().parents[0] for place in options.places]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        where = options.keep or Path(folder)
        where.mkdir(exist_ok=True, parents=True)
        for name, path in chosen(options, Path(folder)):
            for one in measure(path.resolve(), name, where.resolve(), options, {}):
                print(one.row(), flush=True)
                rows.append(one)
    table = pd.DataFrame([asdict(one) for one in rows])
    if options.csv is not None:
        table.to_csv(options.csv, index=False)
    table = table[table["apart"] == ""]
    asked = {
        "events, stop, last lanes": (table["late_s"] <= LATE + 1e-9) & (table["lost"] == 0),
        "no kick above 1 mrad": table["kick_mrad"] <= KICK,
        "moves 90 % of the time": table["moves"] >= MOVES,
        "no new contact": table["contacts"] == 0,
        "along the road within 5 cm if no event is late": (table["along_m"] <= ALONG) | (table["late_s"] > 0.5 * STEP),
        "below 2 m/s turned by at most 10 mrad": table["slow_mrad"] <= 10.0,
    }
    for title, kept in asked.items():
        whole = kept.groupby(table["scenario"]).all()
        print(f"{title}: {kept.sum()} of {len(kept)} runs, {whole.sum()} of {len(whole)} scenarios")


if __name__ == "__main__":
    main()
