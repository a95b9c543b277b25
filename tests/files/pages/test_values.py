"""Numbers as readers see them: read back, they are what they were to three digits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from xosc_lateral.files.pages.page import MISSING_TEXT, format_number, format_value


@given(st.floats(-1e12, 1e12).filter(lambda value: abs(value) > 1e-12))
def test_a_number_is_shown_to_three_digits_or_better(value):
    assert float(format_number(value)) == pytest.approx(value, rel=0.00501)


@given(st.floats(1e-4, 9.9e5))
def test_no_number_shows_more_digits_than_it_was_asked_for_unless_they_stand_before_the_point(value):
    shown = format_number(value)
    digits = shown.replace(".", "").lstrip("0")
    assert "e" not in shown
    assert len(digits) <= 3 or "." not in shown


@pytest.mark.parametrize(
    ("value", "shown"),
    [(0.2134, "0.213"), (9.996, "10.0"), (0.9996, "1.00"), (99.96, "100"), (1234.6, "1235"), (1.2e-9, "1.20e-09"),
     (0.0, "0"), (-0.0, "0"), (12.0, "12"), (3e9, "3.00e+09"), (math.inf, "∞"), (-math.inf, "-∞"),
      (math.nan, MISSING_TEXT)],
)  # fmt: skip
def test_numbers_at_the_edges_of_the_rule(value, shown):
    assert format_number(value) == shown


@pytest.mark.parametrize(
    ("value", "shown"),
    [(None, MISSING_TEXT), ("", MISSING_TEXT), (True, "yes"), (np.bool_(False), "no"), (np.float32(0.5), "0.500"),
     (np.int64(7), "7"), (float("nan"), MISSING_TEXT), ([1.0, None, "a"], f"1, {MISSING_TEXT}, a"), ([], MISSING_TEXT),
     ({"b": 2.5, "a": []}, f"b: 2.50, a: {MISSING_TEXT}"), ("<b>", "<b>")],
)  # fmt: skip
def test_whatever_a_result_holds_is_written_out(value, shown):
    assert format_value(value) == shown


def test_a_format_of_the_callers_own_is_kept_but_for_what_is_not_there():
    assert format_value(0.5, ".1%") == "50.0%"
    assert format_value(math.nan, ".1%") == MISSING_TEXT
