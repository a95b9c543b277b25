"""From the storyboard as read to the storyboard as it runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from xosc_lateral.base.grouping import grouped
from xosc_lateral.world.player.actions import (
    at_once,
    follow_trajectory,
    lateral,
    lateral_distance,
    longitudinal,
    speed_profile,
    synchronize,
)
from xosc_lateral.world.player.actions.base import Maker, RunningAction
from xosc_lateral.world.player.conditions import distance, motion, value
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import EntityState
from xosc_lateral.world.player.storyboard import (
    Check,
    Checks,
    EntityChecks,
    EventElement,
    RunningCondition,
    RunningTrigger,
    StoryboardElement,
    last_name,
)
from xosc_lateral.world.scenario import scenario as read
from xosc_lateral.world.scenario.dependence import entity_references
from xosc_lateral.world.scenario.enums import StoryboardElementType, TriggeringEntitiesRule
from xosc_lateral.world.scenario.global_actions import AddEntityAction
from xosc_lateral.world.scenario.place import Unsupported
from xosc_lateral.world.scenario.private_actions import (
    FollowTrajectoryAction,
    LaneChangeAction,
    LaneOffsetAction,
    TeleportAction,
)


def build_storyboard(storyboard: read.Storyboard, simulation: Simulation) -> StoryboardElement:
    """The tree of the storyboard; conditions that watch an element have found it."""
    stories = [
        StoryboardElement(story.name, StoryboardElementType.STORY, [_act(act, simulation) for act in story.acts])
        for story in storyboard.stories
    ]
    root = StoryboardElement("", None, stories, stop_trigger=_trigger(storyboard.stop_trigger, simulation))
    named = grouped((last_name(element.name), element) for element in root.walk())
    for look in simulation.when_built:
        look(named)
    if storyboard.stop_trigger is None:
        simulation.note("has no stop trigger: the run ends at the time limit", storyboard.place)
    return root


def init_actions(init: read.Init, simulation: Simulation) -> list[RunningAction]:
    """Init actions in the order in which they start.

    They are a set: what is placed relative to an entity comes after all that places that one, global or private. Those
    of one ``Private`` stay in order, and together where they can.
    """
    rows: list[list[_InitStep]] = [[(action, None)] for action in (*init.global_actions, *init.user_defined_actions)]
    rows += [[(action, private) for action in private.actions] for private in init.privates]
    return [
        prepare_action(action, None if owner is None else simulation.actor(owner.entity_ref, owner.place), simulation)
        for action, owner in _in_order([row for row in rows if row], simulation)
    ]


_InitStep = tuple[read.Action, read.Private | None]
"""An action, and whose it is; None: global."""

_PLACED_BESIDE = (TeleportAction, AddEntityAction, FollowTrajectoryAction, LaneChangeAction, LaneOffsetAction)
"""Actions that look at once where the entities are that they refer to."""


def _in_order(rows: list[list[_InitStep]], simulation: Simulation) -> Iterator[_InitStep]:
    """Rows of actions that start one after the other, the first row that can begin or go on first."""
    unplaced = Counter(_placed(step) for row in rows for step in row)
    while rows:
        k = next((k for k, row in enumerate(rows) if not any(unplaced[name] for name in _needs(row[0]))), None)
        if k is None:
            what = "the places of the init refer to each other in a ring: the file's order holds"
            simulation.note(what, rows[0][0][0].place, is_doubt=True)
        row = rows.pop(k or 0)
        unplaced[_placed(row[0])] -= 1
        yield row.pop(0)
        rows[:0] = [row] if row else []


def _placed(step: _InitStep) -> str:
    """The entity that an action puts somewhere; empty: none."""
    content, owner = step[0].content, step[1]
    if owner is not None:
        return owner.entity_ref if isinstance(content, TeleportAction) else ""
    return content.entity_ref if isinstance(content, AddEntityAction) else ""


def _needs(step: _InitStep) -> set[str]:
    """Entities that have to be somewhere before an action starts."""
    content = step[0].content
    return set(entity_references(content)) - {_placed(step)} if isinstance(content, _PLACED_BESIDE) else set()


def _act(act: read.Act, simulation: Simulation) -> StoryboardElement:
    return StoryboardElement(
        act.name,
        StoryboardElementType.ACT,
        [_group(group, simulation) for group in act.maneuver_groups],
        _trigger(act.start_trigger, simulation, when_empty=True),
        _trigger(act.stop_trigger, simulation),
    )


def _group(group: read.ManeuverGroup, simulation: Simulation) -> StoryboardElement:
    if group.actors.select_triggering_entities:
        simulation.note("the triggering entities do not join the actors", group.actors.place)
    maneuvers = [
        StoryboardElement(
            maneuver.name,
            StoryboardElementType.MANEUVER,
            [_event(event, group, simulation) for event in maneuver.events],
        )
        for maneuver in group.maneuvers
    ]
    kind, count = StoryboardElementType.MANEUVER_GROUP, group.maximum_execution_count
    return StoryboardElement(group.name, kind, maneuvers, maximum_count=count)


def _event(event: read.Event, group: read.ManeuverGroup, simulation: Simulation) -> EventElement:
    return EventElement(
        event.name,
        StoryboardElementType.EVENT,
        [one for action in event.actions for one in _actions(action, group, simulation)],
        _trigger(event.start_trigger, simulation, when_empty=True) or RunningTrigger((), when_empty=True),
        maximum_count=event.maximum_execution_count,
        priority=event.priority,
    )


def _actions(action: read.Action, group: read.ManeuverGroup, simulation: Simulation) -> Iterator[RunningAction]:
    """One action for each actor, or one for all when it is not private."""
    if not action.is_private:
        yield prepare_action(action, None, simulation)
        return
    if not group.actors.entity_refs:
        place = group.actors.place
        simulation.note(f"maneuver group '{group.name}' has no actors: its private actions are not played", place)
    for name in group.actors.entity_refs:
        yield prepare_action(action, simulation.actor(name, group.actors.place), simulation)


# ---- all actions that can be played, as each family's module has them ----
RUNNING: dict[type, Maker] = {
    **follow_trajectory.RUNNING,
    **at_once.RUNNING,
    **lateral.RUNNING,
    **lateral_distance.RUNNING,
    **longitudinal.RUNNING,
    **speed_profile.RUNNING,
    **synchronize.RUNNING,
}


def prepare_action(action: read.Action, actor: EntityState | None, simulation: Simulation) -> RunningAction:
    """An action as an element of the storyboard, ready to be started."""
    return RUNNING[type(action.content)](action, actor, simulation)


# ---- all conditions that can be played ----
ENTITY_CHECKS: EntityChecks = {
    content: check for family in (distance, motion) for content, check in family.CHECKS.items()
}
VALUE_CHECKS: Checks = dict(value.CHECKS)


def _trigger(
    trigger: read.Trigger | None, simulation: Simulation, *, when_empty: bool = False
) -> RunningTrigger | None:
    """A trigger ready to be evaluated frame by frame."""
    if trigger is None:
        return None
    groups = (
        tuple(RunningCondition(_check(c, simulation), c.edge, c.delay) for c in group.conditions)
        for group in trigger.groups
    )
    return RunningTrigger(tuple(groups), when_empty=when_empty)


def _check(condition: read.Condition, simulation: Simulation) -> Check:
    content = condition.content
    if isinstance(content, Unsupported):
        simulation.note(content.reason or f"{content.kind} can't be played: the condition stays false", content.place)
        return lambda: False
    if type(content) in VALUE_CHECKS:
        return VALUE_CHECKS[type(content)](content, simulation)
    check = ENTITY_CHECKS[type(content)](content, simulation)
    triggering = condition.triggering_entities
    names = () if triggering is None else triggering.entity_refs
    states = tuple(simulation.entity(name, condition.place) for name in names)
    if triggering is not None and triggering.rule is TriggeringEntitiesRule.ALL:
        return lambda: any(state.active for state in states) and all(check(state) for state in states if state.active)
    if len(states) == 1:
        only = states[0]
        return lambda: only.active and check(only)
    return lambda: any(state.active and check(state) for state in states)
