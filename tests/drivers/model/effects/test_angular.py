"""An angle as sine and cosine."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.effects import made, quantity, strength
from xosc_lateral.drivers.model.effects import Angular


def test_two_coefficients_are_a_size_and_a_direction() -> None:
    """a sin x + b cos x = r cos(x - d), by the addition theorem."""
    angle = np.linspace(0.0, 360.0, 73)
    size, direction = 0.15, np.radians(40.0)
    effect = made(Angular, size * np.sin(direction), size * np.cos(direction), column="x")
    np.testing.assert_allclose(strength(effect, x=angle), size * np.cos(np.radians(angle) - direction), atol=1e-15)


@pytest.mark.parametrize("turns", [-2, -1, 1, 5])
def test_whole_turns_change_nothing(turns: int) -> None:
    angle = np.array([0.0, 33.0, 180.0, 359.0])
    effect = made(Angular, 0.1, 0.2, column="x")
    np.testing.assert_allclose(strength(effect, x=angle + 360.0 * turns), strength(effect, x=angle), atol=1e-12)


def test_degrees_and_radians_say_the_same() -> None:
    angle = np.linspace(-200.0, 200.0, 21)
    in_degrees, in_radians = made(Angular, 0.1, 0.2, column="x"), made(Angular, 0.1, 0.2, column="x", period=2 * np.pi)
    np.testing.assert_allclose(strength(in_radians, x=np.radians(angle)), strength(in_degrees, x=angle), atol=1e-14)


def test_the_mirrored_angle_mirrors_the_sine_and_keeps_the_cosine() -> None:
    angle = np.linspace(0.0, 170.0, 18)
    there, mirrored = (
        quantity(made(Angular, 1.0, 1.0, column="x"), x=angle),
        quantity(made(Angular, 1.0, 1.0, column="x"), x=-angle),
    )
    np.testing.assert_allclose(mirrored, there * [-1.0, 1.0], atol=1e-15)


def test_where_there_is_no_direction_nothing_changes() -> None:
    effect = made(Angular, 0.3, 0.4, column="x", reference=(0.2, -0.1))
    assert strength(effect, x=[np.nan])[0] == pytest.approx(0.0, abs=1e-15)


def test_it_names_its_column_and_its_shape() -> None:
    effect = made(Angular, 0.1, 0.1, column="wind_direction")
    assert (effect.columns, effect.shape, effect.levels_off) == (("wind_direction",), "angular", False)
