"""Cubics along s and heights of kerbs, each against the plain way to write it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from xosc_lateral.world.road.lanes import Lane
from xosc_lateral.world.road.piecewise import PiecewiseCubic
from xosc_lateral.world.road.tables import Cubics, HeightTable

small = st.floats(-0.01, 0.01)


@st.composite
def functions(draw: st.DrawFn) -> list[tuple[list[float], list[tuple[float, ...]]]]:
    """Starts and cubics of one to four roads."""
    made = []
    for _ in range(draw(st.integers(1, 4))):
        starts = [0.0, *np.cumsum(draw(st.lists(st.floats(1.0, 50.0), max_size=4))).tolist()]
        made.append((starts, [tuple(draw(st.tuples(small, small, small, small))) for _ in starts]))
    return made


def value(starts: list[float], cubics: list[tuple[float, ...]], s: float) -> tuple[float, float]:
    k = max([0, *[k for k, start in enumerate(starts) if start <= s]])
    polynomial = np.polynomial.Polynomial(cubics[k])
    return float(polynomial(s - starts[k])), float(polynomial.deriv()(s - starts[k]))


@given(functions(), st.data())
def test_values_and_slopes_are_those_of_the_piece_that_holds_there(made: list, data: st.DataObject) -> None:
    table = Cubics([PiecewiseCubic(tuple(starts), tuple(cubics)) for starts, cubics in made])
    owner = np.array(data.draw(st.lists(st.integers(0, len(made) - 1), min_size=1, max_size=20)), dtype=np.int32)
    s = np.array(data.draw(st.lists(st.floats(0.0, 200.0), min_size=len(owner), max_size=len(owner))))
    values, slopes = table.at(owner, s)
    expected = np.array([value(*made[k], at) for k, at in zip(owner, s, strict=True)])
    np.testing.assert_allclose(values, expected[:, 0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(slopes, expected[:, 1], rtol=1e-9, atol=1e-12)


def test_a_level_road_says_so() -> None:
    level = PiecewiseCubic((0.0,), ((0.0, 0.0, 0.0, 0.0),))
    assert Cubics([level, level]).is_zero
    assert not Cubics([level, PiecewiseCubic((0.0,), ((0.0, 0.0, 1e-9, 0.0),))]).is_zero


# ---- kerbs -----------------------------------------------------------------------------------------------------------
def lane(number: int, *heights: tuple[float, float, float]) -> Lane:
    zero = (0.0, 0.0, 0.0, 0.0)
    width = (3.0, *zero[1:])
    return Lane(number, "driving", heights=heights, direction=1, starts=(0.0,), centre=(zero,), width=(width,))


def height(of: Lane, s: float, from_centre: float, width: float = 3.0) -> float:
    table = HeightTable([lane(9), of])  # another owner before it
    found = table.at(np.array([1], dtype=np.int32), *map(np.array, ([s], [from_centre], [width])), np.array([of.id]))
    return float(found[0])


@pytest.mark.parametrize("number", [-2, 2], ids=["right", "left"])
def test_the_outer_edge_is_the_one_away_from_the_reference_line_on_either_side(number: int) -> None:
    kerb = lane(number, (0.0, 0.1, 0.3))
    outwards = float(np.sign(number))
    assert height(kerb, 5.0, -1.5 * outwards) == pytest.approx(0.1)
    assert height(kerb, 5.0, 0.0) == pytest.approx(0.2)
    assert height(kerb, 5.0, 1.5 * outwards) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("s", "expected"), [(0.0, 0.0), (5.0, 0.05), (10.0, 0.1), (15.0, 0.2), (20.0, 0.3), (99.0, 0.3)]
)
def test_heights_are_linear_between_records_and_stay_after_the_last(s: float, expected: float) -> None:
    ramp = lane(-1, (0.0, 0.0, 0.0), (10.0, 0.1, 0.1), (20.0, 0.3, 0.3))
    assert height(ramp, s, 0.4) == pytest.approx(expected)


def test_beside_a_lane_its_edge_s_height_goes_on() -> None:
    kerb = lane(-1, (0.0, 0.1, 0.3))
    assert height(kerb, 0.0, 50.0) == pytest.approx(0.1)
    assert height(kerb, 0.0, -50.0) == pytest.approx(0.3)


def test_a_lane_without_a_width_has_its_inner_edge_alone() -> None:
    assert height(lane(-1, (0.0, 0.1, 0.3)), 0.0, 0.0, width=0.0) == pytest.approx(0.1)


def test_a_lane_without_records_lies_on_the_road() -> None:
    assert height(lane(-1), 12.0, 0.7) == 0.0
    assert not HeightTable([lane(-1), lane(1)]).any
    assert HeightTable([lane(-1), lane(1, (0.0, 0.0, 0.0))]).any


def test_before_the_first_record_it_holds_already() -> None:
    assert height(lane(-1, (30.0, 0.2, 0.2), (40.0, 0.4, 0.4)), 10.0, 0.0) == pytest.approx(0.2)
