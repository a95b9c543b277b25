"""What a scenario says of each recorded vehicle: where it starts, its speed, its lateral maneuvers."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.workflows.recordings.lateral import LateralPlan, lateral_plan
from xosc_lateral.workflows.recordings.motion_fits import APART, SpeedProfile, Transition, fit_speed
from xosc_lateral.workflows.recordings.recorded import RecordedVehicle, Recording
from xosc_lateral.world.motion.nominal import Activity, EntityMotion
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.entity import BoundingBox, Entity
from xosc_lateral.world.scenario.enums import EntityCategory
from xosc_lateral.world.scenario.place import Place

FRAME = 0.1  # vehicles appear and leave at multiples of this: between two frames they would be placed off by a way [s]
ENTERED = 0.2  # so long after a recorded vehicle comes onto a road, its planned one has, too: `--error` is between [s]
PLAYED = 0.2  # share of the error's bound and the time between corners for a played track: no driver, no sensor [-]


@dataclass(frozen=True, eq=False, slots=True)
class VehiclePlan:
    """One vehicle's part in the scenario."""

    name: str  # of the entity
    vehicle: RecordedVehicle
    lateral: LateralPlan
    way: FloatArray  # along the lateral maneuvers' path, at the recorded rows, shape (n,) [m]
    speed: SpeedProfile  # from where it appears to where it leaves
    appears: float | None  # appears, leaves: None: it is there from the beginning, to the end [s]
    leaves: float | None
    # road, lane, s, direction, offset: where it starts: index of the road, OpenDRIVE lane, [m], +1 along s or -1
    # against it, and [m] from the lane's centre, positive to the left of its travel
    road: int
    lane: int
    s: float
    direction: int
    offset: float
    targets: tuple[int, ...]  # OpenDRIVE lane that each transition leads to

    @property
    def present(self) -> tuple[float, float]:
        """From when to when it is there; as recorded at the end, where it does not leave. [s]"""
        return 0.0 if self.appears is None else self.appears, float(self.vehicle.time[-1])

    def time_at(self, way: FloatArray) -> FloatArray:
        """When the recorded vehicle was as far, shape as the argument. [s]"""
        return np.interp(way, np.maximum.accumulate(self.way), self.vehicle.time)

    @property
    def changes(self) -> tuple[Transition, ...]:
        """Lane changes alone."""
        return tuple(one for one in self.lateral.transitions if one.lanes)


def plan_vehicles(recording: Recording, network: RoadNetwork, *, error: float) -> tuple[VehiclePlan, ...]:
    """Plan every vehicle, positions along the road within `error` [m]."""
    length = recording.end - recording.start
    names = entity_names(vehicle.name for vehicle in recording.vehicles)
    return tuple(
        _plan(name, vehicle, network, length, error) for name, vehicle in zip(names, recording.vehicles, strict=True)
    )


def entity_names(names: Iterable[str]) -> list[str]:
    """Names that are also those of parameters: letters, digits and underscores, no digit first, each once."""
    taken = list[str]()
    for name in names:
        plain = re.sub(r"\W", "_", name, flags=re.ASCII) or "V"
        plain = f"V{plain}" if plain[0].isdigit() else plain
        number, unique = 2, plain
        while unique in taken:
            unique, number = f"{plain}_{number}", number + 1
        taken.append(unique)
    return taken


def _plan(name: str, vehicle: RecordedVehicle, network: RoadNetwork, length: float, error: float) -> VehiclePlan:
    time = vehicle.time
    appears = None if time[0] < FRAME + 1e-9 else float(np.ceil(time[0] / FRAME - 1e-6) * FRAME)
    leaves = None if time[-1] > length - 1.5 * FRAME else float(np.floor(time[-1] / FRAME + 1e-6) * FRAME)
    begin = 0.0 if appears is None else appears
    lateral = _beside_lanes(lateral_plan(vehicle, begin if appears is None else begin + FRAME), vehicle, network)
    poses = vehicle.poses(network, lateral.at(time) - vehicle.levels[0])
    dx, dy = np.diff(poses.x), np.diff(poses.y)
    ahead_of_row = dx * np.cos(poses.heading[1:]) + dy * np.sin(poses.heading[1:])
    way = np.r_[0.0, np.cumsum(np.copysign(np.hypot(dx, dy), ahead_of_row))]  # noise takes back what it moves ahead
    share = PLAYED if lateral.is_played else 1.0
    speed = fit_speed(time, way, error=share * error, apart=share * APART)
    ahead = float(speed.way(np.array([begin]))[0])
    road, lane, s = int(vehicle.road[0]), int(vehicle.lane[0]), float(vehicle.s[0])
    forward = int(vehicle.way[0]) * network.travel_direction(road, lane)
    moved = network.advance(road, lane, s, ahead, direction=forward)
    base, _ = vehicle.levels
    offset = float(lateral.at(np.array([begin]))[0] - base[0])
    targets = tuple(_target(vehicle, network, one) for one in lateral.transitions)
    start = moved.road, moved.lane, moved.s, moved.direction if ahead >= 0.0 else -moved.direction, offset
    return VehiclePlan(name, vehicle, lateral, way, _from(speed, begin), appears, leaves, *start, targets)


