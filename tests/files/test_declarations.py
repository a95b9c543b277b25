"""Declared parameters: who overrides whom, in whose scope a value is read, and what constraints allow."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from lxml import etree

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.note import Note
from xosc_lateral.files.openscenario.element import XmlElement, at_node
from xosc_lateral.files.openscenario.references import (
    broken_constraint,
    declared_values,
    entry_scope,
    local_scope,
    read_declarations,
    read_variables,
)
from xosc_lateral.world.scenario.enums import ParameterType
from xosc_lateral.world.scenario.parameters import Scope


def element(content: str, scope: Scope | None = None) -> XmlElement:
    root = etree.fromstring(f"<Owner>{content}</Owner>")
    return XmlElement(root, Path("made.xosc"), scope or Scope({}))


def declared(*parameters: tuple[str, str, str], constraints: str = "") -> str:
    inside = "".join(
        f'<ParameterDeclaration name="{name}" parameterType="{kind}" value="{value}">{constraints}'
        "</ParameterDeclaration>"
        for name, kind, value in parameters
    )
    return f"<ParameterDeclarations>{inside}</ParameterDeclarations>"


def assigned(**values: str) -> str:
    inside = "".join(f'<ParameterAssignment parameterRef="{name}" value="{text}"/>' for name, text in values.items())
    return f"<ParameterAssignments>{inside}</ParameterAssignments>"


def group(*constraints: tuple[str, str]) -> str:
    inside = "".join(f'<ValueConstraint rule="{rule}" value="{limit}"/>' for rule, limit in constraints)
    return f"<ConstraintGroup>{inside}</ConstraintGroup>"


# ---- what is declared ------------------------------------------------------------------------------------------------
def test_of_two_declarations_of_a_name_the_last_counts_with_or_without_its_dollar() -> None:
    assert declared_values(element(declared(("$speed", "double", "20"), ("speed", "double", "30")))) == {"speed": "30"}
    assert declared_values(element("")) == {}


def test_a_declaration_without_a_name_is_named_by_its_line() -> None:
    with pytest.raises(FormatError, match=r"made\.xosc.*attribute 'name' is missing"):
        declared_values(element('<ParameterDeclarations><ParameterDeclaration value="3"/></ParameterDeclarations>'))


@pytest.mark.parametrize(
    ("written", "kind"),
    [("integer", ParameterType.INT), ("bool", ParameterType.BOOLEAN), ("float", ParameterType.DOUBLE),
     ("double", ParameterType.DOUBLE), ("unsignedShort", ParameterType.UNSIGNED_SHORT)],
)  # fmt: skip
def test_types_go_by_old_and_by_usual_names_too(written: str, kind: ParameterType) -> None:
    _, parameters = read_declarations(element(declared(("x", written, "1"))), {}, [])
    assert parameters["x"].type is kind


def test_a_value_may_be_reckoned_from_others() -> None:
    scope, parameters = read_declarations(
        element(declared(("v", "double", "20"), ("gap", "double", "${$v * 1.5}"))), {}, []
    )
    assert float(parameters["gap"].value) == pytest.approx(30.0)
    assert float(scope.fill("$gap")) == pytest.approx(30.0)


def test_an_override_reaches_what_is_reckoned_from_it() -> None:
    root = element(declared(("v", "double", "20"), ("gap", "double", "${$v * 1.5}")))
    _, parameters = read_declarations(root, {"v": "30"}, [])
    assert float(parameters["gap"].value) == pytest.approx(45.0)


def test_an_override_of_nothing_names_what_there_is() -> None:
    with pytest.raises(FormatError, match=r"parameter 'speeed' is not declared \(declared: gap, speed\)"):
        read_declarations(element(declared(("speed", "double", "1"), ("gap", "double", "2"))), {"speeed": "3"}, [])
    with pytest.raises(FormatError, match=r"\(declared: none\)"):
        read_declarations(element(""), {"v": "3"}, [])


def test_a_value_that_cannot_be_reckoned_is_an_error() -> None:
    with pytest.raises(FormatError, match="value: "):
        read_declarations(element(declared(("v", "double", "${$nobody + 1}"))), {}, [])


def test_variables_are_texts_unless_they_say_otherwise() -> None:
    content = (
        '<VariableDeclarations><VariableDeclaration name="n" variableType="integer" value="2"/>'
        '<VariableDeclaration name="word"/></VariableDeclarations>'
    )
    found = read_variables(element(content))
    assert (found["n"].type, found["n"].value) == (ParameterType.INT, "2")
    assert (found["word"].type, found["word"].value) == (ParameterType.STRING, "")


# ---- scopes ----------------------------------------------------------------------------------------------------------
def test_inside_an_element_its_own_parameters_hide_those_outside() -> None:
    outside = Scope({"v": "20", "w": "7"})
    inside = local_scope(element(declared(("v", "double", "30")), outside))
    assert (inside.fill("$v"), inside.fill("$w")) == ("30", "7")
    assert local_scope(element("", outside)) is outside


def test_a_catalog_entry_takes_what_is_assigned_then_its_own_then_the_scenario_s() -> None:
    entry = element(declared(("v", "double", "1"), ("w", "double", "2")))
    reference = element(assigned(v="$fast"), Scope({"fast": "50", "w": "99", "only": "5"}))
    scope = entry_scope(entry, reference)
    assert [scope.fill(name) for name in ("$v", "$w", "$only")] == ["50", "2", "5"]


def test_an_assigned_value_is_final() -> None:
    """What it says is not looked up again, in whosever scope: a dollar in it is a dollar."""
    entry = element(declared(("v", "string", "")))
    reference = element(assigned(v="\\$cheap"), Scope({"cheap": "wrong"}))
    assert entry_scope(entry, reference).fill("$v") == "$cheap"


# ---- constraints -----------------------------------------------------------------------------------------------------
WITHIN = group(("greaterThan", "0"), ("lessOrEqual", "50"))


@pytest.mark.parametrize(("value", "broken"), [("10", False), ("50", False), ("0", True), ("51", True)])
def test_all_constraints_of_a_group_have_to_hold(value: str, broken: bool) -> None:
    assert (broken_constraint(element(WITHIN), value) is not None) is broken


@pytest.mark.parametrize(("value", "broken"), [("10", False), ("80", False), ("60", True)])
def test_of_several_groups_one_has_to(value: str, broken: bool) -> None:
    found = broken_constraint(element(WITHIN + group(("equalTo", "80"))), value)
    assert (found is not None) is broken
    if found:
        assert found == "greaterThan 0 and lessOrEqual 50 or equalTo 80"


def test_without_a_constraint_nothing_is_broken() -> None:
    assert broken_constraint(element(""), "anything") is None


def test_a_declared_value_beyond_its_constraints_plays_and_is_remarked_an_override_is_refused() -> None:
    root = element(declared(("v", "double", "80"), constraints=WITHIN))
    notes: list[Note] = []
    _, parameters = read_declarations(root, {}, notes)
    assert parameters["v"].value == "80"
    assert [note.what for note in notes] == ["'80' violates greaterThan 0 and lessOrEqual 50"]
    with pytest.raises(FormatError, match="value '90' violates greaterThan 0 and lessOrEqual 50"):
        read_declarations(root, {"v": "90"}, [])
    notes.clear()
    read_declarations(root, {"v": "40"}, notes)
    assert notes == []


def test_an_element_knows_its_place_in_the_tree() -> None:
    root = etree.fromstring("<a><!-- a comment --><b/><c><d/><?pi?><d><e/></d></c></a>")

    def below(element: XmlElement) -> Iterator[XmlElement]:
        yield element
        for child in element.children():
            yield from below(child)

    found = [*below(XmlElement(root, Path("made.xosc"), Scope({})))]
    assert [one.tag for one in found] == ["a", "b", "c", "d", "d", "e"]
    assert found[-1].node == (2, 2, 0) and found[-1].within(Scope({})).node == (2, 2, 0)
    assert all(at_node(root, one.node) is one.xml for one in found)
