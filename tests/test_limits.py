from __future__ import annotations

import pytest

from xosc_lateral.base.limits import CONTEXT_RANGES, FILE_SIZE, limits_table
from xosc_lateral.base.segment import CONTEXT_UNITS


def test_the_table_has_every_limit_and_context() -> None:
    table = limits_table()
    assert f"| {FILE_SIZE.what} | {FILE_SIZE} | {FILE_SIZE.reason} |" in table
    assert all(f"\n| {name} | " in table for name in CONTEXT_RANGES)


def test_a_context_has_its_unit_beside_its_range() -> None:
    assert CONTEXT_UNITS["lead_distance"] == CONTEXT_UNITS["lane_width"] == "m" and CONTEXT_UNITS["is_truck"] == "-"
    assert (CONTEXT_UNITS["rain"], CONTEXT_UNITS["grade"], CONTEXT_UNITS["wind_direction"]) == ("mm/h", "%", "deg")


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (4000.5, "4000.5 MB, at most 4000 MB"),
        (1e12, "1000000000000 MB, at most 4000 MB"),
        (float("inf"), "inf MB, at most 4000 MB"),
    ],
)
def test_a_refusal_names_value_and_limit(value: float, words: str) -> None:
    assert FILE_SIZE.refusal(value) == f"size of an input file: {words}"
