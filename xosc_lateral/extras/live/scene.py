"""What ran in somebody else's simulation, as a motion that our own outputs take: its vehicles, its road, its rows."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from xosc_lateral.base.errors import SimulationError
from xosc_lateral.base.track import KNOWN
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.world.motion.nominal import MOTION, Activity, EntityMotion, MovingTraffic
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.entity import BoundingBox, Entity
from xosc_lateral.world.scenario.enums import EntityCategory, VehicleCategory
from xosc_lateral.world.scenario.place import Place

if TYPE_CHECKING:
    import pandas as pd

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
