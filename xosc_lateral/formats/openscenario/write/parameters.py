"""Global parameters of a written scenario."""

from __future__ import annotations

from lxml import etree

from xosc_lateral.formats.openscenario.declarations import parameter_name
from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.scenario import Scenario
from xosc_lateral.scenario.parameters import Scope


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
