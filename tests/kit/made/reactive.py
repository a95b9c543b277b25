"""Scenarios in which what others do depends on a vehicle under test, by every kind of trigger; some in NCAP's shape.

`Ego` drives in the middle lane of a motorway and has an external controller. Others brake, cut in and out, overtake,
begin again, give up half-way.
"""

from __future__ import annotations

from collections.abc import Iterator

from tests.kit.made.roads import Map, road
from tests.kit.made.roads import plan_view as _plan_view
from tests.kit.made.xml import element

Car = tuple[str, int, float, float]
"""Name, lane, s [m], speed [m/s]."""


def reactive_scenarios() -> Iterator[tuple[str, str, str]]:
    """Name, road and scenario of each."""
    straight, bends = _motorway("RHT", bends=False), _motorway("RHT", bends=True)
    for name, cars, groups, stop in _cases():
        yield name, bends if "bend" in name else straight, _scenario(cars, groups, stop)
    mirrored = [(name, -lane, s, speed) for name, lane, s, speed in (EGO, ("T", -1, 140.0, 20.0))]
    cut_in = _group("T", _event("cut in", _ttc("Ego", "T", 3.0), _change(2, 4)))
    yield (
        "left hand cut in by ttc",
        _motorway("LHT", bends=False),
        _scenario(mirrored, [cut_in], _travelled("Ego", 700)),
    )


EGO: Car = ("Ego", -2, 100.0, 25.0)


