"""One scenario of a seed: a road, three vehicles, what the seed asks for and what goes with it."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from tests.kit.made.actions import ACTIONS, COMMON
from tests.kit.made.conditions import CONDITIONS
from tests.kit.made.roads import ROADS
from tests.kit.made.stage import Stage
from tests.kit.made.xml import element
from xosc_lateral.files.opendrive.reader import read_opendrive

LAST = 14.0
"""When a scenario ends. [s]"""
NAMES = ("Ego", "Lead", "Side")
UNKNOWN_AT_FIRST = ("speed", "acceleration", "time_to_collision")
"""The reference player has no velocities at time 0: conditions on them are false or true for no reason there."""
ONCE = ("lateral_distance", "synchronize")
"""The reference player begins a repetition with what is left of the first time: signs, widths, distances."""


def made(seed: int) -> tuple[str, str, str]:
    """What a seed stands for, its road and its scenario."""
    rng = np.random.default_rng([9271, seed])
    action = list(ACTIONS)[seed % len(ACTIONS)]
    condition = list(CONDITIONS)[(seed // len(ACTIONS) + 5 * seed) % len(CONDITIONS)]
    shape = list(ROADS)[(3 * seed + seed // 7) % len(ROADS)]
    built = ROADS[shape](rng, int(rng.integers(2, 4)))
    road = built.xml()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "road.xodr"
        path.write_text(road, encoding="utf-8")
        network = read_opendrive(path)
    stage = Stage(rng, built, network)
    _populate(stage, action)
    title = f"{action} when {condition} on {shape}"
    return title, road, _scenario(stage, title, action, condition)


def _populate(stage: Stage, action: str) -> None:
    places = [60.0, 60.0 + stage.number(25, 60), 40.0 + stage.number(0, 40)]
    lanes = [stage.some_lane() for _ in NAMES]
    if lanes[2] == lanes[0]:
        lanes[2] = stage.map.along * (1 + abs(lanes[0]) % stage.map.lanes)
    for name, lane, s in zip(NAMES, lanes, places, strict=True):
        stage.start[name] = (lane, s, stage.number(10, 32))
    if stage.flag(0.15):  # somebody comes from the other side
        stage.start["Side"] = (-lanes[2], stage.map.length - 30.0, stage.number(8, 20))
    stage.absent = ("Late",)
    if action == "connect_trailer":
        stage.trailers = {"Trailer": "Ego"}
    stage.variables["count"] = "1"
    stage.declared["go"] = "1"


def _scenario(stage: Stage, title: str, action: str, condition: str) -> str:
    who = stage.pick("Ego", "Ego", "Lead")
    if action.endswith("trailer"):
        who = "Ego"
    partner = stage.other(who)
    first = _event("first", ACTIONS[stage.pick(*COMMON)](stage, who), _after(stage, stage.number(0.5, 2)))
    conditions = [CONDITIONS[condition](stage, who)]
    if condition in UNKNOWN_AT_FIRST or stage.flag(0.6):
        conditions.append(_after(stage, stage.number(0.1, 2)))
    if stage.flag(0.3):
        conditions.append(CONDITIONS[stage.pick(*CONDITIONS)](stage, who))
    asked = _event("asked", ACTIONS[action](stage, who), conditions, stage, repeat=action not in ONCE)
    chain = element(
        "StoryboardElementStateCondition",
        storyboardElementType="event",
        storyboardElementRef="asked",
        state="startTransition",
    )
    then = element(
        "Condition", element("ByValueCondition", chain), name="then", conditionEdge="none", delay=stage.number(1, 4)
    )
    last = _event("last", ACTIONS[stage.pick(*COMMON)](stage, who), then)
    beside = _event("beside", ACTIONS[stage.pick(*COMMON)](stage, partner), _after(stage, stage.number(1, 5)))
    others = [partner] if stage.flag(0.8) else [partner, next(n for n in NAMES if n not in (who, partner))]
    groups = _group("own", [who], first, asked, last) + _group("theirs", others, beside)
    act = element("Act", groups, element("StartTrigger", _group_of(_after(stage, 0.0))), name="act")
    story = element("Story", act, name="story")
    stop = element("StopTrigger", _group_of(_after(stage, LAST)))
    storyboard = element("Storyboard", element("Init", element("Actions", *_init(stage, action))), story, stop)
    entities = element(
        "Entities", *(_vehicle(stage, name, action) for name in (*stage.start, *stage.absent)), *_trailers(stage)
    )
    parameters = element(
        "ParameterDeclarations",
        *(element("ParameterDeclaration", name=n, parameterType="int", value=v) for n, v in stage.declared.items()),
    )
    variables = element(
        "VariableDeclarations",
        *(element("VariableDeclaration", name=n, variableType="int", value=v) for n, v in stage.variables.items()),
    )
    head = element("FileHeader", revMajor=1, revMinor=3, date="2026-01-01T00:00:00", description=title, author="made")
    network = element("RoadNetwork", element("LogicFile", filepath="road.xodr"))
    parts = (head, parameters, variables, element("CatalogLocations"), network, entities, storyboard)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{element("OpenSCENARIO", *parts)}\n'


def _init(stage: Stage, action: str) -> list[str]:
    environment = element(
        "Environment",
        '<TimeOfDay animation="true" dateTime="2024-06-21T10:00:00"/>',
        name="day",
    )
    found = [element("GlobalAction", element("EnvironmentAction", environment))]
    for name, (lane, s, speed) in stage.start.items():
        offset = stage.number(-0.5, 0.5) if stage.flag(0.2) else None
        askew = [element("Orientation", type="relative", h=stage.number(-0.3, 0.3))] if stage.flag(0.08) else []
        place = element("LanePosition", *askew, roadId="1", laneId=lane, s=s, offset=offset)
        put = element("PrivateAction", element("TeleportAction", element("Position", place)))
        dynamics = element("SpeedActionDynamics", dynamicsShape="step", dynamicsDimension="time", value=0)
        target = element("SpeedActionTarget", element("AbsoluteTargetSpeed", value=speed))
        go = element("PrivateAction", element("LongitudinalAction", element("SpeedAction", dynamics, target)))
        found.append(element("Private", put, go, entityRef=name))
    for trailer, owner in stage.trailers.items():
        lane, s, _ = stage.start[owner]
        place = element("LanePosition", roadId="1", laneId=lane, s=s - 7.0)
        put = element("PrivateAction", element("TeleportAction", element("Position", place)))
        found.append(element("Private", put, entityRef=trailer))
    return found


def _vehicle(stage: Stage, name: str, action: str) -> str:
    extra = []
    if name == "Ego" and action.endswith("trailer"):
        extra.append(element("TrailerHitch", dx=-1.0))
        if action == "disconnect_trailer":
            drawn = _body("Tow", "trailer", [element("TrailerCoupler", dx=4.5)], 4.0)
            extra.append(element("Trailer", drawn.replace("ScenarioObject", "Trailer")))
    long = stage.pick(4.4, 4.9, 8.0)
    return _body(name, "car" if long < 6 else "truck", extra, long)


def _trailers(stage: Stage) -> list[str]:
    return [_body(name, "trailer", [element("TrailerCoupler", dx=4.5)], 4.0) for name in stage.trailers]


def _body(name: str, category: str, extra: list[str], long: float) -> str:
    box = element(
        "BoundingBox",
        element("Center", x=0.28 * long, y=0.0, z=0.75),
        element("Dimensions", width=1.9, length=long, height=1.5),
    )
    wheels = {"maxSteering": 0.5, "wheelDiameter": 0.7, "trackWidth": 1.6, "positionZ": 0.35}
    axles = element(
        "Axles",
        element("FrontAxle", **wheels, positionX=0.58 * long),
        element("RearAxle", **wheels, positionX=0.0),
    )
    limits = element("Performance", maxSpeed=60.0, maxAcceleration=8.0, maxDeceleration=9.0)
    return element(
        "ScenarioObject",
        element("Vehicle", box, limits, axles, element("Properties"), *extra, name=name, vehicleCategory=category),
        name=name,
    )


def _after(stage: Stage, seconds: float) -> str:
    inside = element("SimulationTimeCondition", value=seconds, rule="greaterOrEqual")
    return element("Condition", element("ByValueCondition", inside), name="t", conditionEdge="none", delay=0.0)


def _group_of(*conditions: str) -> str:
    return element("ConditionGroup", *conditions)


def _event(
    name: str, action: str, conditions: str | list[str], stage: Stage | None = None, *, repeat: bool = False
) -> str:
    priority = "parallel" if stage is None else stage.pick("override", "override", "parallel", "skip")
    groups = [_group_of(*([conditions] if isinstance(conditions, str) else conditions))]
    if stage is not None and stage.flag(0.4):
        groups.append(_group_of(_after(stage, stage.number(4, 8))))
    start = element("StartTrigger", *groups)
    count = None if stage is None or stage.flag(0.7) or not repeat else 2
    inside = element("Action", action, name=f"{name} action")
    return element("Event", inside, start, name=name, priority=priority, maximumExecutionCount=count)


def _group(name: str, who: list[str], *events: str) -> str:
    actors = element("Actors", *(element("EntityRef", entityRef=one) for one in who), selectTriggeringEntities=False)
    maneuver = element("Maneuver", *events, name=f"{name} maneuver")
    return element("ManeuverGroup", actors, maneuver, name=name, maximumExecutionCount=1)
