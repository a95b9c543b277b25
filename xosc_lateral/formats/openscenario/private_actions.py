"""Private actions, one reader for each element."""

from __future__ import annotations

from collections.abc import Callable

from xosc_lateral.formats.openscenario.context import Context
from xosc_lateral.formats.openscenario.element import XmlElement
from xosc_lateral.formats.openscenario.entities import read_controller
from xosc_lateral.formats.openscenario.positions import (
    read_position,
    read_position_in,
    read_route,
    read_trajectory,
)
from xosc_lateral.scenario.enums import (
    CoordinateSystem,
    DynamicsDimension,
    DynamicsShape,
    FollowingMode,
    LateralDisplacement,
    LongitudinalDisplacement,
    ReferenceContext,
    SpeedTargetValueType,
)
from xosc_lateral.scenario.place import Content
from xosc_lateral.scenario.position import Timing
from xosc_lateral.scenario.private_actions import (
    AbsoluteSpeed,
    AbsoluteTargetLane,
    AbsoluteTargetLaneOffset,
    AbsoluteTargetSpeed,
    AcquirePositionAction,
    ActivateControllerAction,
    AnimationAction,
    AssignControllerAction,
    AssignRouteAction,
    ConnectTrailerAction,
    DisconnectTrailerAction,
    DynamicConstraints,
    FollowTrajectoryAction,
    LaneChangeAction,
    LaneOffsetAction,
    LateralDistanceAction,
    LightStateAction,
    LongitudinalDistanceAction,
    OverrideControllerValueAction,
    RelativeSpeedToMaster,
    RelativeTargetLane,
    RelativeTargetLaneOffset,
    RelativeTargetSpeed,
    SpeedAction,
    SpeedProfileAction,
    SpeedProfileEntry,
    SteadyState,
    SynchronizeAction,
    TeleportAction,
    TransitionDynamics,
    VisibilityAction,
)


def _teleport(e: XmlElement, context: Context) -> Content:
    # 1.0 files in the field put the position right into the action.
    owner = e.child("Position")
    return TeleportAction(read_position(owner or e, context), e.place())


def _speed(e: XmlElement, context: Context) -> Content:
    target = e.required("SpeedActionTarget").required("AbsoluteTargetSpeed", "RelativeTargetSpeed")
    dynamics = _transition(e.required("SpeedActionDynamics"))
    if target.tag == "AbsoluteTargetSpeed":
        return SpeedAction(AbsoluteTargetSpeed(target.number("value")), dynamics, e.place())
    relative = RelativeTargetSpeed(
        context.entity(target),
        target.number("value"),
        target.choice("speedTargetValueType", SpeedTargetValueType, SpeedTargetValueType.DELTA),
        target.boolean("continuous", False),
    )
    return SpeedAction(relative, dynamics, e.place())


def _speed_profile(e: XmlElement, context: Context) -> Content:
    entries = tuple(
        SpeedProfileEntry(entry.number("speed"), entry.optional_number("time"))
        for entry in e.children("SpeedProfileEntry")
    )
    if not entries:
        e.fail("a speed profile needs an entry")
    return SpeedProfileAction(
        entries,
        e.choice("followingMode", FollowingMode, FollowingMode.POSITION),
        e.place(),
        context.entity(e) if e.optional_text("entityRef") else None,
        _constraints(e),
    )


def _longitudinal_distance(e: XmlElement, context: Context) -> Content:
    return LongitudinalDistanceAction(
        context.entity(e),
        e.boolean("continuous", False),
        e.boolean("freespace", False),
        e.place(),
        e.optional_number("distance"),
        e.optional_number("timeGap"),
        e.optional_choice("displacement", LongitudinalDisplacement),
        e.optional_choice("coordinateSystem", CoordinateSystem),
        _constraints(e),
    )