def planned_motion(plan: VehiclePlan, time: FloatArray, network: RoadNetwork) -> EntityMotion:
    """Where the plan has the vehicle at times [s], shape (n,): what any player makes of it, but for its frames."""
    vehicle = plan.vehicle
    begin, end = plan.present
    held = np.clip(time, begin, end)
    way = plan.speed.way(held)
    recorded = plan.time_at(way)
    row = np.clip(np.searchsorted(vehicle.time, recorded, side="right") - 1, 0, len(vehicle.time) - 2)
    share = (recorded - vehicle.time[row]) / (vehicle.time[row + 1] - vehicle.time[row])
    same = (vehicle.road[row] == vehicle.road[row + 1]) & (vehicle.lane[row] == vehicle.lane[row + 1])
    s = vehicle.s[row] + np.where(same, share * (vehicle.s[row + 1] - vehicle.s[row]), 0.0)
    road, lane = vehicle.road[row].astype(np.int32), vehicle.lane[row].astype(np.int32)
    offset = plan.lateral.at(held) - vehicle.levels[0][row]
    way_on_lane = vehicle.way[row]
    poses = network.lane_to_world(road, lane, s, way_on_lane * offset)
    speed = np.interp(held, plan.speed.time, plan.speed.speed)
    active = (time >= begin - 1e-9) & (time <= end + FRAME)
    activity = np.where(active, np.uint8(Activity.ACTIVE), np.uint8(0)).astype(np.uint8)
    zero = np.zeros(len(time))
    heading = poses.heading + np.where(way_on_lane < 0, np.pi, 0.0)
    turned = poses.x, poses.y, poses.z, heading, poses.pitch, poses.roll
    box = BoundingBox(vehicle.centre, 0.0, 0.5 * vehicle.height, vehicle.length, vehicle.width, vehicle.height)
    entity = Entity(plan.name, EntityCategory.VEHICLE, Place("", 0, ""), box)
    return EntityMotion(entity, time, *turned, speed, road, lane, s, offset, zero, activity)


def _from(speed: SpeedProfile, begin: float) -> SpeedProfile:
    """The profile from a moment on, which may lie a little before its first corner. [s]"""
    later = speed.time > begin + 1e-6
    first = float(np.interp(begin, speed.time, speed.speed))
    start = float(speed.way(np.array([begin]))[0])
    return SpeedProfile(np.r_[begin, speed.time[later]], np.r_[first, speed.speed[later]], start)


def _beside_lanes(lateral: LateralPlan, vehicle: RecordedVehicle, network: RoadNetwork) -> LateralPlan:
    """With lane changes that begin where the lane that they lead to is there: it may come with the next road."""
    transitions = list[Transition]()
    for transition in lateral.transitions:
        rows = np.flatnonzero((vehicle.time >= transition.start) & (vehicle.time < transition.end - FRAME))
        for row in rows if transition.lanes else ():
            moved = replace(
                transition, start=float(vehicle.time[row]), duration=transition.end - float(vehicle.time[row])
            )
            lane = _target(vehicle, network, moved)
            if network.has_lane_at(int(vehicle.road[row]), lane, float(vehicle.s[row])):
                if row > rows[0]:
                    late = min(ENTERED, 0.5 * moved.duration)
                    transition = replace(moved, start=moved.start + late, duration=moved.duration - late)
                break
        transitions.append(transition)
    return replace(lateral, transitions=tuple(transitions))


def _target(vehicle: RecordedVehicle, network: RoadNetwork, transition: Transition) -> int:
    """Lane that a transition leads to, counted from where it begins: the recorded lane there may be a neighbour."""
    base, _ = vehicle.levels
    row = min(int(np.searchsorted(vehicle.time, transition.start)), len(base) - 1)
    road, lane = int(vehicle.road[row]), int(vehicle.lane[row])
    steps = round(float((transition.level - transition.offset - base[row]) / vehicle.lane_width[row]))
    if not steps:
        return lane
    target = lane
    side = (1 if steps > 0 else -1) * network.travel_direction(road, lane) * int(vehicle.way[row])
    for _ in range(abs(steps)):
        target = target + side or target + 2 * side
    return target


@dataclass(frozen=True, eq=False, slots=True)
class Residuals:
    """Recorded less planned, at the recorded rows."""

    time: FloatArray  # shape (n,) [s]
    along: FloatArray  # along, across: ahead, and to the left, of the planned place, shape (n,) [m]
    across: FloatArray
    in_lane: NDArray[np.bool_]  # outside of all transitions: what is across is the driver's, shape (n,)


def residuals_of(plan: VehiclePlan) -> Residuals:
    """Of the rows from which on the vehicle is there."""
    vehicle = plan.vehicle
    rows = vehicle.time >= plan.present[0] - 1e-9
    time = vehicle.time[rows]
    across = (vehicle.offset + vehicle.levels[0])[rows] - plan.lateral.at(time)
    in_lane = np.ones(len(time), dtype=np.bool_)
    for transition in plan.lateral.transitions:
        in_lane &= (time < transition.start) | (time > transition.end)
    return Residuals(time, plan.way[rows] - plan.speed.way(time), across, in_lane)
