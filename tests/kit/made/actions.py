"""Every action of the table in docs/playing.md, with values that chance chooses."""

from __future__ import annotations

from collections.abc import Callable

from tests.kit.made.stage import Stage
from tests.kit.made.xml import element

Action = Callable[[Stage, str], str]
SHAPES = ("linear", "cubic", "sinusoidal", "step")


def _private(*inside: str) -> str:
    return element("PrivateAction", *inside)


def _longitudinal(inside: str) -> str:
    return _private(element("LongitudinalAction", inside))


def _lateral(inside: str) -> str:
    return _private(element("LateralAction", inside))


def _routing(inside: str) -> str:
    return _private(element("RoutingAction", inside))


def _dynamics(stage: Stage, tag: str, values: dict[str, tuple[float, float]]) -> str:
    dimension = stage.pick(*values)
    shape = stage.pick(*SHAPES[:3]) if stage.flag(0.9) else "step"
    return element(tag, dynamicsShape=shape, dynamicsDimension=dimension, value=stage.number(*values[dimension]))


def _limits(stage: Stage) -> str:
    return element(
        "DynamicConstraints",
        maxAcceleration=stage.number(1.5, 5),
        maxDeceleration=stage.number(2, 8),
        maxSpeed=stage.number(30, 50),
    )


def speed(stage: Stage, name: str) -> str:
    """Absolute or relative to somebody."""
    how = _dynamics(stage, "SpeedActionDynamics", {"time": (0.5, 6), "rate": (0.5, 6), "distance": (15, 80)})
    if stage.flag(0.6):
        target = element("AbsoluteTargetSpeed", value=stage.number(0, 40) if stage.flag(0.9) else 0.0)
    else:
        kind = stage.pick("delta", "factor")
        value = stage.number(-6, 6) if kind == "delta" else stage.number(0.5, 1.4)
        about = {"speedTargetValueType": kind, "value": value, "continuous": False}
        target = element("RelativeTargetSpeed", entityRef=stage.other(name), **about)
    return _longitudinal(element("SpeedAction", how, element("SpeedActionTarget", target)))


def speed_continuous(stage: Stage, name: str) -> str:
    """Somebody else's speed, for good."""
    about = {"speedTargetValueType": "delta", "value": stage.number(-4, 4), "continuous": True}
    target = element("RelativeTargetSpeed", entityRef=stage.other(name), **about)
    how = element("SpeedActionDynamics", dynamicsShape="linear", dynamicsDimension="time", value=stage.number(1, 4))
    return _longitudinal(element("SpeedAction", how, element("SpeedActionTarget", target)))


def speed_profile(stage: Stage, name: str) -> str:
    """Speeds at times."""
    entries = [
        element("SpeedProfileEntry", speed=stage.number(5, 35), time=stage.number(3, 7))
        for _ in range(int(stage.rng.integers(1, 4)))
    ]
    return _longitudinal(element("SpeedProfileAction", *entries, followingMode="position"))


def speed_profile_follow(stage: Stage, name: str) -> str:
    """Speeds at times, with limited jerk."""
    limits = element(
        "DynamicConstraints",
        **{"maxAcceleration": 6.0, "maxAccelerationRate": 5.0, "maxDeceleration": 8.0, "maxDecelerationRate": 6.0},
        maxSpeed=60.0,
    )
    entries = [element("SpeedProfileEntry", speed=stage.number(10, 30), time=stage.number(6, 9)) for _ in range(2)]
    return _longitudinal(element("SpeedProfileAction", limits, *entries, followingMode="follow"))


def longitudinal_distance(stage: Stage, name: str) -> str:
    """A distance or a time gap to somebody."""
    how = {"distance": stage.number(10, 40)} if stage.flag() else {"timeGap": stage.number(0.8, 2.5)}
    limits = [_limits(stage)] if stage.flag(0.8) else []
    return _longitudinal(
        element(
            "LongitudinalDistanceAction",
            *limits,
            entityRef=stage.other(name),
            continuous=stage.flag(),
            freespace=stage.flag(),
            displacement=stage.pick("any", "trailingReferencedEntity", "leadingReferencedEntity"),
            coordinateSystem=stage.pick(None, "entity", "lane", "road"),
            **how,
        )
    )


def lane_change(stage: Stage, name: str) -> str:
    """To a lane, or relative to somebody's."""
    dimensions = {"time": (1.5, 6), "rate": (0.6, 2.5), "distance": (30, 120)}
    how = _dynamics(stage, "LaneChangeActionDynamics", dimensions)
    target = element("AbsoluteTargetLane", value=stage.some_lane())
    if stage.flag(0.25):
        target = _relative_lane(stage, stage.pick(name, stage.other(name)))
    offset = stage.number(-0.7, 0.7) if stage.flag(0.3) else None
    return _lateral(element("LaneChangeAction", how, element("LaneChangeTarget", target), targetLaneOffset=offset))


