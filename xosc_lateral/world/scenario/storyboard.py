"""The storyboard tree under the standard's names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated

from msgspec import Struct

from xosc_lateral.world.scenario.enums import ConditionEdge, Priority, TriggeringEntitiesRule
from xosc_lateral.world.scenario.place import Content, EntityRefs, Name, No, Place, Unsupported, Xml, Zero, called

StartTrigger = called("StartTrigger")
StopTrigger = called("StopTrigger")


class TriggeringEntities(Struct, frozen=True):
    """Whose state a condition looks at; entity selections are already replaced by their members."""

    rule: Annotated[TriggeringEntitiesRule, called("triggeringEntitiesRule", default=TriggeringEntitiesRule.ANY)]
    entity_refs: EntityRefs


class Condition(Struct, frozen=True):
    """One condition. `triggering_entities` is None for value conditions. `delay` [s]"""

    name: Name
    delay: Zero
    edge: Annotated[ConditionEdge, called("conditionEdge", default=ConditionEdge.NONE)]
    content: Content | Unsupported
    triggering_entities: TriggeringEntities | None
    place: Place

    def __post_init__(self) -> None:
        if self.delay < 0:
            raise ValueError(f"delay of {self.delay} s is negative")


class ConditionGroup(Struct, frozen=True):
    """True when all of its conditions are."""

    conditions: tuple[Condition, ...]


class Trigger(Struct, frozen=True):
    """True when one of its groups is. No groups at all: see the player."""

    groups: tuple[ConditionGroup, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Action:
    """One action, of init (then without a name) or of an event."""

    name: str  # empty in init
    content: Content | Unsupported  # what it does
    place: Place  # of the Action, PrivateAction, GlobalAction or UserDefinedAction element
    is_private: bool  # acts once for each actor; else once
    scope: Mapping[str, str] = field(default_factory=dict, repr=False, compare=False)
    """Parameters of story, maneuver or catalog that the element may refer to, with their values: whoever moves the
    element to another place has to fill them in."""


class Event(Struct, frozen=True):
    """`start_trigger` None: starts at once. Counts from 1."""

    name: Name
    priority: Annotated[Priority, Xml(default=Priority.PARALLEL)]
    actions: tuple[Action, ...]
    start_trigger: Annotated[Trigger | None, StartTrigger]
    place: Place
    maximum_execution_count: int = 1


class Maneuver(Struct, frozen=True):
    """Events side by side."""

    name: Name
    events: tuple[Event, ...]
    place: Place


class Actors(Struct, frozen=True):
    """Who acts; entity selections are already replaced by their members."""

    entity_refs: EntityRefs
    select_triggering_entities: No
    place: Place


class ManeuverGroup(Struct, frozen=True):
    """Actors and their maneuvers (those from catalogs included, in file order)."""

    name: Name
    actors: Actors
    maneuvers: tuple[Maneuver, ...]
    place: Place
    maximum_execution_count: int = 1

    def events(self) -> Iterator[tuple[Maneuver, Event]]:
        """Every event, with its maneuver."""
        return ((maneuver, event) for maneuver in self.maneuvers for event in maneuver.events)


class Act(Struct, frozen=True):
    """`start_trigger` None: starts at once."""

    name: Name
    maneuver_groups: tuple[ManeuverGroup, ...]
    start_trigger: Annotated[Trigger | None, StartTrigger]
    stop_trigger: Annotated[Trigger | None, StopTrigger]
    place: Place


class Story(Struct, frozen=True):
    """Acts side by side."""

    name: Name
    acts: tuple[Act, ...]
    place: Place


class Private(Struct, frozen=True):
    """Init actions of one entity, in file order."""

    entity_ref: str
    actions: tuple[Action, ...]
    place: Place


class Init(Struct, frozen=True):
    """In the order in which they start."""

    global_actions: tuple[Action, ...]
    user_defined_actions: tuple[Action, ...]
    privates: tuple[Private, ...]


class Storyboard(Struct, frozen=True):
    """`stop_trigger` None: never stops by itself."""

    init: Init
    stories: tuple[Story, ...]
    stop_trigger: Annotated[Trigger | None, StopTrigger]
    place: Place

    def groups(self) -> Iterator[tuple[Story, Act, ManeuverGroup]]:
        """Every maneuver group, with what it is in, in file order."""
        for story in self.stories:
            for act in story.acts:
                for group in act.maneuver_groups:
                    yield story, act, group
