"""A reconstructed scenario as OpenSCENARIO: entities, init, one maneuver per vehicle, declared parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from lxml import etree

from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.formats.openscenario.write.build import Version, decimal, sub
from xosc_lateral.formats.output_paths import template_mark
from xosc_lateral.reconstruction.encounters import RelativeTrigger
from xosc_lateral.reconstruction.plan import VehiclePlan
from xosc_lateral.reconstruction.transitions import Transition, peak_acceleration
from xosc_lateral.road.network import RoadNetwork
from xosc_lateral.scenario.enums import Priority

DATE = "2024-01-01T00:00:00"
"""The format asks for a date: the same recording gives the same bytes."""

MODELS = {"car": "car", "van": "van", "truck": "truck", "bus": "bus", "trailer": "trailer"}
MODELS |= {"motorcycle": "motorbike", "motorbike": "motorbike", "bicycle": "bicycle"}
"""Recorded class -> vehicle category, the same in all versions; others are cars."""

LIMITS = {"maxSpeed": "80", "maxAcceleration": "12", "maxDeceleration": "12"}
"""Above what is recorded: the speed profile alone says how it drives. [m/s], [m/s2]"""


Triggers = tuple[Mapping[int, RelativeTrigger], Mapping[int, RelativeTrigger]]
"""Of transitions by their number, of brakings by the number of their corner in the speed profile."""

HALF_FRAME = 0.01
"""Players set the speed of a frame's end and drive the whole frame with it: they are half a frame ahead of a profile,
which is therefore written as much later; for frames of 0.02 s, those of `play`. Else braking from 30 m/s to a stop ends
0.3 m short. [s]"""

VERTICES = 0.2
"""Between the vertices of a recorded path. [s]"""


@dataclass(slots=True)
class _Declared:
    """Parameters that are used by name, with their values."""

    version: Version
    values: dict[str, str] = field(default_factory=dict)

    def value(self, name: str, value: float, digits: int) -> str:
        """A number of its own."""
        self.values[name] = decimal(value, digits)
        return f"${name}"

    def added(self, name: str, to: float, digits: int) -> str:
        """A number plus a parameter; version 1.0 has no expressions."""
        if self.version < (1, 1):
            return decimal(to, digits)
        self.values.setdefault(name, "0")
        return f"${{{decimal(to, digits)} + ${name}}}"


def reconstructed_scenario(
    plans: Sequence[VehiclePlan],
    network: RoadNetwork,
    *,
    road_file: str,
    duration: float,
    version: Version,
    host: str | None,
    description: str,
    relative: Mapping[str, Triggers] | None = None,
    exact: bool = False,
) -> str:
    """The document, the same bytes each time.

    Parameters
    ----------
    plans : sequence of VehiclePlan
    network : RoadNetwork
    road_file : str
        As seen from the scenario.
    duration : float
        The scenario ends then. [s]
    version : (int, int)
        Of the standard.
    host : str, optional
        Entity that is the vehicle under test.
    description : str
        For the header.
    relative : mapping of str to triggers, optional
        Entity -> what of it begins by a distance instead of the clock.
    exact : bool
        Recorded paths as trajectories, instead of maneuvers.
    """
    declared = _Declared(version)
    entities, actions = etree.Element("Entities"), etree.Element("Actions")
    story = build.story("Recorded")
    act = sub(story, "Act", name="Traffic")
    for plan in plans:
        _entity(entities, plan, is_host=plan.name == host)
        if plan.appears is None:
            _init(actions, plan, network, declared)
        maneuver = build.maneuver(act, f"{plan.name}_maneuver", plan.name)
        if exact:
            _recorded_path(maneuver, plan, network, declared)
        else:
            _events(maneuver, plan, network, declared, (relative or {}).get(plan.name, ({}, {})))
    build.time_trigger(act, "StartTrigger", 0.0, version)

    root = etree.Element("OpenSCENARIO")
    major, minor = map(str, version)
    sub(root, "FileHeader", revMajor=major, revMinor=minor, date=DATE, description=description, author="xosc-lateral")
    parameters = sub(root, "ParameterDeclarations")
    for name, value in declared.values.items():
        sub(parameters, "ParameterDeclaration", name=name, parameterType="double", value=value)
    sub(root, "CatalogLocations")
    sub(sub(root, "RoadNetwork"), "LogicFile", filepath=road_file)
    root.append(entities)
    storyboard = sub(root, "Storyboard")
    sub(storyboard, "Init").append(actions)
    storyboard.append(story)
    build.time_trigger(storyboard, "StopTrigger", duration, version)
    etree.indent(root, "  ")
    text = f"<?xml version='1.0' encoding='UTF-8'?>\n{etree.tostring(root, encoding='unicode')}\n"
    return text + template_mark(text)


def _entity(entities: etree._Element, plan: VehiclePlan, *, is_host: bool) -> None:
    one = plan.vehicle
    kind = MODELS.get(one.kind, "car")
    vehicle = sub(sub(entities, "ScenarioObject", name=plan.name), "Vehicle", name=kind, vehicleCategory=kind)
    box = sub(vehicle, "BoundingBox")
    sub(box, "Center", x=decimal(one.centre, 3), y="0", z=decimal(0.5 * one.height, 3))
    sub(box, "Dimensions", width=decimal(one.width, 3), length=decimal(one.length, 3), height=decimal(one.height, 3))
    sub(vehicle, "Performance", **LIMITS)
    axles = sub(vehicle, "Axles")
    track, front = decimal(0.85 * one.width, 3), decimal(2.0 * one.centre, 3)
    for tag, steering, x in (("FrontAxle", "0.5", front), ("RearAxle", "0", "0")):
        sub(axles, tag, maxSteering=steering, wheelDiameter="0.7", trackWidth=track, positionX=x, positionZ="0.35")
    properties = sub(vehicle, "Properties")
    sub(properties, "Property", name="recorded_as", value=one.name)
    if is_host:  # CARLA's ScenarioRunner hands the vehicle of this type to the system under test
        sub(properties, "Property", name="type", value="ego_vehicle")


def _place(owner: etree._Element, plan: VehiclePlan, network: RoadNetwork, declared: _Declared) -> None:
    """Where it starts; a gap is varied by moving it ahead."""
    s = declared.added(f"{plan.name}_ahead", plan.s, 3)
    s = s if plan.direction > 0 else s.replace(" + ", " - ")
    road, offset = network.road_ids[plan.road], decimal(plan.direction * plan.offset, 4)
    place = sub(sub(owner, "Position"), "LanePosition", roadId=road, laneId=str(plan.lane), s=s, offset=offset)
    if plan.direction != network.travel_direction(plan.road, plan.lane):
        sub(place, "Orientation", h=decimal(np.pi, 6), type="relative")


def _init(actions: etree._Element, plan: VehiclePlan, network: RoadNetwork, declared: _Declared) -> None:
    private = sub(actions, "Private", entityRef=plan.name)
    _place(sub(sub(private, "PrivateAction"), "TeleportAction"), plan, network, declared)
    target = _speed_action(sub(private, "PrivateAction"), "step", 0.0)
    target.set("value", declared.added(f"{plan.name}_faster", float(plan.speed.speed[0]), 4))


def _drive(maneuver: etree._Element, plan: VehiclePlan, network: RoadNetwork, declared: _Declared) -> etree._Element:
    """The event in which a vehicle sets off; one that was not there yet appears."""
    event = build.event(maneuver, f"{plan.name}_drive", Priority.PARALLEL, declared.version)
    if plan.appears is not None:
        action = sub(sub(event, "Action", name=f"{plan.name}_appear"), "GlobalAction")
        add = sub(sub(action, "EntityAction", entityRef=plan.name), "AddEntityAction")
        _place(add, plan, network, declared)
    return event


def _leave(maneuver: etree._Element, plan: VehiclePlan, declared: _Declared) -> None:
    if plan.leaves is not None:
        event = build.event(maneuver, f"{plan.name}_leave", Priority.PARALLEL, declared.version)
        action = sub(sub(event, "Action", name=f"{plan.name}_delete"), "GlobalAction")
        sub(sub(action, "EntityAction", entityRef=plan.name), "DeleteEntityAction")
        build.time_trigger(event, "StartTrigger", plan.leaves, declared.version)


def _events(
    maneuver: etree._Element, plan: VehiclePlan, network: RoadNetwork, declared: _Declared, relative: Triggers
) -> None:
    changes, braking = relative
    event = _drive(maneuver, plan, network, declared)
    edges = [0, *sorted(braking), len(plan.speed.time) - 1]
    for first, last in pairwise(edges):
        if first:
            event = build.event(maneuver, f"{plan.name}_brake{first}", Priority.PARALLEL, declared.version)
        _speeds(maneuver, event, plan, declared, first, last)
        if first:
            _distance_trigger(event, plan.name, f"{plan.name}_brake{first}_distance", braking[first], declared)
    for number, (one, target) in enumerate(zip(plan.lateral.transitions, plan.targets, strict=True)):
        _transition(maneuver, plan, one, target, number, declared, changes.get(number))
    _leave(maneuver, plan, declared)


def _speeds(
    maneuver: etree._Element, event: etree._Element, plan: VehiclePlan, declared: _Declared, first: int, last: int
) -> None:
    """Corners `first` to `last` of the speed profile: one action, or, in versions without profiles, one per piece."""
    time, speed = plan.speed.time, plan.speed.speed
    name, faster = event.get("name"), f"{plan.name}_faster"
    if declared.version >= (1, 2):
        action = sub(build.private_action(event, f"{name}_speed"), "LongitudinalAction")
        profile = sub(action, "SpeedProfileAction", followingMode="position")
        for k in range(first + (first > 0), last + 1):
            value, after = float(speed[k]), float(time[k] - time[k - 1]) if k > first else 0.0
            if k == 0:  # an entry of time 0 holds from the start
                value = max(value - HALF_FRAME * float((speed[1] - speed[0]) / (time[1] - time[0])), 0.0)
            elif k == first + 1:
                after += HALF_FRAME
            sub(profile, "SpeedProfileEntry", speed=declared.added(faster, value, 4), time=decimal(after, 4))
        if not first:
            build.time_trigger(event, "StartTrigger", float(time[0]), declared.version)
        return
    if not first:
        target = _speed_action(build.private_action(event, f"{name}_speed"), "step", 0.0)
        target.set("value", declared.added(faster, float(speed[0]), 4))
        build.time_trigger(event, "StartTrigger", float(time[0]), declared.version)
    for k in range(first + 1, last + 1):
        piece = event
        if not first or k > first + 1:
            piece = build.event(maneuver, f"{plan.name}_speed{k}", Priority.PARALLEL, declared.version)
        target = _speed_action(
            build.private_action(piece, f"{plan.name}_speed{k}_action"), "linear", float(time[k] - time[k - 1])
        )
        target.set("value", declared.added(faster, float(speed[k]), 4))
        if piece is not event:
            build.time_trigger(piece, "StartTrigger", float(time[k - 1]), declared.version)


def _distance_trigger(
    event: etree._Element, name: str, parameter: str, trigger: RelativeTrigger, declared: _Declared
) -> None:
    """Once a distance along the road passes a declared value, and not before a time."""
    owner = build.time_trigger(event, "StartTrigger", trigger.not_before, declared.version)
    group = owner[0]
    condition = sub(group, "Condition", name=f"distance to {trigger.other}", delay="0", conditionEdge="none")
    entity = sub(condition, "ByEntityCondition")
    sub(
        sub(entity, "TriggeringEntities", triggeringEntitiesRule="any"),
        "EntityRef",
        entityRef=name,
    )
    system = {"coordinateSystem": "road"} if declared.version >= (1, 1) else {}
    sub(
        sub(entity, "EntityCondition"),
        "RelativeDistanceCondition",
        entityRef=trigger.other,
        relativeDistanceType="longitudinal",
        freespace="false",
        rule="greaterThan" if trigger.grows else "lessThan",
        value=declared.value(parameter, trigger.distance, 3),
        **system,
    )


def _recorded_path(maneuver: etree._Element, plan: VehiclePlan, network: RoadNetwork, declared: _Declared) -> None:
    """The recorded places themselves, at their times."""
    vehicle = plan.vehicle
    event = _drive(maneuver, plan, network, declared)
    begin = plan.present[0]
    time = np.append(np.arange(begin, vehicle.time[-1] - 0.5 * VERTICES, VERTICES), vehicle.time[-1])
    x, y = (np.interp(time, vehicle.time, values) for values in (vehicle.x, vehicle.y))
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    follow = sub(sub(build.private_action(event, f"{plan.name}_path"), "RoutingAction"), "FollowTrajectoryAction")
    holder = follow if declared.version < (1, 1) else sub(follow, "TrajectoryRef")
    trajectory = sub(holder, "Trajectory", name=f"{plan.name}_recorded", closed="false")
    sub(trajectory, "ParameterDeclarations")
    line = sub(sub(trajectory, "Shape"), "Polyline")
    for k, moment in enumerate(time):
        vertex = sub(line, "Vertex", time=decimal(float(moment - begin), 3))
        build.world_position(vertex, (float(x[k]), float(y[k]), 0.0, float(heading[k]), 0.0, 0.0))
    sub(sub(follow, "TimeReference"), "Timing", domainAbsoluteRelative="relative", scale="1", offset="0")
    sub(follow, "TrajectoryFollowingMode", followingMode="position")
    build.time_trigger(event, "StartTrigger", begin, declared.version)
    _leave(maneuver, plan, declared)


def _speed_action(private: etree._Element, shape: str, duration: float) -> etree._Element:
    """A speed action whose target speed is still to be set."""
    action = sub(sub(private, "LongitudinalAction"), "SpeedAction")
    sub(action, "SpeedActionDynamics", dynamicsShape=shape, dynamicsDimension="time", value=decimal(duration, 4))
    return sub(sub(action, "SpeedActionTarget"), "AbsoluteTargetSpeed")


def _transition(
    maneuver: etree._Element,
    plan: VehiclePlan,
    one: Transition,
    target: int,
    number: int,
    declared: _Declared,
    relative: RelativeTrigger | None,
) -> None:
    word = "change" if one.lanes else "aborted" if one.aborted else "offset"
    name = f"{plan.name}_{word}{number + 1}"
    event = build.event(maneuver, name, Priority.PARALLEL, declared.version)
    lateral = sub(build.private_action(event, f"{name}_action"), "LateralAction")
    offset_t = plan.direction * one.offset
    if one.lanes:
        aside = {"targetLaneOffset": decimal(offset_t, 4)} if abs(offset_t) > 1e-3 else {}
        action = sub(lateral, "LaneChangeAction", **aside)
        duration = declared.value(f"{name}_duration", one.duration, 3)
        dynamics = {"dynamicsShape": one.shape.value, "dynamicsDimension": "time", "value": duration}
        sub(action, "LaneChangeActionDynamics", **dynamics)
        sub(sub(action, "LaneChangeTarget"), "AbsoluteTargetLane", value=str(target))
    else:
        action = sub(lateral, "LaneOffsetAction", continuous="false")
        limit = peak_acceleration(one.shape, one.change, one.duration)
        sub(action, "LaneOffsetActionDynamics", dynamicsShape=one.shape.value, maxLateralAcc=decimal(limit, 9))
        wanted = declared.value(f"{name}_offset", offset_t, 4)
        sub(sub(action, "LaneOffsetTarget"), "AbsoluteTargetLaneOffset", value=wanted)
    if relative is not None:
        _distance_trigger(event, plan.name, f"{name}_distance", relative, declared)
        return
    trigger = build.time_trigger(event, "StartTrigger", one.start, declared.version)
    condition = trigger.find(".//SimulationTimeCondition")
    assert condition is not None
    condition.set("value", declared.value(f"{name}_start", one.start, 3))
