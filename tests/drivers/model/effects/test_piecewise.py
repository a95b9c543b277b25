"""A curve of straight pieces, against numpy's interpolation between its corners."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.effects import made, quantity, strength
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Acts, Linear, Piecewise

KNOTS = (10.0, 20.0, 35.0)
SLOPES = (0.01, -0.02, 0.005, 0.0)


def curve(knots: tuple[float, ...] = KNOTS, slopes: tuple[float, ...] = SLOPES) -> Piecewise:
    changes = np.diff(slopes, prepend=0.0)
    return made(Piecewise, *changes.tolist(), column="x", knots=knots)


def test_between_the_knots_it_is_numpys_interpolation() -> None:
    x = np.linspace(0.0, 60.0, 241)
    corners = np.array([0.0, *KNOTS, 60.0])
    heights = np.concatenate([[0.0], np.cumsum(np.diff(corners) * np.array(SLOPES))])
    np.testing.assert_allclose(strength(curve(), x=x), np.interp(x, corners, heights), atol=1e-14)


def test_it_has_no_jump_at_a_knot() -> None:
    for knot in KNOTS:
        below, above = strength(curve(), x=[knot - 1e-9, knot + 1e-9])
        assert below == pytest.approx(above, abs=1e-9)


def test_without_a_change_of_slope_it_is_a_line() -> None:
    x = np.linspace(-5.0, 50.0, 30)
    straight = made(Piecewise, 0.01, 0.0, column="x", knots=(20.0,))
    np.testing.assert_allclose(strength(straight, x=x), strength(made(Linear, 0.01, column="x"), x=x), atol=1e-16)


def test_where_there_is_none_no_component_is_a_number() -> None:
    assert np.isnan(quantity(curve(), x=[np.nan])).all()
    assert strength(curve(), x=[np.nan])[0] == 0.0


@pytest.mark.parametrize("knots", [(), (1.0, 1.0), (2.0, 1.0), (0.0, np.nan)], ids=str)
def test_knots_that_don_t_increase_are_refused(knots: tuple[float, ...]) -> None:
    with pytest.raises(DriverProfileError, match=r"effect piecewise of x: knots .* must increase"):
        Piecewise(acts=Acts.LOCATION, column="x", knots=knots)


def test_the_shape_names_the_bends() -> None:
    assert curve().shape == "curve (bends at 10, 20, 35)"
