"""Actions, one family per file. `PrivateAction` and `GlobalAction` are all that an `Action` can hold."""

from xosc_lateral.scenario.actions.appearance import AnimationAction, LightStateAction, VisibilityAction
from xosc_lateral.scenario.actions.controller import (
    ActivateControllerAction,
    AssignControllerAction,
    OverrideControllerValueAction,
)
from xosc_lateral.scenario.actions.environment import EnvironmentAction
from xosc_lateral.scenario.actions.infrastructure import TrafficSignalControllerAction, TrafficSignalStateAction
from xosc_lateral.scenario.actions.lateral import (
    AbsoluteTargetLane,
    AbsoluteTargetLaneOffset,
    LaneChangeAction,
    LaneOffsetAction,
    LateralDistanceAction,
    RelativeTargetLane,
    RelativeTargetLaneOffset,
)
from xosc_lateral.scenario.actions.longitudinal import (
    AbsoluteTargetSpeed,
    LongitudinalDistanceAction,
    RelativeTargetSpeed,
    SpeedAction,
    SpeedProfileAction,
    SpeedProfileEntry,
)
from xosc_lateral.scenario.actions.population import AddEntityAction, DeleteEntityAction, TrafficAction
from xosc_lateral.scenario.actions.routing import AcquirePositionAction, AssignRouteAction, FollowTrajectoryAction
from xosc_lateral.scenario.actions.synchronize import (
    AbsoluteSpeed,
    RelativeSpeedToMaster,
    SteadyState,
    SynchronizeAction,
)
from xosc_lateral.scenario.actions.teleport import TeleportAction
from xosc_lateral.scenario.actions.trailer import ConnectTrailerAction, DisconnectTrailerAction
from xosc_lateral.scenario.actions.userdefined import UserDefinedAction
from xosc_lateral.scenario.actions.values import (
    ModifyOperation,
    ParameterModifyAction,
    ParameterSetAction,
    SetMonitorAction,
    VariableModifyAction,
    VariableSetAction,
)
from xosc_lateral.scenario.place import Unsupported

PrivateAction = (
    TeleportAction
    | SpeedAction
    | SpeedProfileAction
    | LongitudinalDistanceAction
    | LaneChangeAction
    | LaneOffsetAction
    | LateralDistanceAction
    | SynchronizeAction
    | FollowTrajectoryAction
    | AssignRouteAction
    | AcquirePositionAction
    | AssignControllerAction
    | ActivateControllerAction
    | OverrideControllerValueAction
    | VisibilityAction
    | LightStateAction
    | AnimationAction
    | ConnectTrailerAction
    | DisconnectTrailerAction
)
GlobalAction = (
    EnvironmentAction
    | AddEntityAction
    | DeleteEntityAction
    | ParameterSetAction
    | ParameterModifyAction
    | VariableSetAction
    | VariableModifyAction
    | SetMonitorAction
    | TrafficSignalStateAction
    | TrafficSignalControllerAction
    | TrafficAction
)
ActionContent = PrivateAction | GlobalAction | UserDefinedAction | Unsupported

__all__ = [
    "AbsoluteSpeed",
    "AbsoluteTargetLane",
    "AbsoluteTargetLaneOffset",
    "AbsoluteTargetSpeed",
    "AcquirePositionAction",
    "ActionContent",
    "ActivateControllerAction",
    "AddEntityAction",
    "AnimationAction",
    "AssignControllerAction",
    "AssignRouteAction",
    "ConnectTrailerAction",
    "DeleteEntityAction",
    "DisconnectTrailerAction",
    "EnvironmentAction",
    "FollowTrajectoryAction",
    "GlobalAction",
    "LaneChangeAction",
    "LaneOffsetAction",
    "LateralDistanceAction",
    "LightStateAction",
    "LongitudinalDistanceAction",
    "ModifyOperation",
    "OverrideControllerValueAction",
    "ParameterModifyAction",
    "ParameterSetAction",
    "PrivateAction",
    "RelativeSpeedToMaster",
    "RelativeTargetLane",
    "RelativeTargetLaneOffset",
    "RelativeTargetSpeed",
    "SetMonitorAction",
    "SpeedAction",
    "SpeedProfileAction",
    "SpeedProfileEntry",
    "SteadyState",
    "SynchronizeAction",
    "TeleportAction",
    "TrafficAction",
    "TrafficSignalControllerAction",
    "TrafficSignalStateAction",
    "UserDefinedAction",
    "VariableModifyAction",
    "VariableSetAction",
    "VisibilityAction",
]
