"""Private actions as a file says them: what one entity is to do."""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True, slots=True)
class TransitionDynamics:
    """Shape, dimension and value of a transition; `value` in s, m, or 1/s of the quantity (peak rate)."""

    shape: DynamicsShape
    dimension: DynamicsDimension
    value: float
    following_mode: FollowingMode = FollowingMode.POSITION


@dataclass(frozen=True, slots=True)
class DynamicConstraints:
    """Limits of one action; None where the file has none (the performance holds then). [m/s], [m/s2], [m/s3]"""

    max_acceleration: float | None = None
    max_deceleration: float | None = None
    max_speed: float | None = None
    max_acceleration_rate: float | None = None
    max_deceleration_rate: float | None = None


@dataclass(frozen=True, slots=True)
class AbsoluteTargetSpeed:
    """[m/s]"""

    value: float


@dataclass(frozen=True, slots=True)
class RelativeTargetSpeed:
    """From an entity's speed: plus `value` [m/s] or times `value` [-]; `continuous`: for ever."""

    entity_ref: str
    value: float
    value_type: SpeedTargetValueType
    continuous: bool


@dataclass(frozen=True, slots=True)
class SpeedAction:
    """Go to a speed."""

    target: AbsoluteTargetSpeed | RelativeTargetSpeed
    dynamics: TransitionDynamics
    place: Place


@dataclass(frozen=True, slots=True)
class SpeedProfileEntry:
    """A speed [m/s] and the time since the entry before [s]; None: as fast as the constraints allow."""

    speed: float
    time: float | None


@dataclass(frozen=True, slots=True)
class SpeedProfileAction:
    """Speeds over time; with `entity_ref`, relative to that entity's speed."""

    entries: tuple[SpeedProfileEntry, ...]
    following_mode: FollowingMode
    place: Place
    entity_ref: str | None = None
    constraints: DynamicConstraints | None = None


@dataclass(frozen=True, slots=True)
class LongitudinalDistanceAction:
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


@dataclass(frozen=True, slots=True)
class AbsoluteTargetLane:
    """By lane id."""

    lane_id: int


@dataclass(frozen=True, slots=True)
class RelativeTargetLane:
    """`value` lanes from an entity's lane."""

    entity_ref: str
    value: int


@dataclass(frozen=True, slots=True)
class LaneChangeAction:
    """Change to a lane; `target_lane_offset` along +t. [m]"""

    target: AbsoluteTargetLane | RelativeTargetLane
    dynamics: TransitionDynamics
    place: Place
    target_lane_offset: float = 0.0


@dataclass(frozen=True, slots=True)
class AbsoluteTargetLaneOffset:
    """Along +t from the lane's centre. [m]"""

    value: float


@dataclass(frozen=True, slots=True)
class RelativeTargetLaneOffset:
    """Along +t from an entity's position. [m]"""

    entity_ref: str
    value: float


@dataclass(frozen=True, slots=True)
class LaneOffsetAction:
    """Move inside the lane; `max_lateral_acc` None: as fast as can be (DESIGN: the player's default). [m/s2]"""

    target: AbsoluteTargetLaneOffset | RelativeTargetLaneOffset
    shape: DynamicsShape
    continuous: bool
    place: Place
    max_lateral_acc: float | None = None


@dataclass(frozen=True, slots=True)
class LateralDistanceAction:
    """Keep a lateral distance [m] to an entity; `distance` None: the present one."""

    entity_ref: str
    continuous: bool
    freespace: bool
    place: Place
    distance: float | None = None
    displacement: LateralDisplacement = LateralDisplacement.ANY
    coordinate_system: CoordinateSystem | None = None
    constraints: DynamicConstraints | None = None


@dataclass(frozen=True, slots=True)
class SteadyState:
    """The final speed holds for this `distance` [m] or `time` [s] before the target (one of them)."""

    distance: float | None = None
    time: float | None = None


@dataclass(frozen=True, slots=True)
class AbsoluteSpeed:
    """[m/s]"""

    value: float
    steady_state: SteadyState | None = None


@dataclass(frozen=True, slots=True)
class RelativeSpeedToMaster:
    """From the master's speed: plus `value` [m/s] or times `value` [-]."""

    value: float
    value_type: SpeedTargetValueType
    steady_state: SteadyState | None = None


@dataclass(frozen=True, slots=True)
class SynchronizeAction:
    """Tolerances None: not said. [m]"""

    master_entity_ref: str
    target_position_master: Position
    target_position: Position
    place: Place
    final_speed: AbsoluteSpeed | RelativeSpeedToMaster | None = None
    target_tolerance_master: float | None = None
    target_tolerance: float | None = None


@dataclass(frozen=True, slots=True)
class AssignRouteAction:
    """Take this route at junctions."""

    route: Route
    place: Place


@dataclass(frozen=True, slots=True)
class AcquirePositionAction:
    """Take the route from here to there."""

    position: Position
    place: Place


@dataclass(frozen=True, slots=True)
class FollowTrajectoryAction:
    """Follow a path; `timing` None: with the entity's own speed. `initial_distance_offset` [m]"""

    trajectory: Trajectory
    timing: Timing | None
    following_mode: FollowingMode
    place: Place
    initial_distance_offset: float = 0.0


@dataclass(frozen=True, slots=True)
class TeleportAction:
    """At once."""

    position: Position
    place: Place


@dataclass(frozen=True, slots=True)
class AssignControllerAction:
    """Assign, and perhaps activate on a domain (None: not said)."""

    controller: Controller | None
    place: Place
    activate_lateral: bool | None = None
    activate_longitudinal: bool | None = None


@dataclass(frozen=True, slots=True)
class ActivateControllerAction:
    """Activate or deactivate on a domain (None: unchanged)."""

    place: Place
    lateral: bool | None = None
    longitudinal: bool | None = None
    controller_ref: str | None = None


@dataclass(frozen=True, slots=True)
class OverrideControllerValueAction:
    """Pedals, gear, steering wheel; `overrides` holds their names and values."""

    overrides: tuple[tuple[str, bool, float | None], ...]
    place: Place


@dataclass(frozen=True, slots=True)
class ConnectTrailerAction:
    """Hitch that entity."""

    trailer_ref: str
    place: Place


@dataclass(frozen=True, slots=True)
class DisconnectTrailerAction:
    """Leave it where it is."""

    place: Place


@dataclass(frozen=True, slots=True)
class VisibilityAction:
    """Seen by graphics, sensors, other traffic."""

    graphics: bool
    sensors: bool
    traffic: bool
    place: Place


@dataclass(frozen=True, slots=True)
class LightStateAction:
    """A light goes on, off, or flashes."""

    light: str
    mode: str
    place: Place
    transition_time: float = 0.0


@dataclass(frozen=True, slots=True)
class AnimationAction:
    """A component or a pedestrian is animated; `duration` [s]."""

    kind: str
    place: Place
    loop: bool = False
    duration: float = 0.0
