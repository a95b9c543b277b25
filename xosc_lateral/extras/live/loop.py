"""A simulation with drivers in it, step by step from its start to its end, whatever simulates; and what it did."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from xosc_lateral.base.errors import SimulationError, XoscLateralError
from xosc_lateral.base.grouping import grouped
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.track import KNOWN
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.workflows.options import egos
from xosc_lateral.world.motion.nominal import MOTION, Activity, EntityMotion, MovingTraffic
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.controllers import BY_NAME, is_named_under_test
from xosc_lateral.world.scenario.entity import BoundingBox, Entity
from xosc_lateral.world.scenario.enums import EntityCategory, VehicleCategory
from xosc_lateral.world.scenario.place import Place


class UnderTest:
    """Names of vehicles that no driver of ours has.

    Parameters
    ----------
    stated : str or iterable of str, optional
        Their names; "none": there is none. Without: all that are called ego, hero, VUT and the like.
    driven : collection of str
        Vehicles with a driver of their own choice: no name puts them under test.
    """

    def __init__(self, stated: str | Iterable[str] | None, driven: Collection[str] = ()) -> None:
        words = stated if stated is None or isinstance(stated, str) else list(stated)
        self.named = frozenset[str]() if words is None else egos(words)
        self._by_name, self._driven = words is None, frozenset(driven)

    def __contains__(self, name: str) -> bool:
        return name in self.named or (self._by_name and name not in self._driven and is_named_under_test(name))

    def why(self, name: str) -> str:
        """Why one of them is under test, in words."""
        return "" if name in self.named else f" {BY_NAME} (--ego none drives everybody)"


Row = tuple[Any, ...]
"""Of one vehicle at one time, by `call.TRACE_COLUMNS`."""

Spans = Mapping[str, Collection[tuple[float, float]]]
"""From when to when actions ran, by their path in the storyboard. [s]"""

SAME_DURATION = 0.05
"""Two frames of a player at its slowest usual rate. [s]"""


class RunningSimulation(Protocol):
    """What runs, with drivers in it."""

    def time(self) -> float:
        """Now. [s]"""

    def is_over(self) -> bool:
        """Whether it has ended by itself."""

    def rows(self) -> Iterable[Row]:
        """Where everybody is now."""

    def drive(self, step: float) -> None:
        """On by a step [s], everybody in it. Raises `SimulationError`: it can't."""


def run_to_end(simulation: RunningSimulation, end: float, step: float) -> list[Row]:
    """Rows of all steps [s] until the end [s], or its own; the first are those of its start."""
    rows: list[Row] = []
    while True:
        rows.extend(simulation.rows())
        if simulation.is_over() or simulation.time() > end - 0.5 * step:
            return rows
        simulation.drive(step)


def later_actions(scenario: Path, spans: Spans, end: float) -> list[str]:
    """Lateral actions that took longer, or less long, from where a driver was than from where they would have begun.

    As the same scenario is played without drivers until its `end` [s]: one that moves at a given rate, or within an
    acceleration, takes as long as its way. A line each.
    """
    from xosc_lateral.workflows.conversion.load import play_scenario

    if not spans:
        return []
    try:
        played = play_scenario(scenario, time_limit=end).motion.actions
    except XoscLateralError as error:
        return [f"whether lateral actions end later than without drivers is not known: {' '.join(str(error).split())}"]
    durations = {"::".join(one.path): one.end - one.start for one in played if one.end is not None}
    lines = []
    for path, runs in spans.items():
        for begin, over in runs:
            usual = durations.get(path, over - begin)
            if abs(over - begin - usual) > SAME_DURATION:
                what = f"lateral action {path.rpartition('::')[2]!r} at {begin:.2f} s took {over - begin:.2f} s"
                lines.append(f"{what} from where the driver was, {usual:.2f} s without drivers")
    return lines


def not_driven(why: Mapping[str, str]) -> list[str]:
    """Vehicles that had no driver of ours, by the reason for it: a line each."""
    names = grouped((reason, repr(name)) for name, reason in why.items())
    return [f"not driven, {reason}: {', '.join(sorted(who))}" for reason, who in names.items()]