def _lane_change(e: XmlElement, context: Context) -> Content:
    target = e.required("LaneChangeTarget").required("AbsoluteTargetLane", "RelativeTargetLane")
    lane: AbsoluteTargetLane | RelativeTargetLane
    if target.tag == "AbsoluteTargetLane":
        lane = AbsoluteTargetLane(target.integer("value"))
    else:
        lane = RelativeTargetLane(context.entity(target), target.integer("value"))
    return LaneChangeAction(
        lane,
        _transition(e.required("LaneChangeActionDynamics")),
        e.place(),
        e.number("targetLaneOffset", 0.0),
    )


def _lane_offset(e: XmlElement, context: Context) -> Content:
    target = e.required("LaneOffsetTarget").required("AbsoluteTargetLaneOffset", "RelativeTargetLaneOffset")
    offset: AbsoluteTargetLaneOffset | RelativeTargetLaneOffset
    value = -target.number("value") if context.left_handed else target.number("value")
    if target.tag == "AbsoluteTargetLaneOffset":
        offset = AbsoluteTargetLaneOffset(value)
    else:
        offset = RelativeTargetLaneOffset(context.entity(target), value)
    dynamics = e.required("LaneOffsetActionDynamics")
    return LaneOffsetAction(
        offset,
        dynamics.choice("dynamicsShape", DynamicsShape, DynamicsShape.STEP),
        e.boolean("continuous", False),
        e.place(),
        dynamics.optional_number("maxLateralAcc", finite=False),
    )


def _lateral_distance(e: XmlElement, context: Context) -> Content:
    return LateralDistanceAction(
        context.entity(e),
        e.boolean("continuous", False),
        e.boolean("freespace", False),
        e.place(),
        e.optional_number("distance"),
        e.choice("displacement", LateralDisplacement, LateralDisplacement.ANY),
        e.optional_choice("coordinateSystem", CoordinateSystem),
        _constraints(e),
    )


def _synchronize(e: XmlElement, context: Context) -> Content:
    return SynchronizeAction(
        context.entity(e, "masterEntityRef"),
        read_position(e.required("TargetPositionMaster"), context),
        read_position(e.required("TargetPosition"), context),
        e.place(),
        _final_speed(e),
        e.optional_number("targetToleranceMaster"),
        e.optional_number("targetTolerance"),
    )


def _final_speed(e: XmlElement) -> AbsoluteSpeed | RelativeSpeedToMaster | None:
    owner = e.child("FinalSpeed")
    if owner is None:
        return None
    speed = owner.required("AbsoluteSpeed", "RelativeSpeedToMaster")
    steady = speed.child("TargetDistanceSteadyState", "TargetTimeSteadyState")
    state = None if steady is None else SteadyState(steady.optional_number("distance"), steady.optional_number("time"))
    if speed.tag == "AbsoluteSpeed":
        return AbsoluteSpeed(speed.number("value"), state)
    kind = speed.choice("speedTargetValueType", SpeedTargetValueType, SpeedTargetValueType.DELTA)
    return RelativeSpeedToMaster(speed.number("value"), kind, state)


def _follow_trajectory(e: XmlElement, context: Context) -> Content:
    mode = e.child("TrajectoryFollowingMode")
    return FollowTrajectoryAction(
        read_trajectory(e, context),
        _timing(e),
        FollowingMode.FOLLOW if mode is None else mode.choice("followingMode", FollowingMode, FollowingMode.FOLLOW),
        e.place(),
        e.number("initialDistanceOffset", 0.0),
    )


def _timing(e: XmlElement) -> Timing | None:
    reference = e.child("TimeReference")
    timing = None if reference is None else reference.child("Timing")
    if timing is None:
        return None
    return Timing(
        timing.choice("domainAbsoluteRelative", ReferenceContext, ReferenceContext.ABSOLUTE),
        timing.number("scale", 1.0),
        timing.number("offset", 0.0),
    )


def _assign_route(e: XmlElement, context: Context) -> Content:
    return AssignRouteAction(read_route(e, context), e.place())