def _cases() -> Iterator[tuple[str, list[Car], list[str], str]]:
    end = _time(32)
    left = ("T", -1, 140.0, 20.0)
    far = _travelled("Ego", 700)
    cut_in = _event("cut in", _ttc("Ego", "T", 3.0), _change(-2, 4))

    yield "ccrs, standing target", [EGO, ("T", -2, 900.0, 0.0), ("U", -1, 120.0, 27.0)], [], _ttc("Ego", "T", 1.0)
    yield "ccrm, slower target", [EGO, ("T", -2, 260.0, 15.0)], [], _or(_ttc("Ego", "T", 1.0), _time(30))
    brake = _event("brake", _distance("Ego", "T", 40, "lessThan"), _speed(3, 4))
    yield "ccrb, brakes by distance", [EGO, ("T", -2, 150.0, 24.0)], [_group("T", brake)], _time(20)
    brake = _event("brake", _headway("Ego", "T", 1.4), _speed(12, 3))
    yield "brakes by headway in a bend", [EGO, ("T", -2, 160.0, 23.0)], [_group("T", brake)], end
    yield "cut in by ttc", [EGO, left], [_group("T", cut_in)], far
    yield "cut in by ttc in a bend", [EGO, left], [_group("T", cut_in)], far
    event = _event("cut in", _distance("Ego", "T", 25, "lessThan"), _change(-2, 3))
    yield "cut in by distance", [EGO, ("T", -3, 170.0, 21.0)], [_group("T", event)], far
    brake = _event("brake", _state("cut in", "endTransition"), _speed(15, 3))
    yield "cut in and brake", [EGO, left], [_group("T", cut_in, brake)], end
    event = _event("cut out", _headway("Ego", "T", 1.5), _change(-1, 3))
    yield "cut out by headway", [EGO, ("T", -2, 170.0, 22.0), ("U", -2, 800.0, 0.0)], [_group("T", event)], _time(24)
    event = _event("cut in", _reach("Ego", 400.0), _change(-2, 4))
    yield "cut in where ego arrives", [EGO, ("T", -1, 130.0, 25.0)], [_group("T", event)], far
    event = _event("cut in", _travelled("Ego", 250), _change(-2, 4, "cubic"))
    yield "cut in after ego has driven", [EGO, ("T", -3, 135.0, 25.0)], [_group("T", event)], far
    event = _event("cut in", _faster("Ego", 28.0), _change(-2, 4))
    yield "cut in when ego is fast", [EGO, ("T", -1, 140.0, 27.0)], [_group("T", event)], end
    out = _event("out", _headway("T", "Ego", 1.0), _change(-1, 4))
    back = _event("back", _distance("Ego", "T", 30, "greaterThan"), _change(-2, 4), after="out")
    yield "overtakes ego", [EGO, ("T", -2, 30.0, 33.0)], [_group("T", out, back)], end
    event = _event("back", _state("cut in", "startTransition", delay=1.7), _change(-1, 3))
    yield "gives up the cut in after a time", [EGO, left], [_group("T", cut_in, event)], end
    event = _event("back", _ttc("Ego", "T", 2.2), _change(-1, 3), after="cut in", state="startTransition")
    yield "gives up the cut in by ttc", [EGO, left], [_group("T", cut_in, event)], end
    event = _event("swerve", _state("cut in", "startTransition", delay=1.5), _offset(0.4))
    yield "stays between lanes for an offset", [EGO, left], [_group("T", cut_in, event)], end
    halt = _ttc("Ego", "T", 2.4)
    yield "act stopped half-way", [EGO, left], [_act("halting", _maneuvers("T", cut_in), halt)], end
    out = _event("out", _distance("Ego", "T", 50, "lessThan"), _change(-1, 3))
    back = _event("back", _state("out", "endTransition", delay=2.0), _change(-2, 3))
    yield "weaves three times", [EGO, ("T", -2, 160.0, 24.0)], [_group("T", out, back, count=3)], end
    event = _event("touch", _distance("Ego", "T", 45, "lessThan", edge="rising"), _speed_step(27), count=3)
    slow = _event("slow", _distance("Ego", "T", 55, "greaterThan", edge="rising"), _speed_step(22), count=3)
    yield "keeps its distance by steps", [EGO, ("T", -2, 160.0, 22.0)], [_group("T", event, slow)], _time(40)
    first = _event("first", _headway("Ego", "T", 1.8), _change(-1, 5))
    second = _event("second", _headway("Ego", "T", 1.5), _change(-3, 5), priority="skip")
    yield "the second is skipped", [EGO, ("T", -2, 160.0, 22.0)], [_group("T", first, second)], end
    second = _event("second", _headway("Ego", "T", 1.6), _speed(30, 2), priority="parallel")
    yield "both at the same time", [EGO, ("T", -2, 160.0, 22.0)], [_group("T", first, second)], end
    stop = _event("stop", _headway("Ego", "T", 1.4), _speed(2, 5))
    go = _event("go", _state("stop", "endTransition", delay=1.0), _speed(24, 3))
    yield "slows down and drives on", [EGO, ("T", -1, 150.0, 22.0)], [_group("T", stop, go)], _time(36)
    go = _event("go", _distance("Ego", "T", 120, "lessThan"), _speed(25, 3))
    merge = _event("merge", _state("go", "endTransition"), _change(-2, 4))
    yield "sets off and merges", [EGO, ("T", -3, 320.0, 0.0)], [_group("T", go, merge)], _time(40)
    others: list[Car] = [("T", -1, 140.0, 21.0), ("U", -2, 220.0, 24.0)]
    event = _event("brake", _state("cut in", "endTransition"), _speed(16, 2))
    yield "one waits for the other", [EGO, *others], [_group("T", cut_in), _group("U", event)], end
    event = _event("swerve", _distance("Ego", "T", 35, "lessThan"), _offset(0.5))
    back = _event("back", _state("swerve", "endTransition", delay=1.0), _offset(0.0))
    yield "swerves and comes back", [EGO, ("T", -2, 160.0, 22.0)], [_group("T", event, back)], end
    event = _event("return", _headway("Ego", "T", 2.0), _change(-1, 4))
    yield "returns from the oncoming lane", [EGO, ("T", 1, 160.0, 22.0)], [_group("T", event)], end
    column: list[Car] = [(f"T{k}", -1 - k % 3, 130.0 + 35.0 * k, 21.0 + k % 4) for k in range(8)]
    brakes = [_group(f"T{k}", _event(f"brake {k}", _headway("Ego", f"T{k}", 2.0), _speed(18, 2))) for k in range(8)]
    yield "a column of eight", [EGO, *column], brakes, end
    event = _event("cut in", _distance("Ego", "T", 10, "lessThan"), _change(-2, 4))
    again = _event("out", _state("cut in", "endTransition", delay=3.0), _change(-3, 4))
    yield "crosses in front of ego", [EGO, ("T", -1, 150.0, 22.0)], [_group("T", event, again)], end


