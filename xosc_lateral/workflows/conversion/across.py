"""Lane changes of vehicles that react: which can be a path, and what others keep the player's way for."""

from __future__ import annotations

from xosc_lateral.world.scenario.enums import Priority
from xosc_lateral.world.scenario.private_actions import LaneChangeAction, RelativeTargetLane
from xosc_lateral.world.scenario.scenario import Scenario, StoryEvent

Path = tuple[str, ...]


def lane_changes_of(scenario: Scenario, actor: str) -> dict[Path, tuple[StoryEvent, LaneChangeAction]]:
    """By their names from the story down, with the events that they are in."""
    return {
        (*at.path, action.name): (at, action.content)
        for at in scenario.storyboard.events()
        for action in at.event.actions
        if actor in at.actors and isinstance(action.content, LaneChangeAction)
    }


def why_untouched(scenario: Scenario, path: Path, actor: str) -> str:
    """Why neither the way nor the end of a lane change can be its driver's alone; empty: they can."""
    if path not in lane_changes_of(scenario, actor):
        return "the player takes it"
    at, change = lane_changes_of(scenario, actor)[path]
    if change.place.path != str(scenario.path):
        return "it is a catalog's"
    if at.actors != (actor,) or at.group.actors.select_triggering_entities:
        return "others act in it, too"
    if max(at.group.maximum_execution_count, at.event.maximum_execution_count) > 1:
        return "it may run again"
    return ""


def why_kept(scenario: Scenario, path: Path, actor: str) -> str:
    """Why a path can't stand for a lane change; empty: it can.

    Where it leads has to be known before.
    """
    at, change = lane_changes_of(scenario, actor)[path]
    maneuver = next(one for one, event in at.group.events() if event is at.event)
    if isinstance(change.target, RelativeTargetLane) and change.target.entity_ref != actor:
        return f"its lane is that of '{change.target.entity_ref}'"
    if any(event.priority is Priority.SKIP for event in maneuver.events if event is not at.event):
        return "an event beside it is skipped while it runs"
    return ""
