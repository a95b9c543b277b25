"""Piecewise cubics."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from xosc_lateral.world.road.piecewise import PiecewiseCubic, shift

coefficient = st.floats(-2.0, 2.0)
cubic = st.tuples(coefficient, coefficient, coefficient, coefficient)
records = st.lists(st.tuples(st.floats(0.0, 9.0), cubic), min_size=1, max_size=4)


def value(c, x):
    return c[0] + c[1] * x + c[2] * x**2 + c[3] * x**3


@given(cubic, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_a_shifted_cubic_has_the_same_values(c, by, x):
    assert value(shift(c, by), x) == pytest.approx(value(c, by + x), abs=1e-9)


@given(records, records, st.floats(0.0, 12.0))
def test_a_sum_has_the_sum_of_values_everywhere(one, other, s):
    first, second = (PiecewiseCubic.from_records(r, begin=0.0) for r in (one, other))
    total = first.plus(second, -0.5)
    assert total.at(s) == pytest.approx(first.at(s) - 0.5 * second.at(s), abs=1e-8)


@given(records, st.floats(0.0, 12.0))
def test_a_restriction_changes_no_value_inside(one, s):
    whole = PiecewiseCubic.from_records(one, begin=0.0)
    part = whole.restricted(2.0, 8.0)
    if 2.0 <= s < 8.0:
        assert part.at(s) == pytest.approx(whole.at(s), abs=1e-8)
    assert part.starts[0] == 2.0
    assert part.starts[-1] < 8.0


@given(records, st.floats(0.001, 12.0))
def test_the_slope_is_the_derivative(one, s):
    function = PiecewiseCubic.from_records(one, begin=0.0)
    inside = all(abs(s - start) > 1e-3 for start in function.starts)
    h = 1e-5
    if inside:
        difference = (function.at(s + h) - function.at(s - h)) / (2.0 * h)
        assert function.with_slope_at(s)[1] == pytest.approx(difference, abs=1e-4)


def test_records_may_come_in_any_order_and_the_last_of_equals_counts():
    function = PiecewiseCubic.from_records(
        [(5.0, (2.0, 0.0, 0.0, 0.0)), (0.0, (1.0, 0.0, 0.0, 0.0)), (5.0, (3.0, 0.0, 0.0, 0.0))], begin=0.0
    )
    assert (function.at(4.999), function.at(5.0)) == (1.0, 3.0)


def test_before_the_first_record_there_is_nothing():
    function = PiecewiseCubic.from_records([(5.0, (2.0, 0.0, 0.0, 0.0))], begin=0.0)
    assert (function.at(0.0), function.at(4.999), function.at(5.0)) == (0.0, 0.0, 2.0)
    assert PiecewiseCubic.from_records([], begin=0.0).is_zero
