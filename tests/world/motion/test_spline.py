"""The natural spline beside scipy's, with its slopes at both ends."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from xosc_lateral.world.motion.trajectory import NaturalSpline

numbers = st.floats(-5.0, 5.0)
gaps = st.floats(0.05, 200.0)


@st.composite
def points(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    steps = draw(st.lists(gaps, min_size=1, max_size=30))
    knots = draw(st.floats(-1e4, 1e4)) + np.concatenate([[0.0], np.cumsum(steps)])
    return knots, np.array(draw(st.lists(numbers, min_size=len(knots), max_size=len(knots))))


def natural(knots: np.ndarray, values: np.ndarray) -> CubicSpline:
    """Two points are a line: scipy asks for three where ends are natural."""
    if len(knots) == 2:
        return CubicSpline(knots, values, bc_type=((2, 0.0), (2, 0.0)))
    return CubicSpline(knots, values, bc_type="natural")


@given(points())
def test_it_is_the_spline_of_a_library(made: tuple[np.ndarray, np.ndarray]) -> None:
    knots, values = made
    at = np.linspace(knots[0], knots[-1], 101)
    np.testing.assert_allclose(NaturalSpline.natural(knots, values)(at), natural(knots, values)(at), atol=1e-7)


@given(points())
def test_it_goes_through_its_points(made: tuple[np.ndarray, np.ndarray]) -> None:
    knots, values = made
    np.testing.assert_allclose(NaturalSpline.natural(knots, values)(knots), values, atol=1e-9)


@given(points())
def test_ends_are_told_with_slope_and_second_derivative(made: tuple[np.ndarray, np.ndarray]) -> None:
    knots, values = made
    spline, expected = NaturalSpline.natural(knots, values), natural(knots, values)
    for told, at in ((spline.start(), knots[0]), (spline.end(), knots[-1])):
        scale = 1.0 + abs(float(expected(at, 1)))
        np.testing.assert_allclose(told, [expected(at), expected(at, 1), 0.0], atol=1e-6 * scale)


def test_a_straight_line_stays_one_also_between_uneven_knots() -> None:
    knots = np.array([0.0, 0.1, 7.0, 7.5, 300.0])
    spline = NaturalSpline.natural(knots, 2.0 - 0.5 * knots)
    np.testing.assert_allclose(spline(np.linspace(0.0, 300.0, 50)), 2.0 - 0.5 * np.linspace(0.0, 300.0, 50), atol=1e-12)
    np.testing.assert_allclose(spline.bends, 0.0, atol=1e-14)


def test_among_all_curves_through_the_points_it_bends_least() -> None:
    """Holladay's theorem: the integral of the squared second derivative is smallest for the natural spline."""
    rng = np.random.default_rng(4)
    knots = np.cumsum(rng.uniform(5.0, 20.0, 8))
    values = rng.normal(size=8)
    at = np.linspace(knots[0], knots[-1], 40_001)

    def bending(curve: np.ndarray) -> float:
        return float(np.sum(np.diff(curve, 2) ** 2))

    own = bending(NaturalSpline.natural(knots, values)(at))
    clamped = CubicSpline(knots, values, bc_type="clamped")(at)
    assert own < bending(clamped)
    assert own < bending(CubicSpline(knots, values, bc_type="not-a-knot")(at))


@pytest.mark.parametrize(
    ("knots", "values"),
    [([0.0], [1.0]), ([0.0, 0.0], [1.0, 2.0]), ([1.0, 0.0], [1.0, 2.0]), ([0.0, 1.0], [1.0])],
    ids=["one point", "twice at one place", "backwards", "no value"],
)
def test_points_that_are_no_curve_are_refused(knots: list[float], values: list[float]) -> None:
    with pytest.raises(ValueError, match="two or more points at strictly increasing distances"):
        NaturalSpline.natural(np.array(knots), np.array(values))