def _motorway(rule: str, *, bends: bool) -> str:
    pieces = [("line", 250.0, 0.0, 0.0), ("spiral", 100.0, 0.0, 1 / 700), ("arc", 500.0, 1 / 700, 1 / 700)]
    pieces += [("spiral", 200.0, 1 / 700, -1 / 800), ("arc", 1500.0, -1 / 800, -1 / 800)]
    view, length, _ = _plan_view(pieces if bends else [("line", 2600.0, 0.0, 0.0)], (0.0, 0.0, 0.2))
    return Map([road("1", view, length, 3, rule=rule)], 3, rule == "LHT").xml()


def _scenario(cars: list[Car], acts: list[str], stop: str) -> str:
    header = element(
        "FileHeader", revMajor=1, revMinor=1, date="2026-01-01T00:00:00", description="made", author="made"
    )
    network = element("RoadNetwork", element("LogicFile", filepath="road.xodr"))
    init = element("Init", element("Actions", *(_start(*car) for car in cars)))
    story = element("Story", *(f"<!-- {k} -->{act}" for k, act in enumerate(acts)), name="story") if acts else ""
    board = element("Storyboard", init, story, element("StopTrigger", stop))
    entities = element("Entities", *(_entity(name) for name, *_ in cars))
    empty = "<CatalogLocations/>"
    return f'<?xml version="1.0"?>\n{element("OpenSCENARIO", header, empty, network, entities, board)}'


def _entity(name: str) -> str:
    box = element(
        "BoundingBox", element("Center", x=1.4, y=0, z=0.9), element("Dimensions", width=1.9, length=4.8, height=1.6)
    )
    limits = element("Performance", maxSpeed=70, maxAcceleration=9, maxDeceleration=10)
    axle = {"maxSteering": 0.5, "wheelDiameter": 0.7, "trackWidth": 1.6, "positionZ": 0.35}
    axles = element("Axles", element("FrontAxle", positionX=2.8, **axle), element("RearAxle", positionX=0, **axle))
    car = element("Vehicle", box, limits, axles, "<Properties/>", name="car", vehicleCategory="car")
    own = element("Properties", element("Property", name="esminiController", value="ExternalController"))
    controller = element("ObjectController", element("Controller", own, name="driver")) if name == "Ego" else ""
    return element("ScenarioObject", car, controller, name=name)


def _start(name: str, lane: int, s: float, speed: float) -> str:
    turned = element("Orientation", type="absolute", h=0.2) if lane > 0 else ""  # along s, whatever the hand
    place = f'<LanePosition roadId="1" laneId="{lane}" s="{s}">{turned}</LanePosition>'
    actions = [element("TeleportAction", element("Position", place)), _speed_step(speed)]
    if name == "Ego":
        actions.append(
            element("ControllerAction", element("ActivateControllerAction", longitudinal=True, lateral=True))
        )
    return element("Private", *(_private(action) for action in actions), entityRef=name)


def _private(action: str) -> str:
    return action if action.startswith("<PrivateAction") else element("PrivateAction", action)


def _maneuvers(actor: str, *events: str, count: int = 1) -> str:
    actors = element("Actors", element("EntityRef", entityRef=actor), selectTriggeringEntities=False)
    maneuver = element("Maneuver", *events, name=f"maneuver of {actor}")
    return element("ManeuverGroup", actors, maneuver, name=f"group of {actor}", maximumExecutionCount=count)


def _group(actor: str, *events: str, count: int = 1) -> str:
    return _act(f"act of {actor}", _maneuvers(actor, *events, count=count))


def _act(name: str, group: str, stop: str = "") -> str:
    start = element("StartTrigger", _time(0))
    return element("Act", group, start, element("StopTrigger", stop) if stop else "", name=name)


