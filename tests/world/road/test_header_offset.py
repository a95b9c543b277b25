"""Where a road network lies: moved first, then turned about the inertial origin."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from xosc_lateral.world.road.piecewise import HeaderOffset

far = st.floats(-1e6, 1e6)
turn = st.floats(-10.0, 10.0)
offsets = st.builds(HeaderOffset, far, far, far, turn)


def applied(offset: HeaderOffset, x: float, y: float, z: float = 0.0, heading: float = 0.0) -> list[float]:
    return [float(part[0]) for part in offset.apply(*(np.array([value]) for value in (x, y, z, heading)))]


@given(offsets, far, far)
def test_a_rotation_matrix_turns_the_moved_point(offset: HeaderOffset, x: float, y: float) -> None:
    expected = complex(x + offset.x, y + offset.y) * complex(math.cos(offset.heading), math.sin(offset.heading))
    found = applied(offset, x, y)
    assert found[0] == pytest.approx(expected.real, abs=1e-8)
    assert found[1] == pytest.approx(expected.imag, abs=1e-8)


@given(offsets, far, far)
def test_what_is_undone_is_where_it_was(offset: HeaderOffset, x: float, y: float) -> None:
    assert offset.undo(*applied(offset, x, y)[:2]) == pytest.approx((x, y), abs=1e-7)


@given(offsets, far, far)
def test_directions_are_turned_alone(offset: HeaderOffset, x: float, y: float) -> None:
    """The way between two places, seen in the file's axes, whatever the network was moved by."""
    here, there = applied(offset, 1.0, 2.0), applied(offset, 1.0 + x, 2.0 + y)
    way = offset.turned_back(there[0] - here[0], there[1] - here[1])
    assert way == pytest.approx((x, y), abs=1e-7)


@given(offsets, turn)
def test_headings_lie_in_one_circle(offset: HeaderOffset, heading: float) -> None:
    found = applied(offset, 0.0, 0.0, heading=heading)[3]
    assert 0.0 <= found <= 2.0 * math.pi  # the full circle itself by rounding alone
    assert math.cos(found) == pytest.approx(math.cos(heading + offset.heading), abs=1e-9)
    assert math.sin(found) == pytest.approx(math.sin(heading + offset.heading), abs=1e-9)


def test_a_quarter_turn_by_hand() -> None:
    found = applied(HeaderOffset(10.0, 0.0, 5.0, math.pi / 2.0), 1.0, 2.0, 3.0, 0.1)
    assert found == pytest.approx([-2.0, 11.0, 8.0, math.pi / 2.0 + 0.1])


@pytest.mark.parametrize("moved", [HeaderOffset(x=1e-9), HeaderOffset(z=1.0), HeaderOffset(heading=0.1)])
def test_whether_it_moves_anything(moved: HeaderOffset) -> None:
    assert moved
    assert not HeaderOffset()