def _relative_lane(stage: Stage, of: str) -> str:
    """One that is there, seen from where somebody starts; to the left of travel counts up, towards the middle."""
    lane = abs(stage.start[of][0])
    beside = [other for other in range(1, stage.map.lanes + 1) if other != lane]
    way = -1 if stage.map.left_hand else 1
    return element("RelativeTargetLane", entityRef=of, value=way * (lane - stage.pick(*beside)))


def lane_offset(stage: Stage, name: str) -> str:
    """Aside in the lane."""
    how = {"dynamicsShape": stage.pick(*SHAPES), "maxLateralAcc": stage.number(0.2, 1.5) if stage.flag(0.7) else None}
    if stage.flag(0.7):
        target = element("AbsoluteTargetLaneOffset", value=stage.number(-1.2, 1.2))
    else:
        target = element("RelativeTargetLaneOffset", entityRef=stage.other(name), value=stage.number(-1, 1))
    dynamics = element("LaneOffsetActionDynamics", **how)
    return _lateral(element("LaneOffsetAction", dynamics, element("LaneOffsetTarget", target), continuous=stage.flag()))


def lateral_distance(stage: Stage, name: str) -> str:
    """A distance beside somebody."""
    limits = [_limits(stage)] if stage.flag(0.7) else []
    system = stage.pick("entity", "road")  # the reference player knows no others, and no end in the entity's
    return _lateral(
        element(
            "LateralDistanceAction",
            *limits,
            entityRef=stage.other(name),
            distance=stage.number(2.5, 5),
            continuous=system == "entity" or stage.flag(),
            freespace=stage.flag(0.3),
            displacement=stage.pick("leftToReferencedEntity", "rightToReferencedEntity"),
            coordinateSystem=system,
        )
    )


def synchronize(stage: Stage, name: str) -> str:
    """At a place when the master is at another."""
    master = stage.other(name)
    theirs = element("TargetPositionMaster", stage.lane_position(master, 60, 140, stage.start[master][0]))
    own = element("TargetPosition", stage.lane_position(name, 60, 140, stage.start[name][0]))
    final: list[str] = []
    if stage.flag(0.7):
        value = stage.number(8, 30)
        speeds = (
            element("AbsoluteSpeed", value=value),
            element("RelativeSpeedToMaster", value=value - 18, speedTargetValueType="delta"),
        )
        final = [element("FinalSpeed", stage.pick(*speeds))]
    return _private(
        element(
            "SynchronizeAction",
            *(theirs, own, *final),
            masterEntityRef=master,
            targetToleranceMaster=stage.pick(None, 1.0),
            targetTolerance=stage.pick(None, 1.0),
        )
    )


def teleport(stage: Stage, name: str) -> str:
    """To any kind of place."""
    return _private(element("TeleportAction", element("Position", stage.position(name))))


def _follow(stage: Stage, shape: str, timed: bool) -> str:
    timing = element("None")
    if timed:
        kind = "relative" if stage.flag(0.8) else "absolute"
        scale = stage.pick(1.0, 1.0, 0.8, 1.3)
        timing = element("Timing", domainAbsoluteRelative=kind, scale=scale, offset=stage.pick(0.0, 0.5))
    trajectory = element("Trajectory", element("Shape", shape), name="way", closed=False)
    return _routing(
        element(
            "FollowTrajectoryAction",
            element("TrajectoryRef", trajectory),
            element("TimeReference", timing),
            element("TrajectoryFollowingMode", followingMode=stage.pick("position", "follow")),
            initialDistanceOffset=stage.number(0, 15) if stage.flag(0.2) else None,
        )
    )


def _at(x: float, y: float, heading: float | None) -> str:
    return element("Position", element("WorldPosition", x=x, y=y, h=heading))


def follow_polyline(stage: Stage, name: str) -> str:
    """Vertices ahead, with times or without."""
    timed, headings, spacing = stage.flag(), stage.flag(), stage.number(6, 20)
    pace = spacing / max(stage.start[name][2], 5.0)
    vertices = [
        element("Vertex", _at(x, y, h if headings else None), time=float(k * pace) if timed else None)
        for k, (x, y, h) in enumerate(stage.path(name, int(stage.rng.integers(3, 9)), spacing))
    ]
    return _follow(stage, element("Polyline", *vertices), timed)


def follow_clothoid(stage: Stage, name: str) -> str:
    """One clothoid, from where the lane lies ahead."""
    timed, length = stage.flag(), stage.number(60, 150)
    times = {"startTime": 0.0, "stopTime": length / max(stage.start[name][2], 5.0)} if timed else {}
    shape = element(
        "Clothoid",
        _at(*stage.path(name, 1, 1.0)[0]),
        curvature=stage.number(-1, 1) / 200,
        curvaturePrime=f"{stage.number(-1, 1) / 2e4:.8f}",
        length=length,
        **times,
    )
    return _follow(stage, shape, timed)


