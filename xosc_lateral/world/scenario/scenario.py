"""A scenario as read: everything that playing and writing need."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from msgspec import Struct

from xosc_lateral.base.note import Note
from xosc_lateral.world.scenario.entity import Entity
from xosc_lateral.world.scenario.enums import ConditionEdge, ParameterType, Priority, TriggeringEntitiesRule
from xosc_lateral.world.scenario.place import Content, EntityRefs, Name, No, Place, Unsupported, Xml, Zero, called


class FileHeader(Struct, frozen=True):
    """Version and description."""

    major: int
    minor: int
    description: str

    @property
    def version(self) -> tuple[int, int]:
        """(1, 0) to (1, 3)."""
        return self.major, self.minor

    @property
    def is_left_handed(self) -> bool:
        """Written for CARLA, which says so at the start of the description: y points to the right."""
        return self.description.lstrip().startswith("CARLA:")


class Parameter(Struct, frozen=True):
    """A declared parameter or variable with its value after overrides and expressions, as text."""

    name: str
    type: ParameterType
    value: str
    place: Place


class TrafficSignalPhase(Struct, frozen=True):
    """States of signals during one phase; `duration` [s]"""

    name: Name
    duration: float
    states: tuple[tuple[str, str], ...]


class TrafficSignalController(Struct, frozen=True):
    """Phases one after another, for ever; `delay` [s] to the `reference` controller."""

    name: str
    delay: Zero
    reference: str | None
    phases: Annotated[tuple[TrafficSignalPhase, ...], called("Phase")]
    place: Place


@dataclass(frozen=True, slots=True)
class Scenario:
    """One concrete scenario."""

    path: Path  # the file, as given
    header: FileHeader
    parameters: Mapping[str, Parameter]
    variables: Mapping[str, Parameter]
    """Global ones; a player starts from these values."""
    catalog_locations: Mapping[str, Path]  # catalog element name (``VehicleCatalog``) to its folder or file
    road_file: Path | None  # roadNetwork/LogicFile, resolved against the scenario's folder; None: no road
    traffic_signal_controllers: tuple[TrafficSignalController, ...]
    entities: tuple[Entity, ...]
    """In file order; a trailer described inside its tractor follows it as an entity of its own."""
    storyboard: Storyboard
    notes: tuple[Note, ...] = ()
    """What was read over because motion does not depend on it, or is replaced (a controller whose catalog is
    missing)."""
    input_hashes: Mapping[Path, str] = field(default_factory=dict)
    """Every file that was parsed, the scenario first, and the SHA-256 of the bytes that were."""
    source: bytes = field(default=b"", repr=False)  # the scenario file's bytes: the writer parses them again

    @property
    def input_files(self) -> tuple[Path, ...]:
        """Every file that was parsed, the scenario first."""
        return tuple(self.input_hashes)

    def entity(self, name: str) -> Entity:
        """The entity of that name; `KeyError` if there is none (the reader has checked every reference)."""
        for entity in self.entities:
            if entity.name == name:
                return entity
        raise KeyError(name)


# ---- the storyboard ----
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
                yield from ((story, act, group) for group in act.maneuver_groups)

    def events(self) -> Iterator[StoryEvent]:
        """Every event, with what it is in, in file order."""
        for story, act, group in self.groups():
            for maneuver, event in group.events():
                yield StoryEvent((story.name, act.name, group.name, maneuver.name, event.name), act, group, event)


class StoryEvent(Struct, frozen=True):
    """An event with what it is in; `path`: its names from the story down."""

    path: tuple[str, ...]
    act: Act
    group: ManeuverGroup
    event: Event

    @property
    def actors(self) -> tuple[str, ...]:
        """Who may act in it."""
        return actors_of(self.act, self.group, self.event)


def conditions_of(trigger: Trigger | None) -> Iterator[Condition]:
    """Every condition of a trigger, if there is one."""
    if trigger is not None:
        for group in trigger.groups:
            yield from group.conditions


def actors_of(act: Act, group: ManeuverGroup, event: Event) -> tuple[str, ...]:
    """Who may act in an event: the group's actors, and whoever triggers it where it is about them."""
    if not group.actors.select_triggering_entities:
        return group.actors.entity_refs
    triggering = [
        name
        for trigger in (act.start_trigger, event.start_trigger)
        for condition in conditions_of(trigger)
        if condition.triggering_entities is not None
        for name in condition.triggering_entities.entity_refs
    ]
    return tuple(dict.fromkeys([*group.actors.entity_refs, *triggering]))
