"""A scenario on its way to being written: what for (a player, a version), and its tree, which writers change."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import NoReturn

from lxml import etree
from msgspec import Struct

from xosc_lateral.base.errors import FormatError, PlaybackError
from xosc_lateral.base.note import Note
from xosc_lateral.files.openscenario.element import at_node, child_of, local_name
from xosc_lateral.files.openscenario.provenance import refuse_converted
from xosc_lateral.files.openscenario.references import final, parameter_name
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.build import Version, Vertices, version_text
from xosc_lateral.files.xml import line_of, parse_xml, read_document
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.scenario.parameters import Scope
from xosc_lateral.world.scenario.scenario import Action, Scenario

VERSIONS: tuple[Version, ...] = ((1, 0), (1, 1), (1, 2), (1, 3), (1, 4))
"""That can be written."""


class Player(StrEnum):
    """Who is to play a written scenario."""

    STANDARD = "standard"
    ESMINI = "esmini"
    CARLA = "carla"


class TargetPlayer(Struct, frozen=True):
    """Player and version; `ValueError` for a version that the player does not read."""

    player: Player = Player.STANDARD
    version: Version | None = None  # (1, 0) to (1, 4). Without: the input's own, or the only one that the player reads.

    def __post_init__(self) -> None:
        if self.player is Player.CARLA and self.version not in (None, (1, 0)):
            raise ValueError("CARLA's ScenarioRunner reads version 1.0 alone")

    def version_for(self, scenario: Scenario) -> Version:
        """The version to write."""
        if self.version is not None:
            return self.version
        return (1, 0) if self.player is Player.CARLA else min(scenario.header.version, VERSIONS[-1])


STANDARD = TargetPlayer()


def target(player: str = Player.STANDARD.value, version: str | None = None) -> TargetPlayer:
    """From a user's words: a player's name, and a version such as "1.2"; `ValueError` for words that are neither."""
    known = {version_text(one): one for one in VERSIONS}
    if version is not None and version not in known:
        raise ValueError(f"version {version!r} can't be written; {', '.join(known)} can")
    return TargetPlayer(Player(player), None if version is None else known[version])


class Draft:
    """A scenario's tree, changed into the output's; `FormatError`: converted before; `PlaybackError`: a run of 0 s."""

    def __init__(self, scenario: Scenario, motion: NominalMotion, target: TargetPlayer = STANDARD) -> None:
        self.scenario, self.motion, self.player = scenario, motion, target.player
        self.root = parse_xml(scenario.source, scenario.path)
        refuse_converted(self.root, scenario.path)
        board = child_of(self.root, "Storyboard")
        assert board is not None
        self.storyboard = board
        if motion.end_time <= 0.0:
            trigger = scenario.storyboard.stop_trigger
            place = scenario.storyboard.place if trigger is None else trigger.place
            what = f"the scenario is over at 0 s ({motion.ended_by}): there is nothing to convert"
            raise place.error(what, PlaybackError)
        self.version = target.version_for(scenario)
        self.is_adapted = self.player is Player.CARLA or self.version != scenario.header.version
        """In another version, or for a strict reader; else what an input has beyond its version stays as it is."""
        self.scope = Scope({name: final(parameter.value) for name, parameter in scenario.parameters.items()})
        """The values that the scenario was played with."""
        self.vertices = Vertices(scenario.source)
        self.notes: list[Note] = []
        """What there is to say of the output: what is no longer in it although it is no motion, say."""

    @property
    def init_actions(self) -> etree._Element:
        """What holds the actions of init, in the tree."""
        init = child_of(self.storyboard, "Init")
        assert init is not None
        actions = child_of(init, "Actions")
        return init if actions is None else actions

    @cached_property
    def untouched(self) -> etree._Element:
        """The scenario as it is: where actions are copied from."""
        return parse_xml(self.scenario.source, self.scenario.path)

    def put_last(self, story: etree._Element) -> None:
        """Add a story after all others."""
        stop = child_of(self.storyboard, "StopTrigger")
        place = len(self.storyboard) if stop is None else self.storyboard.index(stop)
        build.insert_indented(self.storyboard, place, story)

    def override_parameters(self) -> None:
        """Write the values that parameters were played with, where they are not the file's own."""
        declarations = self.root.findall("{*}ParameterDeclarations/{*}ParameterDeclaration")
        declared = Scope({parameter_name(item.get("name") or ""): item.get("value") or "" for item in declarations})
        for item in declarations:
            parameter = self.scenario.parameters.get(parameter_name(item.get("name") or ""))
            if parameter is not None and declared.value(parameter.name) != parameter.value:
                item.set("value", parameter.value)


def source_of(action: Action, scenario: Scenario, root: etree._Element) -> etree._Element:
    """The element that an action was read from: in the scenario, whose unchanged parse `root` is, or in a catalog."""
    if action.place.path == str(scenario.path):
        return at_node(root, action.place.node)
    return at_node(unchanged(Path(action.place.path), scenario), action.place.node)


def unchanged(path: Path, scenario: Scenario) -> etree._Element:
    """Root of a catalog that the scenario was read with; `FormatError` if it is another one now."""
    document = read_document(path)
    if scenario.input_hashes.get(path, document.sha256) != document.sha256:
        raise FormatError("changed during the conversion", path=path)
    return document.root


@dataclass(frozen=True, slots=True)
class WrittenScenario:
    """What was written."""

    sha256: str  # of the file's bytes
    content_sha256: str  # of the file without its provenance
    converted: tuple[str, ...]  # entities that move otherwise than in the input
    data: bytes  # the file's bytes; empty if they were written
    notes: tuple[Note, ...] = ()  # what is left out, or not as it was


