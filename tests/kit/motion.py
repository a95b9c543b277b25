"""Roads and motions made by hand, so that segments, context and trajectories are tested apart from the player."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.world.motion.nominal import MOTION, Activity, EntityMotion, NominalMotion, PlayedAction, made_vehicle
from xosc_lateral.world.motion.trajectory import distance_driven
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.entity import BoundingBox, Entity
from xosc_lateral.world.scenario.enums import EntityCategory, VehicleCategory
from xosc_lateral.world.scenario.place import Place
from xosc_lateral.world.surroundings.context import Surroundings

LANE_WIDTH = 3.5
RADIUS = 400.0
STEP = 0.02

_XODR = """<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="6"/>
{roads}
</OpenDRIVE>"""

_ROAD = """<road id="{id}" length="{length}" junction="-1" rule="{rule}">
<link>{link}</link>
<planView>{plan}</planView>
<lanes><laneSection s="0"><left>{left}</left><center><lane id="0" type="none"/></center><right>{right}</right>
</laneSection></lanes></road>"""


def _lanes(ids: range) -> str:
    links = '<link><predecessor id="{0}"/><successor id="{0}"/></link>'
    return "".join(
        f'<lane id="{k}" type="driving">{links.format(k)}<width sOffset="0" a="{LANE_WIDTH}" b="0" c="0" d="0"/></lane>'
        for k in ids
    )


def _road(name: str, rule: str, plan: str, length: float, link: str) -> str:
    return _ROAD.format(
        id=name,
        length=length,
        rule=rule,
        plan=plan,
        link=link,
        left=_lanes(range(3, 0, -1)),
        right=_lanes(range(-1, -4, -1)),
    )


def two_roads(folder: Path, *, rule: str = "RHT") -> RoadNetwork:
    """Road "a": 500 m straight along x; road "b": 600 m left arc from there on. Three lanes each way."""
    straight = '<geometry s="0" x="0" y="0" hdg="0" length="500"><line/></geometry>'
    arc = f'<geometry s="0" x="500" y="0" hdg="0" length="600"><arc curvature="{1 / RADIUS}"/></geometry>'
    a = _road("a", rule, straight, 500, '<successor elementType="road" elementId="b" contactPoint="start"/>')
    b = _road("b", rule, arc, 600, '<predecessor elementType="road" elementId="a" contactPoint="end"/>')
    path = folder / f"two_roads_{rule}.xodr"
    path.write_text(_XODR.format(roads=a + b))
    return read_opendrive(path)


def entity(name: str = "car", category: VehicleCategory = VehicleCategory.CAR, length: float = 5.0) -> Entity:
    """A vehicle whose box is centred 1.4 m ahead of the reference point."""
    box = BoundingBox(1.4, 0.0, 0.75, length, 2.0, 1.5)
    return Entity(name, EntityCategory.VEHICLE, Place("made", 1, name), box, vehicle_category=category)


def drive(
    network: RoadNetwork,
    who: Entity,
    *,
    lane: int = -2,
    start: float = 0.0,
    speed: float | np.ndarray = 30.0,
    duration: float = 10.0,
    offset: float | np.ndarray = 0.0,
    activity: np.ndarray | None = None,
) -> EntityMotion:
    """Drive along a lane from `start` metres of travel on: road a then b, or b then a where the lane runs against s."""
    time = np.arange(round(duration / STEP) + 1) * STEP
    speed = np.broadcast_to(np.asarray(speed, dtype=float), time.shape)
    travelled = start + np.concatenate(([0.0], np.cumsum(speed[1:] * STEP)))
    forward = network.travel_direction(0, lane) > 0
    along = travelled if forward else 1100.0 - travelled
    road = np.where(along <= 500.0, 0, 1).astype(np.int32)
    s = np.where(road == 0, along, along - 500.0)
    lanes = np.full(len(time), lane, dtype=np.int32)
    offsets = np.broadcast_to(np.asarray(offset, dtype=float), time.shape).copy()
    poses = network.lane_to_world(road, lanes, s, offsets)
    if activity is None:
        activity = np.full(len(time), int(Activity.ACTIVE), dtype=np.uint8)
    columns = *(np.array(part) for part in poses), speed, road, lanes, s, offsets, np.zeros(len(time)), activity
    return EntityMotion.of(who, time, **dict(zip(MOTION, columns, strict=True)))


def box_path(
    time: np.ndarray, x: np.ndarray, y: np.ndarray, heading: np.ndarray, *box: float, name: str = "car"
) -> EntityMotion:
    """A box on its way: length, width and its centre ahead of the reference point [m]; x is NaN where it is absent."""
    return EntityMotion.of(made_vehicle(name, *box), time, x=x, y=y, heading=heading)


def together(*entities: EntityMotion, actions: tuple[PlayedAction, ...] = ()) -> NominalMotion:
    """A played scenario of these motions."""
    return NominalMotion(STEP, entities, actions, end_time=float(entities[0].time[-1]), ended_by="time limit", notes=())


__all__ = ["LANE_WIDTH", "RADIUS", "STEP", "distance_driven", "drive", "entity", "together", "two_roads"]


def entity_context(motion: NominalMotion, network: RoadNetwork, index: int, grid: IntArray) -> dict[str, FloatArray]:
    """Context of one vehicle, see `Surroundings`."""
    return Surroundings(motion, network).context(index, grid)
