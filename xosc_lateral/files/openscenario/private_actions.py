"""Private actions: what their structs declare is read by that, the others by the functions here."""

from __future__ import annotations

from msgspec.structs import replace

from xosc_lateral.files.openscenario.context import Context, Reader, declared, read_struct
from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.files.openscenario.positions import read_position
from xosc_lateral.world.scenario.enums import DynamicsShape
from xosc_lateral.world.scenario.private_actions import (
    AcquirePositionAction,
    ActivateControllerAction,
    AnimationAction,
    AssignControllerAction,
    AssignRouteAction,
    ConnectTrailerAction,
    DisconnectTrailerAction,
    FollowTrajectoryAction,
    LaneChangeAction,
    LaneOffsetAction,
    LateralDistanceAction,
    LightStateAction,
    LongitudinalDistanceAction,
    OverrideControllerValueAction,
    SpeedAction,
    SpeedProfileAction,
    SynchronizeAction,
    TeleportAction,
    TransitionDynamics,
    VisibilityAction,
)


def _teleport(e: XmlElement, context: Context) -> TeleportAction:
    # 1.0 files in the field put the position right into the action.
    return TeleportAction(read_position(e.child("Position") or e, context), place=e.place())


def _speed_profile(e: XmlElement, context: Context) -> SpeedProfileAction:
    if e.child("SpeedProfileEntry") is None:
        e.fail("a speed profile needs an entry")
    reference = context.entity(e) if e.optional_text("entityRef") else None
    return read_struct(SpeedProfileAction, e, context, entity_ref=reference)


def _lane_offset(e: XmlElement, context: Context) -> LaneOffsetAction:
    dynamics = e.required("LaneOffsetActionDynamics")
    shape = dynamics.choice("dynamicsShape", DynamicsShape, DynamicsShape.STEP)
    most = dynamics.optional_number("maxLateralAcc", finite=False)
    action = read_struct(LaneOffsetAction, e, context, shape=shape, max_lateral_acc=most)
    return replace(action, target=replace(action.target, value=-action.target.value)) if context.left_handed else action


def _override(e: XmlElement, _: Context) -> OverrideControllerValueAction:
    overrides = tuple((item.tag, item.boolean("active", False), item.optional_number("value")) for item in e.children())
    return OverrideControllerValueAction(overrides, place=e.place())


def _light_state(e: XmlElement, context: Context) -> LightStateAction:
    kind, state = e.child("LightType"), e.child("LightState")
    light = None if kind is None else kind.child()
    name = "" if light is None else light.optional_text("vehicleLightType") or light.text("userDefinedLightType", "")
    return read_struct(LightStateAction, e, context, light=name, mode="" if state is None else state.text("mode", ""))


def _animation(e: XmlElement, context: Context) -> AnimationAction:
    owner = e.child("AnimationType")
    content = None if owner is None else owner.child()
    return read_struct(AnimationAction, e, context, kind=content.tag if content else "")


def read_transition(e: XmlElement, context: Context) -> TransitionDynamics:
    """How a value goes to its target; a step needs no value."""
    is_step = e.choice("dynamicsShape", DynamicsShape, DynamicsShape.STEP) is DynamicsShape.STEP
    given = {"value": 0.0} if is_step and e.optional_number("value", finite=False) is None else {}
    return read_struct(TransitionDynamics, e, context, **given)


PRIVATE_ACTIONS: dict[str, Reader] = {
    **declared(SpeedAction, LongitudinalDistanceAction, LaneChangeAction, LateralDistanceAction, SynchronizeAction),
    **declared(FollowTrajectoryAction, AssignRouteAction, AcquirePositionAction, AssignControllerAction),
    **declared(ActivateControllerAction, VisibilityAction, ConnectTrailerAction, DisconnectTrailerAction),
    "TeleportAction": _teleport,
    "SpeedProfileAction": _speed_profile,
    "LaneOffsetAction": _lane_offset,
    "OverrideControllerValueAction": _override,
    "LightStateAction": _light_state,
    "AnimationAction": _animation,
}
