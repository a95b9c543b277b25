"""Transition curves against their closed forms."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.stage import CURVES
from xosc_lateral.world.player.transition import Transition
from xosc_lateral.world.scenario.enums import DynamicsDimension, DynamicsShape

RANGE_OF_RATE = {DynamicsShape.LINEAR: 1.0, DynamicsShape.CUBIC: 1.5, DynamicsShape.SINUSOIDAL: pi / 2.0}
SHAPES = list(RANGE_OF_RATE)


def begun(shape: DynamicsShape, dimension: DynamicsDimension, value: float, start: float, target: float) -> Transition:
    transition = Transition(shape, dimension, value)
    transition.begin(start, target)
    return transition


@pytest.mark.parametrize("shape", SHAPES)
def test_values_and_slopes_are_those_of_the_closed_form(shape: DynamicsShape) -> None:
    transition = begun(shape, DynamicsDimension.TIME, 4.0, 3.0, -2.0)
    for p in np.linspace(0.0, 4.0, 41):
        transition.parameter = float(p)
        assert transition.value() == pytest.approx(3.0 - 5.0 * CURVES[shape.value](p / 4.0), abs=1e-12)
        if 0.0 < p < 4.0:
            numeric = -5.0 * (CURVES[shape.value]((p + 1e-6) / 4.0) - CURVES[shape.value]((p - 1e-6) / 4.0)) / 2e-6
            assert transition.slope() == pytest.approx(numeric, abs=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
@given(
    rate=st.floats(0.05, 50.0), start=st.floats(-50.0, 50.0), change=st.floats(0.1, 60.0), sign=st.sampled_from([-1, 1])
)
def test_a_rate_is_the_peak_of_the_slope(
    shape: DynamicsShape, rate: float, start: float, change: float, sign: int
) -> None:
    transition = begun(shape, DynamicsDimension.RATE, sign * rate, start, start + sign * change)
    assert transition.range == pytest.approx(RANGE_OF_RATE[shape] * change / rate, rel=1e-9)
    slopes = []
    for u in (0.25, 0.5, 0.75):
        transition.parameter = u * transition.range
        slopes.append(abs(transition.slope()))
    assert max(slopes) == pytest.approx(rate, rel=1e-9)


@pytest.mark.parametrize("dimension", list(DynamicsDimension))
def test_a_step_is_at_its_target_from_the_start(dimension: DynamicsDimension) -> None:
    transition = begun(DynamicsShape.STEP, dimension, 5.0, 1.0, 9.0)
    assert transition.is_step
    assert transition.value() == 9.0


def test_a_range_of_zero_is_a_step() -> None:
    transition = begun(DynamicsShape.LINEAR, DynamicsDimension.TIME, 0.0, 1.0, 9.0)
    assert transition.is_step
    assert transition.is_done


@pytest.mark.parametrize("shape", SHAPES)
def test_a_limited_slope_stretches_the_way_through(shape: DynamicsShape) -> None:
    transition = begun(shape, DynamicsDimension.TIME, 1.0, 0.0, 20.0)
    transition.limit_slope(5.0)
    steps = 0
    while not transition.is_done:
        before = transition.value()
        transition.advance(0.01)
        assert transition.value() - before <= 0.05 + 1e-9
        steps += 1
    assert steps == pytest.approx(RANGE_OF_RATE[shape] * 20.0 / 5.0 / 0.01, abs=1.0)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_range_for_a_curvature_keeps_the_second_derivative_under_it(shape: DynamicsShape) -> None:
    transition = begun(shape, DynamicsDimension.TIME, 1.0, 0.0, 3.0)
    transition.range = transition.range_for_curvature(0.5)
    u = np.linspace(0.0, 1.0, 2001)
    if shape is not DynamicsShape.LINEAR:
        values = np.array([3.0 * CURVES[shape.value](x) for x in u])
        second = np.diff(values, 2) / (transition.range / 2000) ** 2
        assert np.abs(second).max() == pytest.approx(0.5, rel=1e-2)


def test_a_step_has_no_range_whatever_value_it_comes_with() -> None:
    transition = Transition(DynamicsShape.STEP, DynamicsDimension.TIME, 4.8)
    transition.begin(10.0, 12.0)
    assert transition.value() == 12.0
    assert transition.is_done


def test_without_lateral_acceleration_nobody_moves_aside():
    transition = Transition(DynamicsShape.SINUSOIDAL, DynamicsDimension.TIME, 0.0)
    transition.begin(0.0, 2.0)
    assert transition.range_for_curvature(0.0) == np.inf
    transition.begin(2.0, 2.0)
    assert transition.range_for_curvature(0.0) == 0.0
