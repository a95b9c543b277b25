"""Lane changes of vehicles that react: which can be a path, and what others keep the player's way for."""

from __future__ import annotations

from collections.abc import Iterator

from xosc_lateral.world.scenario.conditions import StoryboardElementStateCondition
from xosc_lateral.world.scenario.dependence import refers_to
from xosc_lateral.world.scenario.enums import ConditionEdge, Priority, StoryboardElementState
from xosc_lateral.world.scenario.private_actions import LaneChangeAction, RelativeTargetLane
from xosc_lateral.world.scenario.scenario import Condition, Scenario, StoryEvent, conditions_of

Path = tuple[str, ...]
BEGINS = (StoryboardElementState.STANDBY, StoryboardElementState.START_TRANSITION, StoryboardElementState.RUNNING)


def lane_changes_of(scenario: Scenario, actor: str) -> dict[Path, tuple[StoryEvent, LaneChangeAction]]:
    """By their names from the story down, with the events that they are in."""
    return {
        (*at.path, action.name): (at, action.content)
        for at in scenario.storyboard.events()
        for action in at.event.actions
        if actor in at.actors and isinstance(action.content, LaneChangeAction)
    }


def why_kept(scenario: Scenario, path: Path, actor: str) -> str:
    """Why a path can't stand for a lane change; empty: it can.

    By the distance driven a path ends when it will, so nothing may wait for that; and where it leads is known before.
    """
    at, change = lane_changes_of(scenario, actor)[path]
    maneuver = next(one for one, event in at.group.events() if event is at.event)
    if change.place.path != str(scenario.path):
        return "it is a catalog's"
    if at.actors != (actor,) or at.group.actors.select_triggering_entities:
        return "others act in it, too"
    if max(at.group.maximum_execution_count, at.event.maximum_execution_count) > 1:
        return "it may run again"
    if isinstance(change.target, RelativeTargetLane) and change.target.entity_ref != actor:
        return f"its lane is that of '{change.target.entity_ref}'"
    if any(event.priority is Priority.SKIP for event in maneuver.events if event is not at.event):
        return "an event beside it is skipped while it runs"
    waiting = next((one for one in _conditions(scenario) if _waits_for_end(one, path)), None)
    return "" if waiting is None else f"condition '{waiting.name}' waits for its end"


def _conditions(scenario: Scenario) -> Iterator[Condition]:
    yield from conditions_of(scenario.storyboard.stop_trigger)
    for at in scenario.storyboard.events():
        for trigger in (at.act.start_trigger, at.act.stop_trigger, at.event.start_trigger):
            yield from conditions_of(trigger)


def _waits_for_end(condition: Condition, path: Path) -> bool:
    content = condition.content
    if not isinstance(content, StoryboardElementStateCondition):
        return False
    begins = content.state in BEGINS and condition.edge in (ConditionEdge.NONE, ConditionEdge.RISING)
    return not begins and any(refers_to(content, path[:depth]) for depth in range(1, len(path) + 1))
