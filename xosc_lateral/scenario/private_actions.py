"""Private actions as a file says them: what one entity is to do."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.entity import Controller
from xosc_lateral.scenario.enums import (
    CoordinateSystem,
    DynamicsDimension,
    DynamicsShape,
    FollowingMode,
    LateralDisplacement,
    LongitudinalDisplacement,
    SpeedTargetValueType,
)
from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position, Route, Timing, Trajectory


class TransitionDynamics(Struct, frozen=True):
    """Shape, dimension and value of a transition; `value` in s, m, or 1/s of the quantity (peak rate)."""

    shape: DynamicsShape
    dimension: DynamicsDimension
    value: float
    following_mode: FollowingMode = FollowingMode.POSITION


class DynamicConstraints(Struct, frozen=True):
    """Limits of one action; None where the file has none (the performance holds then). [m/s], [m/s2], [m/s3]"""

    max_acceleration: float | None = None
    max_deceleration: float | None = None
    max_speed: float | None = None
    max_acceleration_rate: float | None = None
    max_deceleration_rate: float | None = None


class AbsoluteTargetSpeed(Struct, frozen=True):
    """[m/s]"""

    value: float


class RelativeTargetSpeed(Struct, frozen=True):
    """From an entity's speed: plus `value` [m/s] or times `value` [-]; `continuous`: for ever."""

    entity_ref: str
    value: float
    value_type: SpeedTargetValueType
    continuous: bool


class SpeedAction(Struct, frozen=True):
    """Go to a speed."""

    target: AbsoluteTargetSpeed | RelativeTargetSpeed
    dynamics: TransitionDynamics
    place: Place


class SpeedProfileEntry(Struct, frozen=True):
    """A speed [m/s] and the time since the entry before [s]; None: as fast as the constraints allow."""

    speed: float
    time: float | None


class SpeedProfileAction(Struct, frozen=True):
    """Speeds over time; with `entity_ref`, relative to that entity's speed."""

    entries: tuple[SpeedProfileEntry, ...]
    following_mode: FollowingMode
    place: Place
    entity_ref: str | None = None
    constraints: DynamicConstraints | None = None


class LongitudinalDistanceAction(Struct, frozen=True):
    """Keep a distance [m] or time gap [s] to an entity; both None: the present distance."""

    entity_ref: str
    continuous: bool
    freespace: bool
    place: Place
    distance: float | None = None
    time_gap: float | None = None
    displacement: LongitudinalDisplacement | None = None
    coordinate_system: CoordinateSystem | None = None
    constraints: DynamicConstraints | None = None


class AbsoluteTargetLane(Struct, frozen=True):
    """By lane id."""

    lane_id: int


class RelativeTargetLane(Struct, frozen=True):
    """`value` lanes from an entity's lane."""

    entity_ref: str
    value: int


class LaneChangeAction(Struct, frozen=True):
    """Change to a lane; `target_lane_offset` along +t. [m]"""

    target: AbsoluteTargetLane | RelativeTargetLane
    dynamics: TransitionDynamics
    place: Place
    target_lane_offset: float = 0.0


class AbsoluteTargetLaneOffset(Struct, frozen=True):
    """Along +t from the lane's centre. [m]"""

    value: float


class RelativeTargetLaneOffset(Struct, frozen=True):
    """Along +t from an entity's position. [m]"""

    entity_ref: str
    value: float


class LaneOffsetAction(Struct, frozen=True):
    """Move inside the lane; `max_lateral_acc` None: as fast as can be (DESIGN: the player's default). [m/s2]"""

    target: AbsoluteTargetLaneOffset | RelativeTargetLaneOffset
    shape: DynamicsShape
    continuous: bool
    place: Place
    max_lateral_acc: float | None = None


class LateralDistanceAction(Struct, frozen=True):
    """Keep a lateral distance [m] to an entity; `distance` None: the present one."""

    entity_ref: str
    continuous: bool
    freespace: bool
    place: Place
    distance: float | None = None
    displacement: LateralDisplacement = LateralDisplacement.ANY
    coordinate_system: CoordinateSystem | None = None
    constraints: DynamicConstraints | None = None


class SteadyState(Struct, frozen=True):
    """The final speed holds for this `distance` [m] or `time` [s] before the target (one of them)."""

    distance: float | None = None
    time: float | None = None


class AbsoluteSpeed(Struct, frozen=True):
    """[m/s]"""

    value: float
    steady_state: SteadyState | None = None


class RelativeSpeedToMaster(Struct, frozen=True):
    """From the master's speed: plus `value` [m/s] or times `value` [-]."""

    value: float
    value_type: SpeedTargetValueType
    steady_state: SteadyState | None = None


class SynchronizeAction(Struct, frozen=True):
    """Tolerances None: not said. [m]"""

    master_entity_ref: str
    target_position_master: Position
    target_position: Position
    place: Place
    final_speed: AbsoluteSpeed | RelativeSpeedToMaster | None = None
    target_tolerance_master: float | None = None
    target_tolerance: float | None = None


class AssignRouteAction(Struct, frozen=True):
    """Take this route at junctions."""

    route: Route
    place: Place


class AcquirePositionAction(Struct, frozen=True):
    """Take the route from here to there."""

    position: Position
    place: Place


class FollowTrajectoryAction(Struct, frozen=True):
    """Follow a path; `timing` None: with the entity's own speed. `initial_distance_offset` [m]"""

    trajectory: Trajectory
    timing: Timing | None
    following_mode: FollowingMode
    place: Place
    initial_distance_offset: float = 0.0


class TeleportAction(Struct, frozen=True):
    """At once."""

    position: Position
    place: Place


class AssignControllerAction(Struct, frozen=True):
    """Assign, and perhaps activate on a domain (None: not said)."""

    controller: Controller | None
    place: Place
    activate_lateral: bool | None = None
    activate_longitudinal: bool | None = None


class ActivateControllerAction(Struct, frozen=True):
    """Activate or deactivate on a domain (None: unchanged)."""

    place: Place
    lateral: bool | None = None
    longitudinal: bool | None = None
    controller_ref: str | None = None


class OverrideControllerValueAction(Struct, frozen=True):
    """Pedals, gear, steering wheel; `overrides` holds their names and values."""

    overrides: tuple[tuple[str, bool, float | None], ...]
    place: Place


class ConnectTrailerAction(Struct, frozen=True):
    """Hitch that entity."""

    trailer_ref: str
    place: Place


class DisconnectTrailerAction(Struct, frozen=True):
    """Leave it where it is."""

    place: Place


class VisibilityAction(Struct, frozen=True):
    """Seen by graphics, sensors, other traffic."""

    graphics: bool
    sensors: bool
    traffic: bool
    place: Place


class LightStateAction(Struct, frozen=True):
    """A light goes on, off, or flashes."""

    light: str
    mode: str
    place: Place
    transition_time: float = 0.0


class AnimationAction(Struct, frozen=True):
    """A component or a pedestrian is animated; `duration` [s]."""

    kind: str
    place: Place
    loop: bool = False
    duration: float = 0.0
