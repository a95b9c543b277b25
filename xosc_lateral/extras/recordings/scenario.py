"""A reconstructed scenario as OpenSCENARIO: entities, init, one maneuver per vehicle, declared parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from lxml import etree

from xosc_lateral.extras.recordings.encounters import RelativeTrigger, Triggers
from xosc_lateral.extras.recordings.plan import VehiclePlan
from xosc_lateral.extras.recordings.recorded import Recording, Transition, peak_acceleration
from xosc_lateral.extras.recordings.recordings import RecordedTraffic
from xosc_lateral.extras.recordings.settings import ReconstructSettings
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.build import HEADER_DATE, Version, decimal, sub
from xosc_lateral.files.output_paths import template_mark
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.enums import Priority

MODELS = {name: name for name in ("car", "van", "truck", "bus", "trailer", "motorbike", "bicycle")}
MODELS["motorcycle"] = "motorbike"
"""Recorded class -> vehicle category, the same in all versions; others are cars."""

LIMITS = {"maxSpeed": "80", "maxAcceleration": "12", "maxDeceleration": "12"}
"""Above what is recorded: the speed profile alone says how it drives. [m/s], [m/s2]"""

HALF_FRAME = 0.01
"""Players set the speed of a frame's end and drive the whole frame with it: they are half a frame ahead of a profile,
which is therefore written as much later; for frames of 0.02 s, those of `play`. Else braking from 30 m/s to a stop ends
0.3 m short. [s]"""

VERTEX_STEP = 0.2  # between the vertices of a recorded path [s]


def reconstructed_scenario(
    traffic: RecordedTraffic,
    recording: Recording,
    plans: Sequence[VehiclePlan],
    relative: Mapping[str, Triggers],
    settings: ReconstructSettings,
    host: str | None,
) -> str:
    """The document, the same bytes each time; `relative`: entity -> what of it begins by a distance instead of the
    clock; `host`: entity under test."""
    major, minor = map(int, settings.version.split("."))
    network, road_file, version = traffic.network, traffic.road_name, (major, minor)
    part = f"{recording.start:g} to {recording.end:g} s"
    description = f"{traffic.name}: reconstructed from {traffic.sources[0].name}, {part}"
    entities, actions = etree.Element("Entities"), etree.Element("Actions")
    story = build.story("Recorded")
    act = sub(story, "Act", name="Traffic")
    values = dict[str, str]()
    for plan in plans:
        vehicle = _Vehicle(plan, network, version, act, values)
        vehicle.add_entity(entities, is_host=plan.name == host)
        if plan.appears is None:
            vehicle.add_init(actions)
        event = vehicle.drive()
        if settings.exact:
            vehicle.follow_recorded_path(event)
        else:
            vehicle.maneuver_as_planned(event, *relative.get(plan.name, ({}, {})))
        vehicle.leave()
    build.time_trigger(act, "StartTrigger", 0.0, version)

    root = etree.Element("OpenSCENARIO")
    header = sub(root, "FileHeader", revMajor=str(version[0]), revMinor=str(version[1]), date=HEADER_DATE)
    header.set("description", plain_text(description))
    header.set("author", "xosc-lateral")
    parameters = sub(root, "ParameterDeclarations")
    for name, value in values.items():
        sub(parameters, "ParameterDeclaration", name=name, parameterType="double", value=value)
    sub(root, "CatalogLocations")
    sub(root, "RoadNetwork/LogicFile", filepath=f"./{road_file}" if road_file.startswith("$") else road_file)
    root.append(entities)
    storyboard = sub(root, "Storyboard")
    sub(storyboard, "Init").append(actions)
    storyboard.append(story)
    build.time_trigger(storyboard, "StopTrigger", recording.end - recording.start, version)
    etree.indent(root, "  ")
    text = f"<?xml version='1.0' encoding='UTF-8'?>\n{etree.tostring(root, encoding='unicode')}\n"
    return text + template_mark(text)


def plain_text(text: str) -> str:
    """Text in quotes where it begins with $, which would make it a reference to a parameter."""
    return f"'{text}'" if text.startswith("$") else text


class _Vehicle:
    """One vehicle: its entity, where it starts and what it does; `values` gets the parameters used by name."""

    def __init__(
        self, plan: VehiclePlan, network: RoadNetwork, version: Version, act: etree._Element, values: dict[str, str]
    ) -> None:
        self._plan, self._network, self._version, self._values = plan, network, version, values
        self._maneuver = build.maneuver(act, f"{plan.name}_maneuver", plan.name)

    def _value(self, name: str, value: float, digits: int) -> str:
        self._values[name] = decimal(value, digits)
        return f"${name}"

    def _added(self, what: str, to: float, digits: int) -> str:
        """A number plus a parameter of the vehicle; version 1.0 has no expressions."""
        if self._version < (1, 1):
            return decimal(to, digits)
        name = f"{self._plan.name}_{what}"
        self._values.setdefault(name, "0")
        return f"${{{decimal(to, digits)} + ${name}}}"

    def _event(self, what: str) -> etree._Element:
        return build.event(self._maneuver, f"{self._plan.name}_{what}", Priority.PARALLEL, self._version)

    def _begin(self, event: etree._Element, moment: float) -> etree._Element:
        return build.time_trigger(event, "StartTrigger", moment, self._version)

    def add_entity(self, entities: etree._Element, *, is_host: bool) -> None:
        """As large as it was measured."""
        recorded, box = self._plan.vehicle, self._plan.vehicle.box
        kind = MODELS.get(recorded.entity.kind, "car")
        vehicle = sub(sub(entities, "ScenarioObject", name=self._plan.name), "Vehicle", name=kind, vehicleCategory=kind)
        width, length, height = (decimal(size, 3) for size in (box.width, box.length, box.height))
        sub(vehicle, "BoundingBox/Center", x=decimal(box.center_x, 3), y="0", z=decimal(0.5 * box.height, 3))
        sub(vehicle[0], "Dimensions", width=width, length=length, height=height)
        sub(vehicle, "Performance", **LIMITS)
        axles = sub(vehicle, "Axles")
        track, front = decimal(0.85 * box.width, 3), decimal(2.0 * box.center_x, 3)
        for tag, steering, x in (("FrontAxle", "0.5", front), ("RearAxle", "0", "0")):
            sub(axles, tag, maxSteering=steering, wheelDiameter="0.7", trackWidth=track, positionX=x, positionZ="0.35")
        properties = sub(vehicle, "Properties")
        sub(properties, "Property", name="recorded_as", value=plain_text(recorded.name))
        if is_host:  # CARLA's ScenarioRunner hands the vehicle of this type to the system under test
            sub(properties, "Property", name="type", value="ego_vehicle")

    def add_init(self, actions: etree._Element) -> None:
        """Where it starts, and how fast."""
        private = sub(actions, "Private", entityRef=self._plan.name)
        self._place(sub(private, "PrivateAction/TeleportAction"))
        self._speed(sub(private, "PrivateAction"), "step", 0.0, self._plan.speed.speed[0])

    def _place(self, owner: etree._Element) -> None:
        """Where it starts; a gap is varied by moving it ahead."""
        plan = self._plan
        s = self._added("ahead", plan.s, 3)
        s = s if plan.direction > 0 else s.replace(" + ", " - ")
        road, offset = self._network.road_ids[plan.road], decimal(plan.direction * plan.offset, 4)
        place = sub(owner, "Position/LanePosition", roadId=road, laneId=str(plan.lane), s=s, offset=offset)
        if plan.direction != self._network.travel_direction(plan.road, plan.lane):
            sub(place, "Orientation", h=decimal(np.pi, 6), type="relative")

    def _speed(self, private: etree._Element, shape: str, duration: float, speed: float) -> None:
        action = sub(private, "LongitudinalAction/SpeedAction")
        sub(action, "SpeedActionDynamics", dynamicsShape=shape, dynamicsDimension="time", value=decimal(duration, 4))
        sub(action, "SpeedActionTarget/AbsoluteTargetSpeed", value=self._added("faster", float(speed), 4))

    def _entity_action(self, event: etree._Element, what: str) -> etree._Element:
        action = sub(event, "Action", name=f"{self._plan.name}_{what}")
        return sub(action, "GlobalAction/EntityAction", entityRef=self._plan.name)

    def drive(self) -> etree._Element:
        """The event in which it sets off; one that was not there yet appears."""
        event = self._event("drive")
        if self._plan.appears is not None:
            self._place(sub(self._entity_action(event, "appear"), "AddEntityAction"))
        return event

    def leave(self) -> None:
        """The event in which it is gone, if it is."""
        if self._plan.leaves is not None:
            event = self._event("leave")
            sub(self._entity_action(event, "delete"), "DeleteEntityAction")
            self._begin(event, self._plan.leaves)

    def maneuver_as_planned(
        self, event: etree._Element, changes: Mapping[int, RelativeTrigger], braking: Mapping[int, RelativeTrigger]
    ) -> None:
        """Its speeds and transitions; see `Triggers`."""
        edges = [0, *sorted(braking), len(self._plan.speed.time) - 1]
        for first, last in pairwise(edges):
            if first:
                event = self._event(f"brake{first}")
            self._speeds(event, first, last)
            if first:
                self._begin_by_distance(event, braking[first])
        transitions = zip(self._plan.lateral.transitions, self._plan.targets, strict=True)
        for number, (transition, target) in enumerate(transitions):
            self._transition(transition, target, number, changes.get(number))

    def _speeds(self, event: etree._Element, first: int, last: int) -> None:
        """Corners `first` to `last` of the speed profile: an action, or, in versions without profiles, one a piece."""
        time, speed = self._plan.speed.time, self._plan.speed.speed
        name = event.get("name")
        if self._version >= (1, 2):
            action = sub(build.private_action(event, f"{name}_speed"), "LongitudinalAction")
            profile = sub(action, "SpeedProfileAction", followingMode="position")
            for k in range(first + (first > 0), last + 1):
                value, after = float(speed[k]), float(time[k] - time[k - 1]) if k > first else 0.0
                if k == 0:  # an entry of time 0 holds from the start
                    value = max(value - HALF_FRAME * float((speed[1] - speed[0]) / (time[1] - time[0])), 0.0)
                elif k == first + 1:
                    after += HALF_FRAME
                sub(profile, "SpeedProfileEntry", speed=self._added("faster", value, 4), time=decimal(after, 4))
            if not first:
                self._begin(event, float(time[0]))
            return
        if not first:
            self._speed(build.private_action(event, f"{name}_speed"), "step", 0.0, speed[0])
            self._begin(event, float(time[0]))
        for k in range(first + 1, last + 1):
            piece = event if first and k == first + 1 else self._event(f"speed{k}")
            action = build.private_action(piece, f"{self._plan.name}_speed{k}_action")
            self._speed(action, "linear", float(time[k] - time[k - 1]), speed[k])
            if piece is not event:
                self._begin(piece, float(time[k - 1]))

    def _begin_by_distance(self, event: etree._Element, trigger: RelativeTrigger) -> None:
        group = self._begin(event, trigger.not_before)[0]
        owner = build.entity_condition(group, f"distance to {trigger.other}", self._plan.name)
        rule = "greaterThan" if trigger.grows else "lessThan"
        kind = {"relativeDistanceType": "longitudinal", "freespace": "false", "rule": rule}
        condition = sub(owner, "RelativeDistanceCondition", entityRef=trigger.other, **kind)
        condition.set("value", self._value(f"{event.get('name')}_distance", trigger.distance, 3))
        if self._version >= (1, 1):
            condition.set("coordinateSystem", "road")

    def follow_recorded_path(self, event: etree._Element) -> None:
        """The recorded places themselves, at their times."""
        name, vehicle, begin = self._plan.name, self._plan.vehicle, self._plan.present[0]
        time = np.append(np.arange(begin, vehicle.time[-1] - 0.5 * VERTEX_STEP, VERTEX_STEP), vehicle.time[-1])
        x, y = (np.interp(time, vehicle.time, values) for values in (vehicle.x, vehicle.y))
        heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
        follow = sub(build.private_action(event, f"{name}_path"), "RoutingAction/FollowTrajectoryAction")
        holder = follow if self._version < (1, 1) else sub(follow, "TrajectoryRef")
        trajectory = sub(holder, "Trajectory", name=f"{name}_recorded", closed="false")
        sub(trajectory, "ParameterDeclarations")
        line = sub(trajectory, "Shape/Polyline")
        for k, moment in enumerate(time):
            vertex = sub(line, "Vertex", time=decimal(float(moment - begin), 3))
            build.world_position(vertex, (float(x[k]), float(y[k]), 0.0, float(heading[k]), 0.0, 0.0))
        sub(follow, "TimeReference/Timing", domainAbsoluteRelative="relative", scale="1", offset="0")
        sub(follow, "TrajectoryFollowingMode", followingMode="position")
        self._begin(event, begin)

    def _transition(self, transition: Transition, target: int, number: int, relative: RelativeTrigger | None) -> None:
        word = "change" if transition.lanes else "aborted" if transition.aborted else "offset"
        event = self._event(f"{word}{number + 1}")
        name = event.get("name")
        lateral = sub(build.private_action(event, f"{name}_action"), "LateralAction")
        offset_t = self._plan.direction * transition.offset
        if transition.lanes:
            aside = {"targetLaneOffset": decimal(offset_t, 4)} if abs(offset_t) > 1e-3 else {}
            action = sub(lateral, "LaneChangeAction", **aside)
            duration = self._value(f"{name}_duration", transition.duration, 3)
            dynamics = {"dynamicsShape": transition.shape.value, "dynamicsDimension": "time", "value": duration}
            sub(action, "LaneChangeActionDynamics", **dynamics)
            sub(action, "LaneChangeTarget/AbsoluteTargetLane", value=str(target))
        else:
            action = sub(lateral, "LaneOffsetAction", continuous="false")
            limit = peak_acceleration(transition.shape, transition.change, transition.duration)
            dynamics = {"dynamicsShape": transition.shape.value, "maxLateralAcc": decimal(limit, 9)}
            sub(action, "LaneOffsetActionDynamics", **dynamics)
            wanted = self._value(f"{name}_offset", offset_t, 4)
            sub(action, "LaneOffsetTarget/AbsoluteTargetLaneOffset", value=wanted)
        if relative is not None:
            self._begin_by_distance(event, relative)
            return
        (condition,) = self._begin(event, transition.start).iter("SimulationTimeCondition")
        condition.set("value", self._value(f"{name}_start", transition.start, 3))
