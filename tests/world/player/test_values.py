"""Parameters and variables while playing: how they are read, changed and compared."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from xosc_lateral.world.player.simulation import Values, holds
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.scenario.enums import ParameterType, Rule
from xosc_lateral.world.scenario.global_actions import ModifyOperation
from xosc_lateral.world.scenario.place import Place
from xosc_lateral.world.scenario.scenario import Parameter

numbers = st.floats(-1e6, 1e6)
OPPOSITE = (
    (Rule.EQUAL_TO, Rule.NOT_EQUAL_TO),
    (Rule.GREATER_THAN, Rule.LESS_OR_EQUAL),
    (Rule.LESS_THAN, Rule.GREATER_OR_EQUAL),
)
MIRRORED = (
    (Rule.EQUAL_TO, Rule.EQUAL_TO),
    (Rule.GREATER_THAN, Rule.LESS_THAN),
    (Rule.GREATER_OR_EQUAL, Rule.LESS_OR_EQUAL),
)


def values(**declared: tuple[ParameterType, str]) -> Values:
    return Values(
        "parameter",
        {name: Parameter(name, kind, text, Place("made", 1, name)) for name, (kind, text) in declared.items()},
    )


# ---- how numbers compare ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("rule", "opposite"), OPPOSITE)
@given(left=numbers, right=numbers)
def test_of_two_opposite_rules_one_holds(rule: Rule, opposite: Rule, left: float, right: float) -> None:
    assert holds(left, rule, right) != holds(left, opposite, right)


@pytest.mark.parametrize(("rule", "mirrored"), MIRRORED)
@given(left=numbers, right=numbers)
@example(left=-EPSILON, right=5e-324)  # once found: the tolerance was added to one side alone
def test_the_other_way_round_the_mirrored_rule_holds(rule: Rule, mirrored: Rule, left: float, right: float) -> None:
    assert holds(left, rule, right) == holds(right, mirrored, left)


@pytest.mark.parametrize(
    ("off", "equal", "greater", "at_least"),
    [(0.5 * EPSILON, True, False, True), (2.0 * EPSILON, False, True, True), (-0.5 * EPSILON, True, False, True),
     (-2.0 * EPSILON, False, False, False)],
    ids=["just above", "above", "just below", "below"],
)  # fmt: skip
def test_equal_is_within_the_tolerance_of_the_reference_player(
    off: float, equal: bool, greater: bool, at_least: bool
) -> None:
    found = [holds(off, rule, 0.0) for rule in (Rule.EQUAL_TO, Rule.GREATER_THAN, Rule.GREATER_OR_EQUAL)]
    assert found == [equal, greater, at_least]


@pytest.mark.parametrize("rule", [Rule.EQUAL_TO, Rule.GREATER_OR_EQUAL, Rule.LESS_OR_EQUAL])
def test_infinity_equals_itself(rule: Rule) -> None:
    """A time to collision that never comes, say: the difference of both would be no number."""
    assert holds(math.inf, rule, math.inf)
    assert not holds(math.inf, Rule.EQUAL_TO, -math.inf)


@given(st.integers(-50, 50), st.integers(-50, 50))
def test_whole_numbers_compare_exactly(left: int, right: int) -> None:
    assert Rule.GREATER_THAN.holds(left, right) == (left > right)
    assert Rule.LESS_OR_EQUAL.holds(left, right) == (left <= right)
    assert Rule.NOT_EQUAL_TO.holds(left, right) == (left != right)


# ---- values of a type ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        (ParameterType.DOUBLE, "2.50", 2.5),
        (ParameterType.INT, "-3.9", -3),
        (ParameterType.UNSIGNED_INT, "7", 7),
        (ParameterType.BOOLEAN, " true ", True),
        (ParameterType.BOOLEAN, "1", True),
        (ParameterType.BOOLEAN, "no", False),
        (ParameterType.STRING, " 2.5", " 2.5"),
        (ParameterType.DOUBLE, "fast", "fast"),
        (ParameterType.INT, "1e999", "1e999"),
    ],
    ids=str,
)
def test_a_text_is_read_as_its_type_and_stays_a_text_where_it_is_none(
    kind: ParameterType, text: str, value: object
) -> None:
    found = values(x=(kind, text))["x"]
    assert found == value
    assert type(found) is type(value)


def test_what_is_not_declared_is_not_there() -> None:
    made = values(speed=(ParameterType.DOUBLE, "3"))
    assert "speed" in made
    assert "Speed" not in made
    with pytest.raises(KeyError):
        made.set("Speed", "4")


def test_a_value_is_set_in_its_own_type() -> None:
    made = values(lanes=(ParameterType.UNSIGNED_SHORT, "2"))
    made.set("lanes", "3")
    assert made["lanes"] == 3
    assert made.compare("lanes", Rule.EQUAL_TO, "3.0")


@pytest.mark.parametrize(
    ("kind", "operation", "by", "expected"),
    [
        (ParameterType.DOUBLE, ModifyOperation.ADD, 0.5, 10.5),
        (ParameterType.DOUBLE, ModifyOperation.MULTIPLY, 0.5, 5.0),
        (ParameterType.INT, ModifyOperation.MULTIPLY, 0.25, 2),
        (ParameterType.INT, ModifyOperation.ADD, -11.5, -1),
    ],
    ids=["add", "multiply", "whole stays whole", "towards zero"],
)
def test_numbers_are_modified(kind: ParameterType, operation: ModifyOperation, by: float, expected: float) -> None:
    made = values(x=(kind, "10"))
    assert made.modify("x", operation, by)
    assert made["x"] == expected
    assert type(made["x"]) is type(expected)


@pytest.mark.parametrize(("kind", "text"), [(ParameterType.STRING, "10"), (ParameterType.BOOLEAN, "true")])
def test_what_is_no_number_is_not_modified_and_says_so(kind: ParameterType, text: str) -> None:
    made = values(x=(kind, text))
    before = made["x"]
    assert not made.modify("x", ModifyOperation.ADD, 1.0)
    assert made["x"] == before


@pytest.mark.parametrize(
    ("kind", "text", "rule", "other", "expected"),
    [
        (ParameterType.DOUBLE, "2.0", Rule.EQUAL_TO, "2.00000000001", True),
        (ParameterType.DOUBLE, "2.0", Rule.GREATER_THAN, "1.5", True),
        (ParameterType.INT, "2", Rule.LESS_THAN, "10", True),
        (ParameterType.STRING, "2", Rule.LESS_THAN, "10", False),
        (ParameterType.STRING, "go", Rule.EQUAL_TO, "go", True),
        (ParameterType.BOOLEAN, "true", Rule.NOT_EQUAL_TO, "0", True),
        (ParameterType.DOUBLE, "2.0", Rule.EQUAL_TO, "two", False),
    ],
)
def test_values_compare_in_their_own_type(
    kind: ParameterType, text: str, rule: Rule, other: str, expected: bool
) -> None:
    assert values(x=(kind, text)).compare("x", rule, other) is expected
