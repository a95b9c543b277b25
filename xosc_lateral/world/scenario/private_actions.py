"""Private actions as a file says them: what one entity is to do."""

from __future__ import annotations

from typing import Annotated

from msgspec import Struct

from xosc_lateral.world.scenario import enums
from xosc_lateral.world.scenario.entity import Controller
from xosc_lateral.world.scenario.place import AnyNumber, Content, EntityRef, No, Xml, called
from xosc_lateral.world.scenario.position import Position, Route, Timing, Trajectory

Limit = Annotated[float | None, Xml(finite=False)]
ValueType = Annotated[
    enums.SpeedTargetValueType, called("speedTargetValueType", default=enums.SpeedTargetValueType.DELTA)
]
FOLLOWING_MODE = called("TrajectoryFollowingMode/followingMode", default=enums.FollowingMode.FOLLOW)
SteadyStates = called("TargetDistanceSteadyState", "TargetTimeSteadyState")


class TransitionDynamics(Struct, frozen=True):
    """Shape, dimension and value of a transition; `value` in s, m, or 1/s of the quantity (peak rate).

    The reference player takes a missing dimension for time; a step has no use for either.
    """

    shape: Annotated[enums.DynamicsShape, called("dynamicsShape", default=enums.DynamicsShape.STEP)]
    dimension: Annotated[enums.DynamicsDimension, called("dynamicsDimension", default=enums.DynamicsDimension.TIME)]
    value: AnyNumber
    following_mode: enums.FollowingMode = enums.FollowingMode.POSITION


class DynamicConstraints(Struct, frozen=True):
    """Limits of one action; None where the file has none (the performance holds then). [m/s], [m/s2], [m/s3]"""

    max_acceleration: Limit = None
    max_deceleration: Limit = None
    max_speed: Limit = None
    max_acceleration_rate: Limit = None
    max_deceleration_rate: Limit = None


class AbsoluteTargetSpeed(Struct, frozen=True):
    """[m/s]"""

    value: float


class RelativeTargetSpeed(Struct, frozen=True):
    """From an entity's speed: plus `value` [m/s] or times `value` [-]; `continuous`: for ever."""

    entity_ref: EntityRef
    value: float
    value_type: ValueType
    continuous: No


class SpeedAction(Content, frozen=True):
    """Go to a speed."""

    target: Annotated[AbsoluteTargetSpeed | RelativeTargetSpeed, called("SpeedActionTarget")]
    dynamics: Annotated[TransitionDynamics, called("SpeedActionDynamics")]


class SpeedProfileEntry(Struct, frozen=True):
    """A speed [m/s] and the time since the entry before [s]; None: as fast as the constraints allow."""

    speed: float
    time: float | None


class SpeedProfileAction(Content, frozen=True):
    """Speeds over time; with `entity_ref`, relative to that entity's speed."""

    entries: tuple[SpeedProfileEntry, ...]
    following_mode: Annotated[enums.FollowingMode, Xml(default=enums.FollowingMode.POSITION)]
    entity_ref: Annotated[str | None, Xml(is_entity=True)] = None
    constraints: DynamicConstraints | None = None


class KeptDistance(Content, frozen=True):
    """Keep a distance [m] to an entity."""

    entity_ref: EntityRef
    continuous: No
    freespace: No
    distance: float | None = None
    coordinate_system: enums.CoordinateSystem | None = None
    constraints: DynamicConstraints | None = None


class LongitudinalDistanceAction(KeptDistance, frozen=True):
    """Along the road, or a time gap [s]; both None: the present distance."""

    time_gap: float | None = None
    displacement: enums.LongitudinalDisplacement | None = None


class AbsoluteTargetLane(Struct, frozen=True):
    """By lane id."""

    lane_id: Annotated[int, called("value")]


class RelativeTargetLane(Struct, frozen=True):
    """`value` lanes from an entity's lane."""

    entity_ref: EntityRef
    value: int


class LaneChangeAction(Content, frozen=True):
    """Change to a lane; `target_lane_offset` along +t. [m]"""

    target: Annotated[AbsoluteTargetLane | RelativeTargetLane, called("LaneChangeTarget")]
    dynamics: Annotated[TransitionDynamics, called("LaneChangeActionDynamics")]
    target_lane_offset: float = 0.0


class AbsoluteTargetLaneOffset(Struct, frozen=True):
    """Along +t from the lane's centre. [m]"""

    value: float


class RelativeTargetLaneOffset(Struct, frozen=True):
    """Along +t from an entity's position. [m]"""

    entity_ref: EntityRef
    value: float


