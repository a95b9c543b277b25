"""Taking out of a scenario what its target does not know: named, never in silence, and never what others hang on."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from lxml import etree

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.note import Note
from xosc_lateral.files.openscenario.element import local_name
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.xml import line_of

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