# ---- taking out what the target does not know: named, never in silence, and never what others hang on ----
MOTION = frozenset({"LongitudinalAction", "LateralAction", "SynchronizeAction", "TeleportAction", "RoutingAction"})
"""Private actions that move an entity."""

_TRAJECTORIES = {"Clothoid", "ClothoidSpline", "ClothoidSplineSegment", "Polyline", "Vertex"}
_HEADERS = {"Catalog", "CatalogLocations", "FileHeader", "OpenSCENARIO", "ParameterDeclaration", "RoadNetwork"}
_OTHER_ELEMENTS = {"Phase", "Properties", "TrafficDefinition", "Vehicle", "VisibilityAction", "Weather"}
_DISPENSABLE = frozenset({*_TRAJECTORIES, *_HEADERS, *_OTHER_ELEMENTS, "AbsoluteSpeed", "RelativeSpeedToMaster"})
"""Elements that are complete without what newer versions add to them; the others are a choice of one."""

_MEANINGLESS = frozenset(
    {("routingAlgorithm", "undefined"), ("routingAlgorithm", "shortest"), ("coordinateSystem", "entity")}
)
"""Attributes of conditions that say what their absence means."""


@dataclass(slots=True)
class Losses:
    """What is taken out of a scenario, and why."""

    root: etree._Element  # changed in place
    path: Path  # of the scenario, for errors
    target: str  # what lacks things, as in ``version 1.0``
    # reactive: maneuvers and conditions still decide on what happens: those can't be taken out, and events stay
    reactive: bool
    notes: list[Note] = field(default_factory=list)  # in order, once

    def note(self, text: str) -> None:
        """Say something once."""
        note = Note(text, is_warning=True)
        if note not in self.notes:
            self.notes.append(note)

    def refuse(self, element: etree._Element, what: str, hint: str = "; use --mode trajectory") -> NoReturn:
        """`FormatError` for what can't be done without."""
        raise FormatError(
            f"{self.target} has no {what}{hint}", path=self.path, line=line_of(element), element=_of(element)
        )

    def has(self, element: etree._Element) -> bool:
        """Whether an element is still there, or gone with something around it."""
        return any(owner is self.root for owner in element.iterancestors())

    def attribute(self, element: etree._Element, name: str) -> None:
        """Take an attribute out."""
        what = f"{local_name(element)}/@{name}"
        if (name, element.get(name)) not in _MEANINGLESS:
            if _above(element, "Condition") is not None:
                self.refuse(element, f"{what} ('{element.get(name)}')")
            self.note(f"{what}: left out ({self.target} has none)")
        del element.attrib[name]

    def element(self, element: etree._Element, why: str = "") -> None:
        """Take an element out, with the action that is nothing without it."""
        parent = element.getparent()
        if parent is None or not self.has(element):
            return
        what, why = local_name(element), why or f"{self.target} has none"
        if _above(element, "Condition") is not None:
            self.refuse(element, what)
        action = _above(element, "Action", "PrivateAction", "GlobalAction", "UserDefinedAction")
        if action is None or local_name(parent) in _DISPENSABLE:
            if self.reactive and action is not None and _moves(action):
                self.refuse(element, f"{local_name(parent)}/{what}")
            self.note(f"{what}: left out ({why})")
            remove(element)
            return
        self.action(element, why)

    def action(self, element: etree._Element, why: str) -> None:
        """Take out the action that an element belongs to; an event keeps its name for others to refer to."""
        if not self.has(element):
            return
        event = _above(element, "Event")
        tags = ("Action",) if event is not None else ("PrivateAction", "GlobalAction", "UserDefinedAction")
        action = _above(element, *tags)
        assert action is not None
        if self.reactive and _moves(action):
            self.refuse(element, local_name(element))
        where = f"Event '{event.get('name')}'" if event is not None else "Init"
        self.note(f"{where}: {local_name(element)} left out ({why})")
        if self.reactive and event is not None:
            action[:] = []
            build.sub(action, "UserDefinedAction/CustomCommandAction", type="nothing")
        else:
            _remove_upward(action)


def remove(element: etree._Element) -> None:
    """Take an element out; the white space after it goes, too."""
    parent = element.getparent()
    assert parent is not None
    before = element.getprevious()
    tail = element.tail
    if element.getnext() is None and before is not None:
        before.tail = tail
    parent.remove(element)
    tidy(parent)


def tidy(element: etree._Element) -> None:
    """No white space in an element that is empty but for comments: it would count as content."""
    if all(not isinstance(child.tag, str) for child in element):
        element.text = None
        for comment in element:
            comment.tail = None


def _remove_upward(action: etree._Element) -> None:
    """An action, and the event, maneuver or Private that it was all of."""
    owner = action.getparent()
    remove(action)
    if owner is None:
        return
    left = {local_name(child) for child in owner if isinstance(child.tag, str)}
    if (local_name(owner) == "Event" and "Action" not in left) or (
        local_name(owner) in ("Private", "Maneuver") and not left & {"PrivateAction", "Event"}
    ):
        _remove_upward(owner)


def _above(element: etree._Element, *tags: str) -> etree._Element | None:
    """The nearest of these tags, the element itself included."""
    if local_name(element) in tags:
        return element
    return next((owner for owner in element.iterancestors() if local_name(owner) in tags), None)


def _moves(action: etree._Element) -> bool:
    return any(isinstance(item.tag, str) and local_name(item) in MOTION for item in action.iter())


def _of(element: etree._Element) -> str:
    owner = _above(element, "Condition", "Event", "ScenarioObject")
    if owner is None or not owner.get("name"):
        return local_name(element)
    return f"{local_name(owner)} '{(owner.get('name') or '')[:60]}'"