class LaneOffsetAction(Content, frozen=True):
    """Move inside the lane; `max_lateral_acc` None: as fast as can be. [m/s2]"""

    target: Annotated[AbsoluteTargetLaneOffset | RelativeTargetLaneOffset, called("LaneOffsetTarget")]
    shape: enums.DynamicsShape
    continuous: No
    max_lateral_acc: float | None = None


class LateralDistanceAction(KeptDistance, frozen=True):
    """Across the road; `distance` None: the present one."""

    displacement: enums.LateralDisplacement = enums.LateralDisplacement.ANY


class SteadyState(Struct, frozen=True):
    """The final speed holds for this `distance` [m] or `time` [s] before the target (one of them)."""

    distance: float | None = None
    time: float | None = None


class AbsoluteSpeed(Struct, frozen=True):
    """[m/s]"""

    value: float
    steady_state: Annotated[SteadyState | None, SteadyStates] = None


class RelativeSpeedToMaster(Struct, frozen=True):
    """From the master's speed: plus `value` [m/s] or times `value` [-]."""

    value: float
    value_type: ValueType
    steady_state: Annotated[SteadyState | None, SteadyStates] = None


class SynchronizeAction(Content, frozen=True):
    """Tolerances None: not said. [m]"""

    master_entity_ref: EntityRef
    target_position_master: Annotated[Position, called("TargetPositionMaster")]
    target_position: Annotated[Position, called("TargetPosition")]
    final_speed: Annotated[AbsoluteSpeed | RelativeSpeedToMaster | None, called("FinalSpeed")] = None
    target_tolerance_master: float | None = None
    target_tolerance: float | None = None


class AssignRouteAction(Content, frozen=True):
    """Take this route at junctions."""

    route: Annotated[Route, called("")]


class AcquirePositionAction(Content, frozen=True):
    """Take the route from here to there."""

    position: Position


class FollowTrajectoryAction(Content, frozen=True):
    """Follow a path; `timing` None: with the entity's own speed. `initial_distance_offset` [m]"""

    trajectory: Annotated[Trajectory, called("")]
    timing: Annotated[Timing | None, called("TimeReference/Timing")]
    following_mode: Annotated[enums.FollowingMode, FOLLOWING_MODE]
    initial_distance_offset: float = 0.0


class TeleportAction(Content, frozen=True):
    """At once."""

    position: Position


class AssignControllerAction(Content, frozen=True):
    """Assign, and perhaps activate on a domain (None: not said)."""

    controller: Annotated[Controller | None, called("")]
    activate_lateral: bool | None = None
    activate_longitudinal: bool | None = None


class ActivateControllerAction(Content, frozen=True):
    """Activate or deactivate on a domain (None: unchanged)."""

    lateral: bool | None = None
    longitudinal: bool | None = None
    controller_ref: Annotated[str | None, called("objectControllerRef", "controllerRef")] = None


class OverrideControllerValueAction(Content, frozen=True):
    """Pedals, gear, steering wheel; `overrides` holds their names and values."""

    overrides: tuple[tuple[str, bool, float | None], ...]


class ConnectTrailerAction(Content, frozen=True):
    """Hitch that entity."""

    trailer_ref: EntityRef


class DisconnectTrailerAction(Content, frozen=True):
    """Leave it where it is."""


class VisibilityAction(Content, frozen=True):
    """Whether other traffic sees it; who else does is nothing to its movement."""

    traffic: Annotated[bool, Xml(default=True)]


class LightStateAction(Content, frozen=True):
    """A light goes on, off, or flashes."""

    light: Annotated[str, called("LightType/*/vehicleLightType", "LightType/*/userDefinedLightType", default="")]
    mode: Annotated[str, called("LightState/mode", default="")]
    transition_time: float = 0.0


class AnimationAction(Content, frozen=True):
    """A component or a pedestrian is animated; `duration` [s]."""

    kind: str
    loop: bool = False
    duration: Annotated[float, called("animationDuration")] = 0.0


LONGITUDINAL = (SpeedAction, SpeedProfileAction, LongitudinalDistanceAction, SynchronizeAction)
LATERAL = (LaneChangeAction, LaneOffsetAction, LateralDistanceAction, FollowTrajectoryAction)
MOTION = (*LONGITUDINAL, *LATERAL, TeleportAction, AssignRouteAction, AcquirePositionAction)
CONTROLLER = (AssignControllerAction, ActivateControllerAction, OverrideControllerValueAction)
APPEARANCE = (AnimationAction, LightStateAction, VisibilityAction)
