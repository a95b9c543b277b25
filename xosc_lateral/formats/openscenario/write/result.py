"""What a writer hands back, what it checks before, and parameters that it fills in."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from xosc_lateral.errors import PlaybackError
from xosc_lateral.formats.openscenario.declarations import parameter_name
from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.formats.openscenario.provenance import refuse_converted
from xosc_lateral.motion.nominal import NominalMotion
from xosc_lateral.scenario import Scenario
from xosc_lateral.scenario.parameters import Scope
from xosc_lateral.scenario.place import Unsupported


def check_convertible(root: etree._Element, scenario: Scenario, motion: NominalMotion) -> None:
    """Refuse a scenario that was converted before, or that is over before anything has moved.

    Raises
    ------
    FormatError
        With the reason; a `PlaybackError` for a run of 0 s.
    """
    refuse_converted(root, scenario.path)
    if motion.end_time <= 0.0:
        trigger = scenario.storyboard.stop_trigger
        place = scenario.storyboard.place if trigger is None else trigger.place
        raise PlaybackError(
            f"the scenario is over at 0 s ({motion.ended_by}): there is nothing to convert",
            path=scenario.path,
            line=place.line,
            element=place.element,
        )


def global_scope(scenario: Scenario) -> Scope:
    """The values that the scenario was played with."""
    return Scope({name: final(parameter.value) for name, parameter in scenario.parameters.items()})


def final(value: str) -> str:
    """A value in which a leading ``$`` is text."""
    return f"\\{value}" if value.startswith("$") else value


def override_parameters(root: etree._Element, scenario: Scenario) -> None:
    """Write the values that parameters were played with, where they are not the file's own."""
    owner = next((element for element in root if local_name(element) == "ParameterDeclarations"), None)
    declarations = [] if owner is None else [element for element in owner if isinstance(element.tag, str)]
    own = Scope({parameter_name(element.get("name") or ""): element.get("value") or "" for element in declarations})
    for element in declarations:
        parameter = scenario.parameters.get(parameter_name(element.get("name") or ""))
        if parameter is not None and own.value(parameter.name) != parameter.value:
            element.set("value", parameter.value)


@dataclass(frozen=True, slots=True)
class WrittenScenario:
    """What was written.

    Parameters
    ----------
    path : Path
    sha256 : str
        Of the file's bytes.
    content_sha256 : str
        Of the file without its provenance.
    converted : tuple of str
        Entities that move otherwise than in the input.
    removed : tuple of Unsupported
        Controllers and actions that are no longer in the file although they are no motion, with reasons.
    data : bytes
        The file's bytes; empty if they were written.
    notes : tuple of str
        What the version or the player that it was made for lacks, a line each.
    """

    path: Path
    sha256: str
    content_sha256: str
    converted: tuple[str, ...]
    removed: tuple[Unsupported, ...]
    data: bytes
    notes: tuple[str, ...] = ()
