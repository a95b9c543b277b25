"""All actions that can be played: what the file says -> what is done about it, as each family's module has it."""

from __future__ import annotations

from xosc_lateral.playback.actions import (
    follow_trajectory,
    global_actions,
    lane_change,
    lane_offset,
    lateral_distance,
    longitudinal_distance,
    private_actions,
    speed,
    speed_profile,
    synchronize,
)
from xosc_lateral.playback.actions.base import RunningAction
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.storyboard import ActionElement
from xosc_lateral.scenario import Action

FAMILIES = (
    follow_trajectory,
    global_actions,
    lane_change,
    lane_offset,
    lateral_distance,
    longitudinal_distance,
    private_actions,
    speed,
    speed_profile,
    synchronize,
)

RUNNING: dict[type, type[RunningAction]] = {
    content: running for family in FAMILIES for content, running in family.RUNNING.items()
}


def prepare_action(action: Action, actor: EntityState | None, simulation: Simulation) -> ActionElement:
    """An action as an element of the storyboard, ready to be started."""
    return ActionElement(action.name, RUNNING[type(action.content)](action, actor, simulation), simulation)
