"""Scenarios from seeds, in the reference player or in our own: the output against the source, our player against it."""

from __future__ import annotations

import copy
import random
import re
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import xosc_lateral as xl
from laboratory.find import judge, player
from laboratory.find.engine import Finding, Spec
from tests.kit.generated import strategies, write

Run = dict[str, Any]
Plant = Callable[[Run], Run]


def converted(path: Path, output: Path, how: dict[str, Any]) -> Run:
    """Who was moved, what was said, and which events are still there."""
    made = xl.convert(path, output, ego=["Ego"], force=True, **how)
    there = re.findall(r'<Event name="(\w+)"', output.read_text())
    messages = [(one.entity, str(one)) for one in made.messages]
    return {
        "moved": [one.name for one in made.movement.entities if one.is_enriched],
        "messages": messages,
        "there": there,
    }


def refusal(stage: str, error: str) -> Finding:
    """Its kind: without names, numbers and paths."""
    kind = "refused: " + re.sub(r"\S*/\S+|'[^']*'|-?\d+(\.\d+)?", "#", error)[:110]
    return {"stage": stage, "kind": kind, "context": "", "who": "", "t": 0.0, "size": 0.0, "text": error[:400]}


class Scenarios:
    """Scenarios with few vehicles and a road; `library`: of the reference player, without it our own plays."""

    name = "scenarios"

    def __init__(self, library: str | None = None) -> None:
        self.library, self._is_warm = library, False

    def _warm(self) -> None:
        """Whatever is loaded and compiled at first use, once, for all processes that fork from this one."""
        if not self._is_warm:
            self._is_warm = True
            with tempfile.TemporaryDirectory() as name:
                path = write.files(self.make(random.Random(2)), Path(name))
                player.here(path, 5.0)
                converted(path, Path(name) / "out.xosc", {"mode": "auto"})

    def make(self, draw: random.Random) -> Spec:
        return strategies.scenario(draw)

    def play(self, path: Path, seconds: float, *driven: Any) -> Run:
        """One run as data; in a process of its own, since a library keeps what it has played."""
        if self.library is None:
            return player.here(path, seconds)
        return player.apart(player.run, self.library, path, seconds, *driven)

    def look(self, spec: Spec, only: Finding | None = None) -> list[Finding]:
        """All that is wrong; `only`: in the stage and under the ego of a finding, while shrinking."""
        self._warm()
        how, end, out = spec["convert"], spec["end"] + 2, list[Finding]()
        stage = how["mode"] + (" lifelike" if "lane_changes" in how else "")
        with tempfile.TemporaryDirectory() as name:
            path, output = write.files(spec, Path(name)), Path(name) / "out.xosc"
            nominal = self.play(path, end)
            if "error" in nominal:
                return [refusal("input", nominal["error"])]
            if self.library and (only is None or only["stage"] == "play"):
                ours = player.apart(player.here, path, end)
                if "error" in ours:
                    out.append(refusal("play", ours["error"]))
                else:
                    found = judge.plays(spec, ours, nominal)
                    out += [{"stage": "play", "said": judge.told(one, ours["messages"]), **one} for one in found]
            if only is not None and only["stage"] == "play":
                return out
            made = player.apart(converted, path, output, how)
            if "error" in made:
                return [*out, refusal(stage, made["error"])]
            egos = ["nominal", *(spec["egos"] if self.library and how["mode"] == "auto" else ())]
            for ego in egos if only is None else [only.get("ego", "nominal")]:
                runs = [nominal, self.play(output, end)] if ego == "nominal" else self._driven(spec, path, output, ego)
                if wrong := next((one["error"] for one in runs if "error" in one), None):
                    out.append({**refusal(stage, wrong), "ego": ego})
                    continue
                replay = self._replay(path, how, end) if how["mode"] == "auto" and ego == "nominal" else None
                found = judge.compares(spec, *runs, made["moved"], made["there"], replay)
                out += [
                    {"stage": stage, "ego": ego, **one, "said": judge.told({"ego": ego, **one}, made["messages"])}
                    for one in found
                ]
        return out

    def _driven(self, spec: Spec, path: Path, output: Path, ego: str) -> list[Run]:
        """Source and output while Ego is driven in the player, along where it drives alone."""
        first = spec["vehicles"][0]
        alone = {**spec, "vehicles": [{**first, "v": max(5.0, 1.35 * first["v"])}], "events": []}
        (path.parent / "alone").mkdir(exist_ok=True)
        probe = self.play(write.files(alone, path.parent / "alone"), spec["end"] + 2)
        if "error" in probe:
            return [probe]
        way = player.ego_path(probe, first["v"])
        return [self.play(one, spec["end"] + 2, ego, way, spec["convert"]["seed"]) for one in (path, output)]

    def _replay(self, path: Path, how: dict[str, Any], end: float) -> Callable[[str], Any]:
        """Of a vehicle: its rows where the same seed is written as trajectories."""

        @cache
        def replayed() -> Run:
            output = path.parent / "replay.xosc"
            made = player.apart(converted, path, output, {"mode": "trajectory", "seed": how["seed"]})
            return made if "error" in made else self.play(output, end)

        return lambda who: replayed().get("rows", {}).get(who)

    def size(self, spec: Spec) -> float:
        done = sum(len(event["do"]) for event in spec["events"])
        return 3 * len(spec["vehicles"]) + 2 * len(spec["events"]) + done + len(spec["road"]) / 10 + spec["end"] / 100

    def save(self, spec: Spec, folder: Path) -> None:
        write.files(spec, folder)

    def smaller(self, spec: Spec) -> Iterator[Spec]:
        """With less in them, the boldest first."""
        for one in [*spec["vehicles"][1:], *spec["events"][::-1]]:
            yield _without(spec, {one["name"]})
        for i, event in enumerate(spec["events"]):
            for k in range(len(event["do"]) if len(event["do"]) > 1 else 0):
                one = copy.deepcopy(spec)
                del one["events"][i]["do"][k]
                yield one
            if event["when"] != [[["time", 1.0]]]:
                one = copy.deepcopy(spec)
                one["events"][i] |= {"when": [[["time", 1.0]]], "delay": 0, "edge": "none"}
                yield one
        for i, vehicle in enumerate(spec["vehicles"]):
            if vehicle["class"] != "car" or vehicle.get("off"):
                one = copy.deepcopy(spec)
                one["vehicles"][i] |= {"class": "car", "off": 0}
                yield one
        for name in ("slope", "tilt", "radius", "left"):
            if spec["road"].get(name) and spec["road"]["kind"] == "plain":
                yield {**spec, "road": {key: value for key, value in spec["road"].items() if key != name}}
        for end in (10, 15):
            if end < spec["end"]:
                yield {**spec, "end": end}


