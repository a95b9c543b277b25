"""In proportion to a column's size."""

from __future__ import annotations

import numpy as np

from tests.kit.effects import made, quantity, strength
from xosc_lateral.drivers.model.effects import Linear, Magnitude


def test_a_left_hand_mirror_changes_nothing() -> None:
    curvature = np.random.default_rng(1).normal(size=300)
    effect = made(Magnitude, 0.12, column="curvature", lag_s=-1.0, response_s=1.0)
    np.testing.assert_array_equal(strength(effect, curvature=curvature), strength(effect, curvature=-curvature))


def test_to_one_side_it_is_the_line() -> None:
    x = np.random.default_rng(2).uniform(0.0, 5.0, 100)
    np.testing.assert_array_equal(
        strength(made(Magnitude, 0.1, column="x"), x=x), strength(made(Linear, 0.1, column="x"), x=x)
    )


def test_it_is_never_below_nothing_and_none_stays_none() -> None:
    found = quantity(made(Magnitude, column="x"), x=[-2.0, 0.0, np.nan])[:, 0]
    np.testing.assert_array_equal(found, [2.0, 0.0, np.nan])
