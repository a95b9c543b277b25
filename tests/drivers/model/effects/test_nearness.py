"""A neighbour's influence by 1 / distance."""

from __future__ import annotations

import numpy as np

from tests.kit.effects import made, quantity
from xosc_lateral.drivers.model.effects import Nearness


def near(distance: object, scale: float = 10.0, presence: bool = False) -> np.ndarray:
    return quantity(made(Nearness, column="x", scale=scale, presence=presence), x=distance)[:, 0]


def test_twice_as_far_is_half_the_influence_beyond_the_scale_and_full_within() -> None:
    np.testing.assert_allclose(near([0.0, 3.0, 10.0, 20.0, 40.0, 80.0]), [1.0, 1.0, 1.0, 0.5, 0.25, 0.125])


def test_ahead_and_behind_are_alike() -> None:
    distance = np.linspace(0.5, 90.0, 50)
    np.testing.assert_array_equal(near(distance), near(-distance))


def test_nearer_is_never_less() -> None:
    assert (np.diff(near(np.linspace(0.0, 200.0, 400))) <= 0.0).all()


def test_distance_and_scale_in_one_unit_give_the_same_in_another() -> None:
    distance = np.linspace(0.0, 100.0, 41)
    np.testing.assert_allclose(near(distance / 0.3048, 10.0 / 0.3048), near(distance), rtol=1e-14)


def test_nobody_is_nothing_and_infinitely_far_is_nothing() -> None:
    np.testing.assert_array_equal(near([np.nan, np.inf]), [0.0, 0.0])


def test_presence_asks_whether_and_not_where() -> None:
    np.testing.assert_array_equal(near([0.0, 500.0, -500.0, np.nan, np.inf], presence=True), [1.0, 1.0, 1.0, 0.0, 0.0])


def test_shapes_are_told_apart_in_words() -> None:
    assert made(Nearness, column="x", scale=10.0).shape == "nearness (1 / distance)"
    assert made(Nearness, column="x", presence=True).shape == "presence"
