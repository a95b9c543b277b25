"""Every condition of the table in docs/playing.md that the reference player has, with values that chance chooses.

It has no `TimeOfDayCondition` and no `UserDefinedValueCondition` (left out of their groups there), and no
`RelativeAngleCondition` (an error there).
"""

from __future__ import annotations

from collections.abc import Callable

from tests.kit.made.stage import Stage
from tests.kit.made.xml import element

Condition = Callable[[Stage, str], str]
GREATER, LESS = ("greaterThan", "greaterOrEqual"), ("lessThan", "lessOrEqual")


def _entity(stage: Stage, name: str, inside: str, *, alone: bool = False) -> str:
    names = [name] if alone or stage.flag(0.8) else [name, stage.other(name)]
    refs = (element("EntityRef", entityRef=one) for one in names)
    actors = element("TriggeringEntities", *refs, triggeringEntitiesRule=stage.pick("any", "all"))
    return _wrapped(stage, element("ByEntityCondition", actors, element("EntityCondition", inside)))


def _value(stage: Stage, inside: str) -> str:
    return _wrapped(stage, element("ByValueCondition", inside))


def _wrapped(stage: Stage, inside: str) -> str:
    edge = stage.pick("none", "none", "none", "rising", "risingOrFalling")
    late = stage.number(0.2, 1.5) if stage.flag(0.3) else 0.0
    return element("Condition", inside, name="c", conditionEdge=edge, delay=late)


def _system(stage: Stage) -> dict[str, object]:
    """A coordinate system and a kind of distance."""
    kind = stage.pick(None, "euclidianDistance", "longitudinal", "lateral", "longitudinal")
    return {"coordinateSystem": stage.pick(None, "entity", "lane", "road"), "relativeDistanceType": kind}


def simulation_time(stage: Stage, name: str) -> str:
    return _value(stage, element("SimulationTimeCondition", value=stage.number(0.5, 4), rule=stage.pick(*GREATER)))


def traveled_distance(stage: Stage, name: str) -> str:
    return _entity(stage, name, element("TraveledDistanceCondition", value=stage.number(10, 80)))


def speed(stage: Stage, name: str) -> str:
    v = stage.start[name][2]
    how = {"rule": stage.pick(*GREATER, *LESS), "value": v + stage.number(-2, 2)}
    return _entity(stage, name, element("SpeedCondition", **how, direction=stage.pick(None, "longitudinal")))


def relative_speed(stage: Stage, name: str) -> str:
    how = {"rule": stage.pick(*GREATER, *LESS), "value": stage.number(-4, 4)}
    return _entity(stage, name, element("RelativeSpeedCondition", entityRef=stage.other(name), **how))


def acceleration(stage: Stage, name: str) -> str:
    how = {"rule": stage.pick(*GREATER, *LESS), "value": stage.number(0.2, 2)}
    return _entity(stage, name, element("AccelerationCondition", **how, direction=stage.pick(None, "longitudinal")))


def time_headway(stage: Stage, name: str) -> str:
    how = {"rule": stage.pick(*GREATER, *LESS), "value": stage.number(0.5, 3), "freespace": stage.flag()}
    return _entity(stage, name, element("TimeHeadwayCondition", entityRef=stage.other(name), **how, **_system(stage)))


def time_to_collision(stage: Stage, name: str) -> str:
    target = element("EntityRef", entityRef=stage.other(name))
    if stage.flag(0.3):
        target = element("Position", stage.lane_position(name, 80, 200))
    how = {"rule": stage.pick(*LESS), "value": stage.number(2, 8), "freespace": stage.flag()}
    inside = element("TimeToCollisionConditionTarget", target)
    return _entity(stage, name, element("TimeToCollisionCondition", inside, **how, **_system(stage)))


def distance(stage: Stage, name: str) -> str:
    how = {"rule": stage.pick(*LESS, *GREATER), "value": stage.number(10, 60), "freespace": stage.flag(0.3)}
    inside = element("Position", stage.position(name, 60, 160))
    return _entity(stage, name, element("DistanceCondition", inside, **how, **_system(stage)))


def relative_distance(stage: Stage, name: str) -> str:
    how = {"rule": stage.pick(*LESS, *GREATER), "value": stage.number(8, 50), "freespace": stage.flag()}
    system = {"relativeDistanceType": "longitudinal", "coordinateSystem": None} | _system(stage)
    system["relativeDistanceType"] = system["relativeDistanceType"] or "longitudinal"
    return _entity(stage, name, element("RelativeDistanceCondition", entityRef=stage.other(name), **how, **system))


def reach_position(stage: Stage, name: str) -> str:
    place = stage.lane_position(name, 30, 100, stage.start[name][0])
    inside = element("ReachPositionCondition", element("Position", place), tolerance=stage.number(1, 5))
    return _entity(stage, name, inside, alone=True)  # of several, the reference player remembers the one before


def stand_still(stage: Stage, name: str) -> str:
    return _entity(stage, name, element("StandStillCondition", duration=stage.number(0.2, 1)))


def end_of_road(stage: Stage, name: str) -> str:
    return _entity(stage, name, element("EndOfRoadCondition", duration=stage.number(0.2, 1)))


def offroad(stage: Stage, name: str) -> str:
    return _entity(stage, name, element("OffroadCondition", duration=stage.number(0.1, 0.5)))


def collision(stage: Stage, name: str) -> str:
    target = element("EntityRef", entityRef=stage.other(name))
    if stage.flag(0.3):
        target = element("ByType", type="vehicle")
    return _entity(stage, name, element("CollisionCondition", target))


def clearance(stage: Stage, name: str) -> str:
    lanes = element("RelativeLaneRange", **{"from": -1, "to": 1})
    how = {"oppositeLanes": False, "freeSpace": stage.flag()}
    far = {"distanceForward": stage.number(10, 40), "distanceBackward": stage.number(5, 20)}
    return _entity(stage, name, element("RelativeClearanceCondition", lanes, **far, **how))


def variable(stage: Stage, name: str) -> str:
    return _value(stage, element("VariableCondition", variableRef="count", value="1", rule="greaterThan"))


def parameter(stage: Stage, name: str) -> str:
    return _value(stage, element("ParameterCondition", parameterRef="go", value="1", rule="equalTo"))


def element_state(stage: Stage, name: str) -> str:
    what = stage.pick(("startTransition", 0), ("runningState", 0), ("endTransition", 1), ("completeState", 1))
    inside = {"storyboardElementType": "event", "storyboardElementRef": "first", "state": what[0]}
    return _value(stage, element("StoryboardElementStateCondition", **inside))


def angle(stage: Stage, name: str) -> str:
    how = {"angleType": "heading", "angle": stage.pick(0.0, 0.1), "angleTolerance": stage.number(0.05, 0.3)}
    return _entity(stage, name, element("AngleCondition", **how, coordinateSystem=stage.pick(None, "lane", "road")))


CONDITIONS: dict[str, Condition] = {
    one.__name__: one
    for one in (
        *(simulation_time, traveled_distance, speed, relative_speed, acceleration, time_headway, time_to_collision),
        *(distance, relative_distance, reach_position, stand_still, end_of_road, offroad, collision, clearance),
        *(variable, parameter, element_state, angle),
    )
}