def _event(
    name: str,
    trigger: str,
    action: str,
    *,
    priority: str = "overwrite",
    count: int = 1,
    after: str = "",
    state: str = "endTransition",
) -> str:
    """`after`: not before another event has got to a state."""
    done = "completeState" if state == "endTransition" else "runningState"
    both = trigger.replace("</ConditionGroup>", _of_state(after, done) + "</ConditionGroup>") if after else trigger
    content = element("Action", _private(action), name=f"{name} action")
    start = element("StartTrigger", both)
    return element("Event", content, start, name=name, priority=priority, maximumExecutionCount=count)


# ---- actions
def _change(lane: int, seconds: float, shape: str = "sinusoidal") -> str:
    how = element("LaneChangeActionDynamics", dynamicsShape=shape, value=float(seconds), dynamicsDimension="time")
    where = element("LaneChangeTarget", element("AbsoluteTargetLane", value=lane))
    return element("LateralAction", element("LaneChangeAction", how, where))


def _offset(value: float) -> str:
    how = element("LaneOffsetActionDynamics", dynamicsShape="sinusoidal", maxLateralAcc=0.8)
    where = element("LaneOffsetTarget", element("AbsoluteTargetLaneOffset", value=value))
    return element("LateralAction", element("LaneOffsetAction", how, where, continuous=False))


def _speed(target: float, rate: float) -> str:
    return _change_of_speed(target, dynamicsShape="linear", value=float(rate), dynamicsDimension="rate")


def _speed_step(target: float) -> str:
    return _change_of_speed(target, dynamicsShape="step", value=0.0, dynamicsDimension="time")


def _change_of_speed(target: float, **how: object) -> str:
    to = element("SpeedActionTarget", element("AbsoluteTargetSpeed", value=float(target)))
    return element("LongitudinalAction", element("SpeedAction", element("SpeedActionDynamics", **how), to))


# ---- conditions
def _condition(content: str, delay: float = 0.0, edge: str = "none") -> str:
    return element("Condition", content, name="when", delay=float(delay), conditionEdge=edge)


def _or(*triggers: str) -> str:
    return "".join(triggers)


def _time(value: float) -> str:
    content = element("SimulationTimeCondition", value=float(value), rule="greaterThan")
    return element("ConditionGroup", _condition(element("ByValueCondition", content)))


def _of_state(name: str, state: str, delay: float = 0.0) -> str:
    content = element(
        "StoryboardElementStateCondition", storyboardElementType="event", storyboardElementRef=name, state=state
    )
    return _condition(element("ByValueCondition", content), delay)


def _state(name: str, state: str, delay: float = 0.0) -> str:
    return element("ConditionGroup", _of_state(name, state, delay))


def _by_entity(who: str, content: str, edge: str = "none") -> str:
    triggering = element("TriggeringEntities", element("EntityRef", entityRef=who), triggeringEntitiesRule="any")
    by_entity = element("ByEntityCondition", triggering, element("EntityCondition", content))
    return element("ConditionGroup", _condition(by_entity, edge=edge))


_ALONG = {"freespace": True, "coordinateSystem": "road", "relativeDistanceType": "longitudinal"}


def _headway(who: str, other: str, value: float, rule: str = "lessThan") -> str:
    return _by_entity(who, element("TimeHeadwayCondition", entityRef=other, value=value, rule=rule, **_ALONG))


def _ttc(who: str, other: str, value: float) -> str:
    target = element("TimeToCollisionConditionTarget", element("EntityRef", entityRef=other))
    return _by_entity(who, element("TimeToCollisionCondition", target, value=value, rule="lessThan", **_ALONG))


def _distance(who: str, other: str, value: float, rule: str, edge: str = "none") -> str:
    content = element("RelativeDistanceCondition", entityRef=other, value=float(value), rule=rule, **_ALONG)
    return _by_entity(who, content, edge)


def _reach(who: str, s: float) -> str:
    place = element("Position", element("LanePosition", roadId=1, laneId=-2, s=s))
    return _by_entity(who, element("ReachPositionCondition", place, tolerance=2.0))


def _travelled(who: str, value: float) -> str:
    return _by_entity(who, element("TraveledDistanceCondition", value=float(value)))


def _faster(who: str, value: float) -> str:
    return _by_entity(who, element("SpeedCondition", value=value, rule="greaterThan"))
