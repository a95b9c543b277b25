"""All actions that can be played: what the file says -> what is done about it."""

from __future__ import annotations

from xosc_lateral.playback.actions.appearance import RunningAnimation, RunningAppearance, RunningLightState
from xosc_lateral.playback.actions.base import RunningAction
from xosc_lateral.playback.actions.controllers import RunningController
from xosc_lateral.playback.actions.environment import RunningEnvironment
from xosc_lateral.playback.actions.follow_trajectory import RunningFollowTrajectory
from xosc_lateral.playback.actions.lane_change import RunningLaneChange
from xosc_lateral.playback.actions.lane_offset import RunningLaneOffset
from xosc_lateral.playback.actions.lateral_distance import RunningLateralDistance
from xosc_lateral.playback.actions.longitudinal_distance import RunningLongitudinalDistance
from xosc_lateral.playback.actions.population import RunningAddEntity, RunningDeleteEntity, RunningTraffic
from xosc_lateral.playback.actions.routing import RunningAcquirePosition, RunningAssignRoute
from xosc_lateral.playback.actions.speed import RunningSpeed
from xosc_lateral.playback.actions.speed_profile import RunningSpeedProfile
from xosc_lateral.playback.actions.synchronize import RunningSynchronize
from xosc_lateral.playback.actions.teleport import RunningTeleport
from xosc_lateral.playback.actions.trailer import RunningConnectTrailer, RunningDisconnectTrailer
from xosc_lateral.playback.actions.unsupported import RunningUnsupported
from xosc_lateral.playback.actions.values import (
    RunningParameterModify,
    RunningParameterSet,
    RunningSignalController,
    RunningSignalState,
    RunningVariableModify,
    RunningVariableSet,
)
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.storyboard import ActionElement
from xosc_lateral.scenario import Action, Unsupported
from xosc_lateral.scenario import actions as written

ACTIONS: tuple[tuple[type, type[RunningAction]], ...] = (
    (written.AcquirePositionAction, RunningAcquirePosition),
    (written.ActivateControllerAction, RunningController),
    (written.AddEntityAction, RunningAddEntity),
    (written.AnimationAction, RunningAnimation),
    (written.AssignControllerAction, RunningController),
    (written.AssignRouteAction, RunningAssignRoute),
    (written.ConnectTrailerAction, RunningConnectTrailer),
    (written.DeleteEntityAction, RunningDeleteEntity),
    (written.DisconnectTrailerAction, RunningDisconnectTrailer),
    (written.EnvironmentAction, RunningEnvironment),
    (written.FollowTrajectoryAction, RunningFollowTrajectory),
    (written.LaneChangeAction, RunningLaneChange),
    (written.LaneOffsetAction, RunningLaneOffset),
    (written.LateralDistanceAction, RunningLateralDistance),
    (written.LightStateAction, RunningLightState),
    (written.LongitudinalDistanceAction, RunningLongitudinalDistance),
    (written.OverrideControllerValueAction, RunningController),
    (written.ParameterModifyAction, RunningParameterModify),
    (written.ParameterSetAction, RunningParameterSet),
    (written.SetMonitorAction, RunningAppearance),
    (written.SpeedAction, RunningSpeed),
    (written.SpeedProfileAction, RunningSpeedProfile),
    (written.SynchronizeAction, RunningSynchronize),
    (written.TeleportAction, RunningTeleport),
    (written.TrafficAction, RunningTraffic),
    (written.TrafficSignalControllerAction, RunningSignalController),
    (written.TrafficSignalStateAction, RunningSignalState),
    (written.UserDefinedAction, RunningAppearance),
    (written.VariableModifyAction, RunningVariableModify),
    (written.VariableSetAction, RunningVariableSet),
    (written.VisibilityAction, RunningAppearance),
    (Unsupported, RunningUnsupported),
)

_RUNNING = dict(ACTIONS)


def prepare_action(action: Action, actor: EntityState | None, simulation: Simulation) -> ActionElement:
    """An action as an element of the storyboard, ready to be started."""
    return ActionElement(action.name, _RUNNING[type(action.content)](action, actor, simulation), simulation)