# ---- what ran, as a motion that our own outputs take: its vehicles, its road, its rows ----
CATEGORY_OF_CLASS = {
    "bicycle": VehicleCategory.BICYCLE, "bus": VehicleCategory.BUS, "coach": VehicleCategory.BUS,
    "delivery": VehicleCategory.VAN, "motorcycle": VehicleCategory.MOTORBIKE, "moped": VehicleCategory.MOTORBIKE,
    "trailer": VehicleCategory.TRUCK, "tram": VehicleCategory.TRAM, "truck": VehicleCategory.TRUCK,
}  # fmt: skip
"""Vehicle class of SUMO -> category of OpenSCENARIO; a car for the rest. SUMO's ``trailer`` is a truck with one."""


ROW_COLUMNS = ("x", "y", "z", "heading", "pitch", "roll", "speed", "s", "offset")
"""Columns that the rows of a run say."""


@dataclass(frozen=True, slots=True)
class SimulatorScene:
    """Who was there, and where."""

    entities: Sequence[Entity]
    network: Callable[[], RoadNetwork]  # reads the road
    ego: Sequence[str] = ()  # vehicles under test
    is_road: bool = True  # rows have road and lane by the ids of the network; else they are found from positions


def motion_of(rows: pd.DataFrame, scene: SimulatorScene, network: RoadNetwork) -> MovingTraffic:
    """The rows of a `LiveRun` by vehicle and time; a vehicle is active where there is a row of it."""
    times = np.unique(rows["time"])
    index = {name: k for k, name in enumerate(network.road_ids)}
    motions = []
    for entity in scene.entities:
        part = rows[rows["name"] == entity.name].rename(columns={"h": "heading"})
        seen: dict[str, Any] = {name: part[name].to_numpy(dtype=np.float64) for name in ROW_COLUMNS}
        seen["road"] = np.array([index.get(str(road), -1) for road in part["road"]], dtype=np.int32)
        seen["lane"] = part["lane"].to_numpy(dtype=np.int32)
        if scene.is_road:  # a player says inertial places, a motion those of the road's file
            seen["x"], seen["y"] = network.header_offset.undo(seen["x"], seen["y"])
            seen["z"] = seen["z"] - network.header_offset.z
            seen["heading"] = seen["heading"] - network.header_offset.heading
        elif len(part):
            there = network.world_to_lane(*(seen[name] for name in ("x", "y", "z", "heading")))
            seen |= {"road": there.road, "lane": there.lane, "s": there.s}
        on_road, relative = seen["road"] >= 0, np.zeros(len(part))
        place = (seen[name][on_road] for name in ("road", "lane", "s"))
        relative[on_road] = seen["heading"][on_road] - network.lane_to_world(*place).heading
        seen["heading_relative"] = (relative + np.pi) % (2.0 * np.pi) - np.pi
        columns = {name: np.zeros(len(times), KNOWN[name].kind) for name in MOTION}
        at = np.searchsorted(times, part["time"])
        for name, values in {**seen, "activity": int(Activity.ACTIVE)}.items():
            columns[name][at] = values
        motions.append(EntityMotion.of(entity, times, **columns))
    step = float(times[1] - times[0]) if len(times) > 1 else 0.0
    return MovingTraffic(step, tuple(motions))


def sumo_entity(vehicles: Any, name: str) -> Entity:
    """A vehicle of SUMO, whose positions are those of the middle of its front."""
    length, width, height = (float(getattr(vehicles, f"get{what}")(name)) for what in ("Length", "Width", "Height"))
    return Entity(
        name, EntityCategory.VEHICLE, Place("", None, "vehicle"),
        BoundingBox(-0.5 * length, 0.0, 0.5 * height, length, width, height),
        CATEGORY_OF_CLASS.get(vehicles.getVehicleClass(name), VehicleCategory.CAR),
    )  # fmt: skip


def sumo_network(net: str) -> RoadNetwork:
    """The road of a SUMO network, by SUMO's own ``netconvert``. Raises `SimulationError`: it is not there, or can't."""
    try:
        from sumo import SUMO_HOME

        program: str | None = str(Path(SUMO_HOME) / "bin" / "netconvert")
    except ImportError:
        program = shutil.which("netconvert")
    if program is None:
        raise SimulationError(
            "SUMO's netconvert, which gives a trace its lanes, is not there: install xosc-lateral[sumo]"
        )
    with tempfile.TemporaryDirectory() as folder:
        road = Path(folder) / f"{Path(net).name.removesuffix('.gz').removesuffix('.net.xml')}.xodr"
        words = [program, "--sumo-net-file", net, "--opendrive-output", str(road), "--output.original-names"]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise SimulationError(f"{net}: netconvert makes no OpenDRIVE of it: {' '.join(done.stderr.split())[:200]}")
        return read_opendrive(road)
