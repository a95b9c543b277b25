from __future__ import annotations

import pytest

from xosc_lateral.world.scenario.enums import Rule
from xosc_lateral.world.scenario.parameters import MAX_CHAIN, ExpressionError, Scope, satisfies


def test_parameters_may_refer_to_later_ones() -> None:
    scope = Scope({"a": "$b", "b": "${$c * 2}", "c": "4"})
    assert scope.fill("$a") == "8.000000"


def test_inner_scope_hides_outer_one_and_falls_back_to_it() -> None:
    inner = Scope({"a": "inner"}, Scope({"a": "outer", "b": "$a"}))
    assert inner.fill("$a") == "inner"
    assert inner.fill("$b") == "outer"
    assert inner.local_values() == {"a": "inner"}


def test_only_a_whole_value_is_a_reference() -> None:
    scope = Scope({"a": "1"})
    assert scope.fill("costs 5$a") == "costs 5$a"
    assert scope.fill("$a b") == "$a b"
    assert scope.fill("\\$a") == "$a"
    assert scope.fill("") == ""


def test_a_cycle_is_named() -> None:
    with pytest.raises(ExpressionError, match=r"'a' depends on itself \(a -> b -> c -> a\)"):
        Scope({"a": "$b", "b": "${$c + 1}", "c": "$a"}).value("a")


def test_a_failed_evaluation_does_not_look_like_a_cycle_later() -> None:
    scope = Scope({"a": "${1/0}"})
    for _ in range(2):
        with pytest.raises(ExpressionError, match="division"):
            scope.value("a")


def test_long_chains_are_bounded() -> None:
    names = [f"p{n}" for n in range(1000)]
    scope = Scope({name: f"${{${following} + 0}}" for name, following in zip(names, [*names[1:], "p0"], strict=True)})
    with pytest.raises(ExpressionError, match=f"more than {MAX_CHAIN}"):
        scope.value("p0")


@pytest.mark.parametrize(
    ("value", "rule", "limit", "holds"),
    [
        ("2", Rule.GREATER_THAN, "1.0", True),
        ("2.0", Rule.EQUAL_TO, "2", True),
        ("10", Rule.LESS_THAN, "9", False),
        ("9", Rule.LESS_OR_EQUAL, "9.0", True),
        ("9", Rule.GREATER_OR_EQUAL, "9.5", False),
        ("car", Rule.EQUAL_TO, "car", True),
        ("car", Rule.NOT_EQUAL_TO, "van", True),
        ("car", Rule.LESS_THAN, "van", False),
        ("true", Rule.EQUAL_TO, "true", True),
    ],
)
def test_constraints_compare_numbers_as_numbers_and_text_as_text(
    value: str, rule: Rule, limit: str, holds: bool
) -> None:
    assert satisfies(value, rule, limit) is holds
