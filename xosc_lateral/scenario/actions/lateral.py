"""Lane change, lane offset, lateral distance."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.dynamics import DynamicConstraints, TransitionDynamics
from xosc_lateral.scenario.enums import CoordinateSystem, DynamicsShape, LateralDisplacement
from xosc_lateral.scenario.place import Place


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
