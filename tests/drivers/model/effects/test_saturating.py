"""In proportion near the middle, levelling off at both ends."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.effects import made, quantity, strength
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Acts, Linear, Saturating


def curve(size: float = 0.15, middle: float = 30.0, scale: float = 5.0) -> Saturating:
    return made(Saturating, size, column="x", middle=middle, scale=scale)


def test_near_the_middle_it_is_a_line_with_the_slope_of_one_over_the_scale() -> None:
    x = 30.0 + np.linspace(-0.1, 0.1, 11)
    line = made(Linear, 0.15 / 5.0, column="x", reference=(30.0,))
    np.testing.assert_allclose(strength(curve(), x=x), strength(line, x=x), atol=0.15 * 0.02**3)


def test_far_out_it_is_the_size_to_either_side() -> None:
    np.testing.assert_allclose(strength(curve(), x=[-1e3, 1e3, np.inf, -np.inf]), [-0.15, 0.15, 0.15, -0.15])


def test_it_turns_about_its_middle() -> None:
    away = np.linspace(0.0, 20.0, 21)
    np.testing.assert_allclose(strength(curve(), x=30.0 + away), -strength(curve(), x=30.0 - away), atol=1e-15)


def test_it_rises_all_the_way_within_one_and_minus_one() -> None:
    values = quantity(curve(), x=np.linspace(0.0, 60.0, 301))[:, 0]
    assert (np.diff(values) > 0.0).all()
    assert np.abs(values).max() < 1.0


def test_the_column_s_unit_does_not_matter() -> None:
    x = np.linspace(10.0, 50.0, 41)
    in_km_h = curve(middle=30.0 * 3.6, scale=5.0 * 3.6)
    np.testing.assert_allclose(strength(in_km_h, x=3.6 * x), strength(curve(), x=x), atol=1e-14)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan])
def test_a_scale_is_above_nothing(scale: float) -> None:
    with pytest.raises(DriverProfileError, match=r"effect saturating of x: scale .* must be above 0"):
        Saturating(acts=Acts.LOCATION, column="x", middle=0.0, scale=scale)


def test_where_there_is_none_nothing_changes_and_the_shape_says_where_it_bends() -> None:
    assert strength(curve(), x=[np.nan])[0] == 0.0
    assert curve().shape == "saturating (beyond 30 +- 5)"