def follow_clothoid_spline(stage: Stage, name: str) -> str:
    """Clothoids one after another."""
    bends = [stage.number(-1, 1) / 200 for _ in range(3)]
    segments = [
        element(
            "ClothoidSplineSegment",
            *([element("PositionStart", element("WorldPosition", x=x, y=y, h=h))] if k == 0 else []),
            curvatureStart=bends[k],
            curvatureEnd=bends[k + 1],
            length=stage.number(20, 60),
        )
        for k, (x, y, h) in enumerate(stage.path(name, 1, 1.0) * 2)
    ]
    return _follow(stage, element("ClothoidSpline", *segments), timed=False)


def follow_nurbs(stage: Stage, name: str) -> str:
    """A curve of order 3 or 4."""
    order, count = stage.pick(3, 4), 6
    points = [element("ControlPoint", _at(x, y, None)) for x, y, _ in stage.path(name, count, stage.number(12, 20))]
    inner = count - order
    knots = [0.0] * order + [float(k + 1) for k in range(inner)] + [float(inner + 1)] * order
    return _follow(
        stage, element("Nurbs", *points, *(element("Knot", value=k) for k in knots), order=order), timed=False
    )


def assign_route(stage: Stage, name: str) -> str:
    """One of the ways."""
    return _routing(element("AssignRouteAction", stage.route(name)))


def acquire_position(stage: Stage, name: str) -> str:
    """A place on one of the ways."""
    road = stage.pick(*stage.map.ways)[-1]
    index = stage.network.index_of(road)
    place = element(
        "LanePosition", roadId=road, laneId=stage.start[name][0], s=min(290.0, stage.network.roads[index].length - 30)
    )
    return _routing(element("AcquirePositionAction", element("Position", place)))


def controllers(stage: Stage, name: str) -> str:
    """Activation alone: nothing is assigned."""
    inside = element("ActivateControllerAction", lateral=False, longitudinal=False)
    return _private(element("ControllerAction", inside))


def visibility(stage: Stage, name: str) -> str:
    """Seen or not."""
    return _private(element("VisibilityAction", graphics=stage.flag(), sensors=True, traffic=stage.flag()))


def lights(stage: Stage, name: str) -> str:
    """On or off."""
    kind = element("LightType", element("VehicleLight", vehicleLightType=stage.pick("brakeLights", "lowBeam")))
    action = element("LightStateAction", kind, element("LightState", mode=stage.pick("on", "off")), transitionTime=0.2)
    return _private(element("AppearanceAction", action))


def add_entity(stage: Stage, name: str) -> str:
    """Somebody who was not there."""
    late = stage.absent[0]
    inside = element("AddEntityAction", element("Position", stage.lane_position(name, 80, 200)))
    return element("GlobalAction", element("EntityAction", inside, entityRef=late))


def delete_entity(stage: Stage, name: str) -> str:
    """Somebody goes."""
    return element("GlobalAction", element("EntityAction", element("DeleteEntityAction"), entityRef=stage.other(name)))


def set_parameter(stage: Stage, name: str) -> str:
    """Of a parameter that a condition may look at."""
    inside = element("SetAction", value="2")
    if stage.flag():
        return element("GlobalAction", element("ParameterAction", inside, parameterRef="go"))
    return element("GlobalAction", element("VariableAction", inside, variableRef="count"))


def modify_variable(stage: Stage, name: str) -> str:
    """Add or multiply."""
    rule = stage.pick(element("AddValue", value=2.0), element("MultiplyByValue", value=3.0))
    change = element("ModifyAction", element("Rule", rule))
    return element("GlobalAction", element("VariableAction", change, variableRef="count"))


def environment(stage: Stage, name: str) -> str:
    """Weather."""
    weather = element("Weather", element("Wind", direction=1.0, speed=5.0), fractionalCloudCover="sixOktas")
    inside = element("Environment", weather, element("RoadCondition", frictionScaleFactor=0.8), name="wet")
    return element("GlobalAction", element("EnvironmentAction", inside))


def user_defined(stage: Stage, name: str) -> str:
    """Nobody knows it."""
    return element("UserDefinedAction", '<CustomCommandAction type="note">nothing</CustomCommandAction>')


def connect_trailer(stage: Stage, name: str) -> str:
    """What stands behind is drawn along."""
    trailer = next(iter(stage.trailers), None)
    assert trailer is not None
    return _private(element("TrailerAction", element("ConnectTrailerAction", trailerRef=trailer)))


def disconnect_trailer(stage: Stage, name: str) -> str:
    """What is drawn along rolls on."""
    return _private(element("TrailerAction", element("DisconnectTrailerAction")))


ACTIONS: dict[str, Action] = {
    one.__name__: one
    for one in (
        *(speed, speed_continuous, speed_profile, speed_profile_follow, longitudinal_distance),
        *(lane_change, lane_offset, lateral_distance, synchronize, teleport),
        *(follow_polyline, follow_clothoid, follow_clothoid_spline, follow_nurbs, assign_route, acquire_position),
        *(controllers, visibility, lights, add_entity, delete_entity, set_parameter, modify_variable),
        *(environment, user_defined, connect_trailer, disconnect_trailer),
    )
}
COMMON = ("speed", "lane_change", "lane_offset", "speed_profile", "longitudinal_distance", "speed_continuous")