def _acquire_position(e: XmlElement, context: Context) -> Content:
    return AcquirePositionAction(read_position_in(e, context), e.place())


def _assign_controller(e: XmlElement, context: Context) -> Content:
    return AssignControllerAction(
        read_controller(e, context),
        e.place(),
        e.optional_boolean("activateLateral"),
        e.optional_boolean("activateLongitudinal"),
    )


def _activate_controller(e: XmlElement, _: Context) -> Content:
    return ActivateControllerAction(
        e.place(),
        e.optional_boolean("lateral"),
        e.optional_boolean("longitudinal"),
        e.optional_text("objectControllerRef") or e.optional_text("controllerRef"),
    )


def _override(e: XmlElement, _: Context) -> Content:
    overrides = tuple((item.tag, item.boolean("active", False), item.optional_number("value")) for item in e.children())
    return OverrideControllerValueAction(overrides, e.place())


def _visibility(e: XmlElement, _: Context) -> Content:
    return VisibilityAction(
        e.boolean("graphics", True), e.boolean("sensors", True), e.boolean("traffic", True), e.place()
    )


def _light_state(e: XmlElement, _: Context) -> Content:
    kind, state = e.child("LightType"), e.child("LightState")
    light = None if kind is None else kind.child()
    name = "" if light is None else light.optional_text("vehicleLightType") or light.text("userDefinedLightType", "")
    mode = "" if state is None else state.text("mode", "")
    return LightStateAction(name, mode, e.place(), e.number("transitionTime", 0.0))


def _animation(e: XmlElement, _: Context) -> Content:
    owner = e.child("AnimationType")
    content = None if owner is None else owner.child()
    return AnimationAction(
        content.tag if content else "", e.place(), e.boolean("loop", False), e.number("animationDuration", 0.0)
    )


def _connect_trailer(e: XmlElement, context: Context) -> Content:
    return ConnectTrailerAction(context.entity(e, "trailerRef"), e.place())


def _disconnect_trailer(e: XmlElement, _: Context) -> Content:
    return DisconnectTrailerAction(e.place())


def _transition(e: XmlElement) -> TransitionDynamics:
    shape = e.choice("dynamicsShape", DynamicsShape, DynamicsShape.STEP)
    # The reference player takes a missing dimension for time; a step has no use for either.
    dimension = e.choice("dynamicsDimension", DynamicsDimension, DynamicsDimension.TIME)
    value = e.number("value", 0.0 if shape is DynamicsShape.STEP else None, finite=False)
    return TransitionDynamics(shape, dimension, value, e.choice("followingMode", FollowingMode, FollowingMode.POSITION))


def _constraints(owner: XmlElement) -> DynamicConstraints | None:
    element = owner.child("DynamicConstraints")
    if element is None:
        return None
    names = ("maxAcceleration", "maxDeceleration", "maxSpeed", "maxAccelerationRate", "maxDecelerationRate")
    return DynamicConstraints(*(element.optional_number(name, finite=False) for name in names))


PRIVATE_ACTIONS: dict[str, Callable[[XmlElement, Context], Content]] = {
    "TeleportAction": _teleport,
    "SpeedAction": _speed,
    "SpeedProfileAction": _speed_profile,
    "LongitudinalDistanceAction": _longitudinal_distance,
    "LaneChangeAction": _lane_change,
    "LaneOffsetAction": _lane_offset,
    "LateralDistanceAction": _lateral_distance,
    "SynchronizeAction": _synchronize,
    "FollowTrajectoryAction": _follow_trajectory,
    "AssignRouteAction": _assign_route,
    "AcquirePositionAction": _acquire_position,
    "AssignControllerAction": _assign_controller,
    "ActivateControllerAction": _activate_controller,
    "OverrideControllerValueAction": _override,
    "VisibilityAction": _visibility,
    "LightStateAction": _light_state,
    "AnimationAction": _animation,
    "ConnectTrailerAction": _connect_trailer,
    "DisconnectTrailerAction": _disconnect_trailer,
}
