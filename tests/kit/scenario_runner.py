"""What CARLA's ScenarioRunner 0.9.16 does with a file, as assertions on the file: its parser's rules, one by one.

Gathered from its published sources: `openscenario_configuration` (OC), `openscenario_parser` (OP), `open_scenario` (OS)
and `vehicle_velocity_control` (VC). CARLA itself is not run: a file that breaks no rule is accepted by the parser; how
the simulator moves the vehicle is `drive`'s business, which follows the control's published steps.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path

import numpy as np
from lxml import etree
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Rule = Callable[[etree._Element], Iterator[str]]

SCHEMA = etree.XMLSchema(etree.parse(str(Path(__file__).parents[1] / "data" / "xsd" / "OpenSCENARIO-1.0.0.xsd")))
LITERAL = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?")
CONTROLS = {
    "npc_vehicle_control": "moves waypoints to the lane",
    "simple_vehicle_control": "passes waypoints at 4 m, whatever their times",
    "vehicle_teleport_control": "takes a waypoint per frame",
    "vehicle_velocity_control": "",
}
FRAME = 0.05


def header(root: etree._Element) -> Iterator[str]:
    found = root.find("FileHeader")
    if (found.get("revMajor"), found.get("revMinor")) != ("1", "0"):
        yield "OC._check_version: only 1.0"


def schema(root: etree._Element) -> Iterator[str]:
    if not SCHEMA.validate(root):
        yield f"OC._validate_openscenario_configuration: {SCHEMA.error_log[0].message}"


def catalogs(root: etree._Element) -> Iterator[str]:
    if root.findall(".//CatalogReference"):
        yield "OC._load_catalogs: FOLDER/VehicleCatalog.xosc of version 1.0 alone, whatever the reference says"


def town(root: etree._Element) -> Iterator[str]:
    if not [item for item in root.find("RoadNetwork").findall("LogicFile") if item.get("filepath")]:
        yield "OC._set_carla_town: no LogicFile"


def ego(root: etree._Element) -> Iterator[str]:
    egos = [p for p in root.iter("Property") if (p.get("name"), p.get("value")) == ("type", "ego_vehicle")]
    if len(egos) != 1:
        yield f"OC._extract_vehicle_information: {len(egos)} vehicles of type ego_vehicle"


def starts(root: etree._Element) -> Iterator[str]:
    for private in root.find("Storyboard/Init").iter("Private"):
        if len(list(private.iter("Position"))) != 1:
            yield "OC._get_actor_transform: the last Position of all in a Private is the start"
        if any(float(speed.get("value")) < 0 for speed in private.iter("AbsoluteTargetSpeed")):
            yield "OC._get_actor_speed: not below 0"


def numbers(root: etree._Element) -> Iterator[str]:
    for item in root.iter("WorldPosition", "Vertex", "SimulationTimeCondition", "Condition"):
        for name in ("x", "y", "z", "h", "r", "time", "value", "delay"):
            if item.get(name) is not None and not LITERAL.fullmatch(item.get(name)):
                yield f"OP.ParameterRef: {item.tag}/@{name}='{item.get(name)}' is no number"


def positions(root: etree._Element) -> Iterator[str]:
    left_handed = root.find("FileHeader").get("description").startswith("CARLA:")
    for item in root.iter("WorldPosition"):
        if not left_handed and float(item.get("p") or 0):
            yield "OP.convert_position_to_transform: the sign of a pitch stays that of other axes"
    if any(True for _ in root.iter("RoutePosition")):
        yield "OP.convert_position_to_transform: no RoutePosition"


def controls(root: etree._Element) -> Iterator[str]:
    groups = [group for group in root.iter("ManeuverGroup") if group.find(".//FollowTrajectoryAction") is not None]
    moved = {reference.get("entityRef") for group in groups for reference in group.iter("EntityRef")}
    vehicles = {item.get("name") for item in root.iter("ScenarioObject") if item.find("Vehicle") is not None}
    for name in sorted(moved & vehicles):
        actions = root.findall(f"Storyboard/Init/Actions/Private[@entityRef='{name}']/PrivateAction/ControllerAction")
        modules = [p.get("value") for a in actions for p in a.iter("Property") if p.get("name") == "module"]
        module = modules[0] if len(modules) == 1 else "npc_vehicle_control"
        if CONTROLS.get(module, "is no control"):
            yield f"OS._create_init_behavior: {name} has {module}, which {CONTROLS.get(module, 'is no control')}"
        for action in actions:
            override = action.find("OverrideControllerValueAction")
            if override is None or any(item.get("active") != "false" for item in override):
                yield "OP.get_controller: an override, with nothing active"


def trajectories(root: etree._Element) -> Iterator[str]:
    end = max(
        (float(c.get("value")) for s in root.iter("StopTrigger") for c in s.iter("SimulationTimeCondition")), default=0
    )
    for event in root.iter("Event"):
        for follow in event.iter("FollowTrajectoryAction"):
            times = np.array([float(vertex.get("time", "nan")) for vertex in follow.iter("Vertex")])
            if follow.find("Trajectory/Shape/Polyline") is None or not np.isfinite(times).all():
                yield "OP.get_trajectory: polylines alone, every vertex with its time"
                continue
            if times[0] != 0.0 or np.diff(times).min() <= 0.0:
                yield "VC.run_step: times count from when the control got them"
            if _start(event) + times[-1] <= end:
                yield "VC.run_step: an IndexError when the last waypoint is behind"
            apart = np.abs(times[1:] / FRAME - np.round(times[1:] / FRAME)).min() * FRAME
            if apart < 1e-3:
                yield "VC.run_step: divides by the time left, next to nothing for a waypoint on a frame"


def _start(event: etree._Element) -> float:
    return float(event.find("StartTrigger").find(".//SimulationTimeCondition").get("value"))


def acts(root: etree._Element) -> Iterator[str]:
    for act in root.iter("Act"):
        if act.find("StopTrigger") is None:
            yield "OS._create_behavior: an act goes on until its own stop trigger"


GROUPS = {
    *("PrivateAction", "GlobalAction", "UserDefinedAction", "LongitudinalAction", "LateralAction", "RoutingAction"),
    *("ControllerAction", "InfrastructureAction", "TrafficSignalAction"),
}
ACTIONS = {
    *("SpeedAction", "LongitudinalDistanceAction", "LaneOffsetAction", "LateralDistanceAction", "SynchronizeAction"),
    *("AssignControllerAction", "OverrideControllerValueAction", "TeleportAction", "AssignRouteAction"),
    *("FollowTrajectoryAction", "AcquirePositionAction", "EnvironmentAction", "ParameterAction", "EntityAction"),
    *("CustomCommandAction", "TrafficSignalStateAction"),
}


def actions(root: etree._Element) -> Iterator[str]:
    for story in root.iter("Story"):
        for group in story.iter(*GROUPS):
            yield from (
                f"OP.convert_maneuver_to_atomic: {action.tag}" for action in group if action.tag not in GROUPS | ACTIONS
            )
        yield from (f"OP.convert_maneuver_to_atomic: {item.tag}" for item in story.iter("AbsoluteTargetLane"))
        for item in story.iter("LongitudinalDistanceAction", "SynchronizeAction"):
            if item.get("distance") is None and item.find("FinalSpeed") is None:
                yield f"OP.convert_maneuver_to_atomic: {item.tag} without a distance or a final speed"
        for signal in story.iter("TrafficSignalStateAction"):
            if not signal.get("name").startswith(("id=", "pos=")):
                yield "OP.get_traffic_light_from_osc_name: id=... or pos=..."


def ways(root: etree._Element) -> Iterator[str]:
    for item in root.find("Storyboard").iter("AcquirePositionAction", "AssignRouteAction"):
        yield f"ChangeActorWaypoints: {item.tag} hands it no times, whose number it asks for"
    for item in root.find("Storyboard").iter("AbsoluteTargetSpeed"):
        if float(item.get("value")) < 0.0:
            yield "VC and NPC.run_step: NotImplementedError for a speed below 0"


def weather(root: etree._Element) -> Iterator[str]:
    for item in root.iter("TimeOfDay"):
        try:
            datetime.strptime(item.get("dateTime"), "%Y-%m-%dT%H:%M:%S")
        except ValueError:
            yield f"OP.get_weather_from_env_action: dateTime '{item.get('dateTime')}'"
    for sun in root.iter("Sun"):
        if not 0.0 <= float(sun.get("intensity") or "nan") <= 1.0:
            yield "OP.get_weather_from_env_action: cloudiness is 100 - 100 intensity"
    for environment in root.iter("Environment"):
        if {"TimeOfDay", "Weather", "RoadCondition"} - {child.tag for child in environment}:
            yield "OP.get_weather_from_env_action: Weather, TimeOfDay and RoadCondition are looked at without asking"


def names(root: etree._Element) -> Iterator[str]:
    """A behaviour that is called like one before it is not run: `oneshot_with_check`."""
    for story in root.iter("Story"):
        paths = [_path(item, story) for item in story.iter("Act", "ManeuverGroup", "Event", "Action", "Condition")]
        for path in sorted({path for path in paths if paths.count(path) > 1}):
            yield f"OS.oneshot_with_check: '{path}' twice"
        # Inside a group, names of maneuvers do not count.
        for group in story.iter("ManeuverGroup"):
            events = [event.get("name") for event in group.iter("Event")]
            if len(set(events)) < len(events):
                yield "OS.get_xml_path: events of a group need names of their own"


def _path(item: etree._Element, story: etree._Element) -> str:
    found = []
    while item is not story:
        found.append(str(item.get("name")))
        item = item.getparent()
    return ">".join(reversed(found))


RULES: tuple[Rule, ...] = (
    header,
    schema,
    catalogs,
    town,
    ego,
    starts,
    numbers,
    positions,
    controls,
    trajectories,
    acts,
    actions,
    ways,
    weather,
    names,
)


def broken(root: etree._Element) -> list[str]:
    """Every rule that a file breaks."""
    return [problem for rule in RULES for problem in rule(root)]


def drive(times: FloatArray, x: FloatArray, y: FloatArray, until: float) -> FloatArray:
    """Where the velocity control brings a car that obeys at once, frame by frame: rows of time, x, y.

    As its `run_step`: waypoints whose time has come are dropped, the next one is driven at such that it is reached in
    time. [s], [m]
    """
    at = np.array([x[0], y[0]])
    rows, number = [], 0
    for frame in range(int(until / FRAME) + 1):
        now = frame * FRAME
        while times[number] <= now:
            number += 1
        rows.append((now, *at))
        ahead = np.array([x[number], y[number]]) - at
        at = at + ahead * FRAME / (times[number] - now)
    return np.array(rows)
