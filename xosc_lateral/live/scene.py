"""What ran in somebody else's simulation, as a motion that our own outputs take: its vehicles, its road, its rows."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.errors import SimulationError
from xosc_lateral.formats.opendrive import read_opendrive
from xosc_lateral.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.road.network import RoadNetwork
from xosc_lateral.scenario.entity import BoundingBox, Entity
from xosc_lateral.scenario.enums import EntityCategory, VehicleCategory
from xosc_lateral.scenario.place import Place

KINDS = {
    "bicycle": VehicleCategory.BICYCLE, "bus": VehicleCategory.BUS, "coach": VehicleCategory.BUS,
    "delivery": VehicleCategory.VAN, "motorcycle": VehicleCategory.MOTORBIKE, "moped": VehicleCategory.MOTORBIKE,
    "trailer": VehicleCategory.TRUCK, "tram": VehicleCategory.TRAM, "truck": VehicleCategory.TRUCK,
}  # fmt: skip
"""Vehicle class of SUMO -> category of OpenSCENARIO; a car for the rest. SUMO's ``trailer`` is a truck with one."""


@dataclass(frozen=True, slots=True)
class Scene:
    """Who was there, and where.

    Parameters
    ----------
    entities : sequence of Entity
    network : callable
        Reads the road.
    ego : sequence of str
        Vehicles under test.
    is_road : bool
        Rows have road and lane by the ids of the network; else they are found from positions.
    """

    entities: Sequence[Entity]
    network: Callable[[], RoadNetwork]
    ego: Sequence[str] = ()
    is_road: bool = True


def motion_of(rows: Sequence[tuple[Any, ...]], scene: Scene, network: RoadNetwork) -> NominalMotion:
    """The rows of a `LiveRun` by vehicle and time; a vehicle is active where there is a row of it."""
    times = np.unique([row[0] for row in rows])
    of: dict[str, list[tuple[Any, ...]]] = {entity.name: [] for entity in scene.entities}
    for row in rows:
        if row[1] in of:
            of[row[1]].append(row)
    index = {name: k for k, name in enumerate(network.road_ids)}
    found = []
    for entity in scene.entities:
        own = of[entity.name]
        at = np.searchsorted(times, [row[0] for row in own])
        poses = np.array([[row[k] for k in (2, 3, 12, 4, 13, 14, 5, 8, 9)] for row in own]).reshape(-1, 9)
        places = np.array([(index.get(str(row[6]), -1), row[7]) for row in own], dtype=np.int32).reshape(-1, 2)
        if own and not scene.is_road:
            there = network.world_to_lane(*poses[:, :4].T)
            places, poses[:, 7] = np.stack([there.road, there.lane], axis=1), there.s
        columns, lanes = np.zeros((9, len(times))), np.zeros((2, len(times)), dtype=np.int32)
        columns[:, at], lanes[:, at] = poses.T, places.T
        is_there = np.zeros(len(times), dtype=np.uint8)
        is_there[at] = int(Activity.ACTIVE)
        x, y, z, heading, pitch, roll, speed, s, offset = columns
        road, lane = lanes
        found.append(
            EntityMotion(entity, times, x, y, z, heading, pitch, roll, speed, road, lane, s, offset,
                         np.zeros(len(times)), is_there)
        )  # fmt: skip
    step = float(times[1] - times[0]) if len(times) > 1 else 0.0
    return NominalMotion(step, tuple(found), (), float(times[-1]) if len(times) else 0.0, "simulation", ())


def sumo_entity(vehicles: Any, name: str) -> Entity:
    """A vehicle of SUMO, whose positions are those of the middle of its front."""
    length, width, height = (float(getattr(vehicles, f"get{what}")(name)) for what in ("Length", "Width", "Height"))
    return Entity(
        name, EntityCategory.VEHICLE, Place("", None, "vehicle"),
        BoundingBox(-0.5 * length, 0.0, 0.5 * height, length, width, height),
        KINDS.get(vehicles.getVehicleClass(name), VehicleCategory.CAR),
    )  # fmt: skip


def sumo_network(net: str) -> RoadNetwork:
    """The road of a SUMO network, by SUMO's own ``netconvert``.

    Raises
    ------
    SimulationError
        If that is not there, or can't.
    """
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
