"""Lane changes of vehicles that react: which can be a path, and what others keep the player's way for."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from enum import IntEnum

from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.motion.offset_path import OffsetPath
from xosc_lateral.world.scenario.enums import Priority
from xosc_lateral.world.scenario.private_actions import LaneChangeAction, RelativeTargetLane
from xosc_lateral.world.scenario.scenario import Scenario, StoryEvent

Path = tuple[str, ...]


class Way(IntEnum):
    """How lane changes of a vehicle that reacts lead across, as far as they can; what is less leaves more as it was."""

    WRITTEN = 0
    ASIDE = 1  # as written, to where its driver is then
    ACROSS = 2  # as its driver takes it


WAY_WORDS = {
    Way.WRITTEN: "stay as written",
    Way.ASIDE: "keep their written way, and end where its driver is then",
}
"""Of those whose way could not be their driver's."""


def in_words(paths: Sequence[OffsetPath], motion: NominalMotion) -> Iterator[str]:
    """A line for each lane change that a path leads across."""
    for path in paths:
        if path.instead and path.settles is None:
            begin = min(one.start for one in motion.actions if (one.path, one.actor) == (path.after, path.entity))
            side = "left" if path.end > 0.0 else "right"
            yield (
                f"lane change of '{path.entity}' at {begin:.1f} s is its driver's: it ends when the written one does, "
                f"{abs(path.end):.2f} m {side} of the middle"
            )


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
    return "it may run again" if max(at.group.maximum_execution_count, at.event.maximum_execution_count) > 1 else ""


def why_kept(scenario: Scenario, path: Path, actor: str, keeping: Collection[str] = ()) -> str:
    """Why a path can't stand for a lane change; empty: it can.

    Where it leads has to be known before: the lane of `keeping` is, who are in one all the time.
    """
    at, change = lane_changes_of(scenario, actor)[path]
    maneuver = next(one for one, event in at.group.events() if event is at.event)
    if isinstance(change.target, RelativeTargetLane) and change.target.entity_ref not in (actor, *keeping):
        return f"its lane is that of '{change.target.entity_ref}'"
    if any(event.priority is Priority.SKIP for event in maneuver.events if event is not at.event):
        return "an event beside it is skipped while it runs"
    return ""
