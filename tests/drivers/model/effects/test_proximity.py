"""A neighbour's influence that is gone with distance."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.effects import made, quantity
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Acts, Proximity


def felt(distance: object, scale: float = 20.0) -> np.ndarray:
    return quantity(made(Proximity, column="x", scale=scale), x=distance)[:, 0]


def test_each_further_scale_leaves_37_percent() -> None:
    np.testing.assert_allclose(felt([0.0, 20.0, 40.0, 60.0]), np.exp([0.0, -1.0, -2.0, -3.0]))


def test_ahead_and_behind_are_alike() -> None:
    distance = np.linspace(0.5, 90.0, 50)
    np.testing.assert_array_equal(felt(distance), felt(-distance))


def test_125_metres_away_nobody_moves_a_car_by_a_centimetre() -> None:
    """What a line of the distance did. An effect of 0.2 m alongside that fades over 20 m."""
    assert 0.2 * felt([125.0])[0] < 0.001


def test_nobody_is_nothing_and_infinitely_far_is_nothing() -> None:
    np.testing.assert_array_equal(felt([np.nan, np.inf, -np.inf]), [0.0, 0.0, 0.0])


@pytest.mark.parametrize("scale", [0.0, -5.0, np.nan])
def test_a_scale_is_above_nothing(scale: float) -> None:
    with pytest.raises(DriverProfileError, match=r"effect proximity of x: scale .* must be above 0"):
        Proximity(acts=Acts.LOCATION, column="x", scale=scale)


def test_it_levels_off_and_says_over_what() -> None:
    effect = made(Proximity, column="right_distance", scale=16.42)
    assert effect.shape == "proximity (fades over 16.4)"
    assert effect.columns == ("right_distance",)
