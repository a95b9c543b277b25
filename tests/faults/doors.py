"""Mutants of what running simulations say, line by line: one answer each, and nothing changed by what is refused."""

from __future__ import annotations

import json
import math
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tests.faults.attack import Count, Fault
from tests.faults.mutants import HOSTILE_NUMBERS, HOSTILE_WORDS, Rng, mutate
from tests.faults.structured import mutate_structure
from tests.kit.motion import two_roads
from tests.kit.sumo_run import write_run
from xosc_lateral.base.errors import SimulationError
from xosc_lateral.drivers.model.stream import sealed
from xosc_lateral.extras.live.export import export_fmu
from xosc_lateral.extras.live.stdio import Pipe
from xosc_lateral.extras.live.sumo import SumoTraffic, start
from xosc_lateral.extras.live.traffic import FORMAT, Moment, Traffic
from xosc_lateral.files.profiles import read_profile

SLOW = 20.0
"""A line that takes longer hangs a bench. [s]"""

ODD = (math.nan, math.inf, -math.inf, -0.0, 1e308, -1e308, 1e-308, 1e9, 1e5, -1.0, 0.0, 500.0, 2.0**63, 1e400)


def attack_pipe(count: int, seed: int, folder: Path, tally: Count) -> Iterator[Fault]:
    """So many lines, good and bad in turn, to one pipe without a road and one with."""
    folder.mkdir(parents=True, exist_ok=True)
    road = two_roads(folder).path
    for number, pipe in enumerate((Pipe(read_profile("motorway"), seed=1), Pipe(read_profile("motorway"), road=road))):
        for k in range(count // 2):
            words = (seed, number, k)
            rng = np.random.default_rng(words)
            line = _line(pipe, rng)
            if what := _answered(pipe, line, tally):
                yield Fault("pipe", f"{number}.jsonl", words, what, line)


def _line(pipe: Pipe, rng: Rng) -> bytes:
    at = (pipe.traffic._time or 0.0) + 0.05
    vehicles: dict[str, dict[str, Any]] = {}
    for name in ("a", "b", "c", "d")[int(rng.integers(4)) :]:
        vehicles[name] = {"speed": 30.0, "lane_width": 3.5, "offset": 0.1, "following": True, "left_distance": 40.0}
        if pipe.network is not None:
            vehicles[name] |= {"road": "a", "lane": -1, "s": 50.0 + 20.0 * len(vehicles), "length": 4.5}
    good: dict[str, Any] = {"time": at, "vehicles": vehicles}
    kind = rng.random()
    if kind < 0.15:
        good = {"restore": pipe.traffic.to_dict()}
        if kind < 0.1:
            good = json.loads(mutate_structure(json.dumps(good).encode(), rng))
            if isinstance(good, dict) and isinstance(good.get("restore"), dict) and kind < 0.07:
                values = {key: value for key, value in good["restore"].items() if key != "sha256"}
                good["restore"] = sealed(values, FORMAT)  # by who knows how
        return json.dumps(good).encode()
    line = json.dumps(good).encode()
    if kind < 0.5:
        return line
    return (mutate_structure if kind < 0.85 else mutate)(line, rng).replace(b"\n", b" ")


def _answered(pipe: Pipe, line: bytes, tally: Count) -> str:
    before, begin = json.dumps(pipe.traffic.to_dict()), time.monotonic()
    try:
        answers = list(pipe.answers([line]))
    except Exception as error:
        return f"raises {error!r}"
    if (seconds := time.monotonic() - begin) > SLOW:
        return f"takes {seconds:.0f} s"
    if len(answers) != bool(line.strip()) or any("\n" in answer for answer in answers):
        return f"is answered by {answers}"
    if answers and "error" in json.loads(answers[0]):
        tally.refused += 1
        return "" if json.dumps(pipe.traffic.to_dict()) == before else f"changes the state: {answers[0]}"
    tally.accepted += 1
    return ""


def attack_traffic(count: int, seed: int, folder: Path, tally: Count) -> Iterator[Fault]:
    """So many moments, good and bad in turn, as a simulation's own loop hands them over."""
    traffic = Traffic(read_profile("motorway"), seed=1)
    for k in range(count):
        words = (seed, k)
        rng = np.random.default_rng(words)
        moment, at = _moment(rng), (traffic._time or 0.0) + 0.05
        if rng.random() < 0.1:
            at = float(rng.choice(ODD))
        before = json.dumps(traffic.to_dict())
        try:
            moves = traffic.step(at, moment)
        except (SimulationError, ValueError) as error:
            tally.refused += 1
            changed = json.dumps(traffic.to_dict()) != before
            what = f"changes the state: {error}" if changed else f"more than a line: {error}" * ("\n" in str(error))
        except Exception as error:
            what = f"raises {error!r}"
        else:
            tally.accepted += 1
            what = "" if all(np.isfinite(one).all() for one in moves) else f"gives {moves}"
        if what:
            yield Fault("traffic", "moment.txt", words, what, f"{at} {moment}".encode())


def _moment(rng: Rng) -> Moment:
    n = int(rng.integers(5))
    columns: dict[str, Any] = {"speed": np.full(n, 30.0), "lane_width": np.full(n, 3.5), "offset": np.zeros(n)}
    flags: dict[str, Any] = {name: rng.random(n) < 0.8 for name in ("following", "driven", "is_truck")}
    context = {"left_distance": np.full(n, 30.0), "curvature": np.zeros(n)}
    if rng.random() < 0.4:
        holder = (columns, context)[int(rng.integers(2))]
        name = list(holder)[int(rng.integers(len(holder)))]
        holder[name] = holder[name].copy()
        holder[name][: int(rng.integers(n + 1))] = rng.choice(ODD)
    if rng.random() < 0.1:
        columns["speed"] = columns["speed"][:-1]
    names = ["a", "b", "c", str(rng.choice([*HOSTILE_WORDS[:9], *HOSTILE_NUMBERS[:5]]))]
    rng.shuffle(names)
    return Moment(tuple(names[:n]), **columns, **flags, context=context)


def attack_fmu(count: int, seed: int, folder: Path, tally: Count) -> Iterator[Fault]:
    """So many inputs and steps of a unit, good and bad in turn; after a refusal the next good step goes on."""
    import fmpy

    unit, at = folder / "driver.fmu", 0.0
    folder.mkdir(parents=True, exist_ok=True)
    if not export_fmu(read_profile("motorway"), unit):
        return
    described = fmpy.read_model_description(str(unit))
    one = fmpy.instantiate_fmu(fmpy.extract(str(unit), str(folder / "unit")), described, "CoSimulation")
    numbers = [v for v in described.modelVariables if v.causality == "input" and v.type == "Real"]
    usual = {v.name: float(v.start) for v in numbers}
    outputs = [v.valueReference for v in described.modelVariables if v.causality == "output" and v.type == "Real"]
    one.setupExperiment()
    one.enterInitializationMode()
    one.exitInitializationMode()
    for k in range(count):
        words = (seed, k)
        rng = np.random.default_rng(words)
        given, length = dict(usual), 0.05
        if rng.random() < 0.4:
            given[str(rng.choice(list(usual)))] = float(rng.choice(ODD))
            length = float(rng.choice([*ODD, 0.05, 0.05]))
        one.setReal([v.valueReference for v in numbers], [given[v.name] for v in numbers])
        before = one.getReal(outputs)
        try:
            one.doStep(currentCommunicationPoint=at, communicationStepSize=length)
        except fmpy.fmi1.FMICallException:
            tally.refused += 1
            what = "changes its outputs" if one.getReal(outputs) != before else ""
            what = "refuses what is usual" if given == usual and length == 0.05 else what
        else:
            tally.accepted, at = tally.accepted + 1, at + length
            what = "" if np.isfinite(one.getReal(outputs)).all() else "gives no numbers"
        if what:
            yield Fault("fmu", "step.txt", words, what, f"{at} {length} {given}".encode())


class _Lying:
    """SUMO, some of whose vehicles say odd numbers now and then, vanish, or sit on lanes that are not there."""

    def __init__(self, connection: Any) -> None:
        self.connection, self.vehicle, self.rng = connection, self, np.random.default_rng(0)

    def __getattr__(self, name: str) -> Any:
        ask = getattr(self.connection if hasattr(self.connection, name) else self.connection.vehicle, name)
        if name not in ("getSpeed", "getLanePosition", "getLateralLanePosition", "getAngle", "getLaneID", "getIDList"):
            return ask
        return lambda *words: self._said(name, ask(*words))

    def _said(self, name: str, said: Any) -> Any:
        if self.rng.random() > 0.02:
            return said
        return said[:-1] if name == "getIDList" else "nowhere_0" if name == "getLaneID" else float(self.rng.choice(ODD))


def attack_sumo(count: int, seed: int, folder: Path, tally: Count) -> Iterator[Fault]:
    """So many steps of a SUMO that does not always say the truth."""
    folder.mkdir(parents=True, exist_ok=True)
    lying = _Lying(start(["-c", str(write_run(folder, end=0.1 * count + 10.0, cars=1800))]))
    traffic = SumoTraffic(lying, read_profile("motorway"), seed=1)
    for k in range(count):
        lying.rng = np.random.default_rng((seed, k))
        before, what = json.dumps(traffic.traffic.to_dict()), ""
        try:
            traffic.steer()
            tally.accepted += 1
        except SimulationError as error:
            tally.refused += 1
            what = "" if json.dumps(traffic.traffic.to_dict()) == before else f"changes the state: {error}"
        except Exception as error:
            what = f"raises {error!r}"
        lying.connection.simulationStep()
        if what:
            yield Fault("sumo", "step.txt", (seed, k), what, b"")
    lying.connection.close()


NEEDS = {"fmu": ("fmpy",), "sumo": ("libsumo", "sumo")}
"""Packages that a door needs."""

DOORS: dict[str, Callable[[int, int, Path, Count], Iterator[Fault]]] = {
    "pipe": attack_pipe, "traffic": attack_traffic, "fmu": attack_fmu, "sumo": attack_sumo,
}  # fmt: skip


def attack_door(name: str, count: int, seed: int, folder: Path, tally: Count) -> Iterator[Fault]:
    """So many lines at one of the doors; a warning on standard error counts as a fault."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore" if name in NEEDS else "error")  # of foreign packages
        yield from DOORS[name](count, seed, folder, tally)