class Planted(Scenarios):
    """A source against itself in our own player, with something wrong planted into the second run, or nothing."""

    def __init__(self, plant: Plant | None = None, messages: tuple[tuple[str, str], ...] = ()) -> None:
        super().__init__()
        self.plant, self.messages = plant, messages

    def look(self, spec: Spec, only: Finding | None = None) -> list[Finding]:
        with tempfile.TemporaryDirectory() as name:
            run = player.here(write.files(spec, Path(name)), spec["end"] + 2)
        again = copy.deepcopy(run)
        again = self.plant(again) if self.plant else again
        there, moved = [event["name"] for event in spec["events"]], [one["name"] for one in spec["vehicles"][1:]]
        found = judge.compares(spec, run, again, moved, there, replay=run["rows"].get)
        found = [one for one in found if not one["kind"].startswith("rests")]  # nobody moves beside his way in either
        return [{"stage": "planted", **one, "said": judge.told(one, self.messages)} for one in found]


def _names(value: Any) -> set[str]:
    if isinstance(value, str):
        return {value}
    inside = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return set[str]().union(*map(_names, inside))


def _without(spec: Spec, gone: set[str]) -> Spec:
    """What refers to what is gone goes, too."""
    one = copy.deepcopy(spec)
    one["vehicles"] = [
        vehicle for vehicle in one["vehicles"] if not ({vehicle["name"]} | _names(vehicle.get("init"))) & gone
    ]
    gone = gone | {vehicle["name"] for vehicle in spec["vehicles"]} - {vehicle["name"] for vehicle in one["vehicles"]}
    while True:
        left = [event for event in one["events"]
                if not ({event["name"]} | _names([event["of"], event["do"], event["when"]])) & gone]  # fmt: skip
        gone |= {event["name"] for event in one["events"]} - {event["name"] for event in left}
        if len(left) == len(one["events"]):
            return one
        one["events"] = left
