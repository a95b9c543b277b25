"""In proportion to a column."""

from __future__ import annotations

import numpy as np

from tests.kit.effects import made, quantity, strength
from xosc_lateral.drivers.model.effects import Acts, Linear


def test_sums_of_columns_have_sums_of_strengths() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.normal(size=(2, 400))
    effect = made(Linear, 0.15, column="x", lag_s=-1.1, response_s=2.5)
    np.testing.assert_allclose(
        strength(effect, x=one + other), strength(effect, x=one) + strength(effect, x=other), atol=1e-15
    )


def test_the_quantity_is_the_column_as_it_is() -> None:
    values = np.array([1.0, np.nan, -3.5])
    np.testing.assert_array_equal(quantity(made(Linear, column="x"), x=values)[:, 0], values)


def test_whole_numbers_are_a_column_too() -> None:
    found = made(Linear, 0.5, column="x").strength(0.2, {"x": np.array([0, 1, 2])})  # type: ignore[dict-item]
    np.testing.assert_array_equal(np.asarray(found), [0.0, 0.5, 1.0])


def test_it_names_its_column_and_its_shape() -> None:
    effect = made(Linear, column="rain", acts=Acts.SPREAD)
    assert (effect.columns, effect.shape) == (("rain",), "linear")
