"""A scenario on its way to being written: what for (a player, a version), and its tree, which writers change."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from pathlib import Path

from lxml import etree
from msgspec import Struct

from xosc_lateral.base.errors import FormatError, PlaybackError
from xosc_lateral.base.note import Note
from xosc_lateral.files.openscenario.element import at_node, child_of
from xosc_lateral.files.openscenario.provenance import refuse_converted
from xosc_lateral.files.openscenario.references import final, parameter_name
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.build import Version, Vertices, version_text
from xosc_lateral.files.xml import parse_xml, read_document
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
