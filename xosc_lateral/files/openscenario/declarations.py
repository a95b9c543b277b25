"""Parameter, variable and monitor declarations, assignments, and the constraints on values."""

from __future__ import annotations

from collections.abc import Mapping

from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.world.scenario.enums import ParameterType, Rule
from xosc_lateral.world.scenario.parameters import ExpressionError, Scope, satisfies
from xosc_lateral.world.scenario.place import Unsupported
from xosc_lateral.world.scenario.scenario import Parameter

NAMES = frozenset({"parameterRef", "variableRef", "parameterName"})
"""Attributes that name a parameter instead of standing for its value."""


def parameter_name(text: str) -> str:
    """Name without the ``$`` that references in field files carry."""
    return text[1:] if text.startswith("$") else text


def declared_values(owner: XmlElement) -> dict[str, str]:
    """Names and values as written; of declarations with the same name the last counts, as in the reference player."""
    values = {}
    for declaration in owner.listed("ParameterDeclarations", "ParameterDeclaration"):
        name = parameter_name(declaration.raw("name") or "")
        if not name:
            declaration.fail("attribute 'name' is missing")
        values[name] = declaration.raw("value") or ""
    return values


def local_scope(owner: XmlElement) -> Scope:
    """Scope inside an element that may declare parameters (Story, Maneuver, inline Vehicle, Route, Trajectory ...)."""
    values = declared_values(owner)
    return Scope(values, owner.scope) if values else owner.scope


def entry_scope(entry: XmlElement, reference: XmlElement) -> Scope:
    """Scope inside a catalog entry: its declarations, overridden by what the reference assigns.

    Assigned values are read in the scope of the reference. Names that the entry does not declare are looked up there,
    too: field catalogs use the scenario's parameters.
    """
    assigned = {
        parameter_name(assignment.raw("parameterRef") or ""): final(assignment.text("value"))
        for assignment in reference.listed("ParameterAssignments", "ParameterAssignment")
    }
    return Scope({**declared_values(entry), **assigned}, reference.scope)


def final(value: str) -> str:
    """A value in which a leading ``$`` is text: nobody fills it in again."""
    return f"\\{value}" if value.startswith("$") else value


def read_declarations(
    root: XmlElement, overrides: Mapping[str, str], remarks: list[Unsupported]
) -> tuple[Scope, dict[str, Parameter]]:
    """Global scope and parameters, with overrides in place.

    Raises `FormatError`: An override of a parameter that is not declared or that violates its constraints, or a value
    that can't be evaluated. A declared value that violates the constraints beside it is only remarked: it plays.
    """
    values = declared_values(root)
    unknown = sorted(set(overrides) - set(values))
    if unknown:
        known = ", ".join(sorted(values)[:10]) or "none"
        root.fail(f"parameter '{unknown[0]}' is not declared (declared: {known})")
    scope = Scope({**values, **overrides})
    parameters = {}
    for declaration in root.listed("ParameterDeclarations", "ParameterDeclaration"):
        item = declaration.within(scope)
        name, value = parameter_name(item.raw("name") or ""), value_of(item)
        kind = item.choice("parameterType", ParameterType, ParameterType.STRING)
        parameters[name] = Parameter(name, kind, value, item.place())
        broken = broken_constraint(item, value)
        if broken and name in overrides:
            item.fail(f"value '{value}' violates {broken}")
        if broken:
            remarks.append(Unsupported("ConstraintGroup", item.place(), f"'{value}' violates {broken}"))
    return scope, parameters


def value_of(declaration: XmlElement) -> str:
    """Value of the parameter that an element declares, in its scope."""
    try:
        return declaration.scope.value(parameter_name(declaration.raw("name") or ""))
    except ExpressionError as error:
        declaration.fail(f"value: {error}")


def read_variables(root: XmlElement) -> dict[str, Parameter]:
    """Variable declarations (1.2)."""
    variables = {}
    for declaration in root.listed("VariableDeclarations", "VariableDeclaration"):
        name, value = parameter_name(declaration.text("name")), declaration.text("value", "")
        kind = declaration.choice("variableType", ParameterType, ParameterType.STRING)
        variables[name] = Parameter(name, kind, value, declaration.place())
    return variables


def broken_constraint(declaration: XmlElement, value: str) -> str | None:
    """Words for the constraints that a value violates; None if it satisfies one of the groups, or there is none."""
    groups = []
    for group in declaration.children("ConstraintGroup"):
        constraints = [(item.choice("rule", Rule), item.text("value")) for item in group.children("ValueConstraint")]
        if all(satisfies(value, rule, limit) for rule, limit in constraints):
            return None
        groups.append(" and ".join(f"{rule} {limit}" for rule, limit in constraints))
    return " or ".join(groups) or None
