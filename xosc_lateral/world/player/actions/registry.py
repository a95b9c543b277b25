"""All actions that can be played: what the file says -> what is done about it, as each family's module has it."""

from __future__ import annotations

from xosc_lateral.world.player.actions import (
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
from xosc_lateral.world.player.actions.base import Maker, RunningAction
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import EntityState
from xosc_lateral.world.scenario import Action

RUNNING: dict[type, Maker] = {
    **follow_trajectory.RUNNING,
    **global_actions.RUNNING,
    **lane_change.RUNNING,
    **lane_offset.RUNNING,
    **lateral_distance.RUNNING,
    **longitudinal_distance.RUNNING,
    **private_actions.RUNNING,
    **speed.RUNNING,
    **speed_profile.RUNNING,
    **synchronize.RUNNING,
}


def prepare_action(action: Action, actor: EntityState | None, simulation: Simulation) -> RunningAction:
    """An action as an element of the storyboard, ready to be started."""
    return RUNNING[type(action.content)](action, actor, simulation)
