"""From the storyboard as read to the storyboard as it runs."""

from __future__ import annotations

from collections.abc import Iterator

from xosc_lateral.playback.actions.registry import prepare_action
from xosc_lateral.playback.conditions.registry import prepare_trigger
from xosc_lateral.playback.positions.on_road import reference_of
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.storyboard import ActionElement, EventElement, StoryboardElement, storyboard_root
from xosc_lateral.playback.trigger import RunningTrigger
from xosc_lateral.scenario import Act, Action, Event, Init, Maneuver, ManeuverGroup, Private, Story, Storyboard
from xosc_lateral.scenario.enums import StoryboardElementType
from xosc_lateral.scenario.private_actions import TeleportAction


def build_storyboard(storyboard: Storyboard, simulation: Simulation) -> StoryboardElement:
    """The tree of the storyboard; conditions that watch an element have found it."""
    stories = [_story(story, simulation) for story in storyboard.stories]
    stop = storyboard.stop_trigger
    root = storyboard_root(stories, None if stop is None else prepare_trigger(stop, simulation, when_empty=False))
    for look in simulation.when_built:
        look(root)
    if stop is None:
        simulation.note("has no stop trigger: the run ends at the time limit", storyboard.place)
    return root


def init_actions(init: Init, simulation: Simulation) -> list[ActionElement]:
    """Init actions in the order in which they start: an entity that is placed relative to another comes after it."""
    elements = [
        prepare_action(action, None, simulation) for action in (*init.global_actions, *init.user_defined_actions)
    ]
    for private in _in_order(init.privates):
        state = simulation.actor(private.entity_ref, private.place)
        for action in private.actions:
            element = prepare_action(action, state, simulation)
            state.init_actions.append(element)
            elements.append(element)
    return elements


def _in_order(privates: tuple[Private, ...]) -> Iterator[Private]:
    waiting = list(privates)
    placed: set[str] = set()
    names = {private.entity_ref for private in privates}
    while waiting:
        for private in waiting:
            needs = _references(private) & names - {private.entity_ref}
            if needs <= placed or private is waiting[-1]:
                break
        # The last one waiting goes on even so: a ring of references has no good order.
        chosen = private if needs <= placed else waiting[0]
        waiting.remove(chosen)
        if chosen.entity_ref not in {other.entity_ref for other in waiting}:
            placed.add(chosen.entity_ref)
        yield chosen


def _references(private: Private) -> set[str]:
    names = (
        reference_of(action.content.position)
        for action in private.actions
        if isinstance(action.content, TeleportAction)
    )
    return {name for name in names if name is not None}


def _story(story: Story, simulation: Simulation) -> StoryboardElement:
    return StoryboardElement(story.name, StoryboardElementType.STORY, [_act(act, simulation) for act in story.acts])


def _act(act: Act, simulation: Simulation) -> StoryboardElement:
    return StoryboardElement(
        act.name,
        StoryboardElementType.ACT,
        [_group(group, simulation) for group in act.maneuver_groups],
        start_trigger=None
        if act.start_trigger is None
        else prepare_trigger(act.start_trigger, simulation, when_empty=True),
        stop_trigger=None
        if act.stop_trigger is None
        else prepare_trigger(act.stop_trigger, simulation, when_empty=False),
    )


def _group(group: ManeuverGroup, simulation: Simulation) -> StoryboardElement:
    if group.actors.select_triggering_entities:
        simulation.note("the triggering entities do not join the actors", group.actors.place)
    return StoryboardElement(
        group.name,
        StoryboardElementType.MANEUVER_GROUP,
        [_maneuver(maneuver, group, simulation) for maneuver in group.maneuvers],
        maximum_count=group.maximum_execution_count,
    )


def _maneuver(maneuver: Maneuver, group: ManeuverGroup, simulation: Simulation) -> StoryboardElement:
    return StoryboardElement(
        maneuver.name, StoryboardElementType.MANEUVER, [_event(event, group, simulation) for event in maneuver.events]
    )


def _event(event: Event, group: ManeuverGroup, simulation: Simulation) -> EventElement:
    actions: list[ActionElement] = []
    for action in event.actions:
        actions += _actions(action, group, simulation)
    trigger = (
        RunningTrigger((), when_empty=True)
        if event.start_trigger is None
        else prepare_trigger(event.start_trigger, simulation, when_empty=True)
    )
    return EventElement(
        event.name,
        actions,
        priority=event.priority,
        start_trigger=trigger,
        maximum_count=event.maximum_execution_count,
    )


def _actions(action: Action, group: ManeuverGroup, simulation: Simulation) -> Iterator[ActionElement]:
    """One action for each actor, or one for all when it is not private."""
    if not action.is_private:
        yield prepare_action(action, None, simulation)
        return
    if not group.actors.entity_refs:
        place = group.actors.place
        simulation.note(f"maneuver group '{group.name}' has no actors: its private actions are not played", place)
    for name in group.actors.entity_refs:
        state = simulation.actor(name, group.actors.place)
        element = prepare_action(action, state, simulation)
        state.event_actions.append(element)
        yield element
