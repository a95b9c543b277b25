"""Two columns that act together."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.effects import made, quantity, strength
from xosc_lateral.drivers.model.effects import Factor, Form, Linear, Product

X = np.array([-30.0, -10.0, 0.0, 1.0, 10.0, 45.0])
DEFINED = {
    Form.VALUE: (4.0, X - 4.0),
    Form.SINE: (90.0, np.sin(2 * np.pi * X / 90.0)),
    Form.COSINE: (90.0, np.cos(2 * np.pi * X / 90.0)),
    Form.EQUALS: (1.0, X == 1.0),
    Form.NEARNESS: (10.0, [1 / 3, 1.0, 1.0, 1.0, 1.0, 10.0 / 45.0]),
    Form.PRESENCE: (0.0, np.ones(6)),
    Form.PROXIMITY: (10.0, np.exp(-np.abs(X) / 10.0)),
}
NEUTRAL = {Form.EQUALS: 0.0, Form.NEARNESS: 0.0, Form.PRESENCE: 0.0, Form.PROXIMITY: 0.0}
WORDS = {
    Form.VALUE: "(x - 4)",
    Form.SINE: "sin(x)",
    Form.COSINE: "cos(x)",
    Form.EQUALS: "[x = 1]",
    Form.NEARNESS: "nearness(x)",
    Form.PRESENCE: "presence(x)",
    Form.PROXIMITY: "proximity(x)",
}


@pytest.mark.parametrize("form", list(Form))
def test_a_factor_is_what_its_form_says(form: Form) -> None:
    at, expected = DEFINED[form]
    factor = Factor(column="x", form=form, at=at)
    np.testing.assert_allclose(factor.values({"x": X}), np.asarray(expected, dtype=float), atol=1e-15)
    assert str(factor) == WORDS[form]


@pytest.mark.parametrize("form", list(Form))
def test_where_there_is_none_a_neighbour_is_nothing_and_anything_else_is_not_known(form: Form) -> None:
    found = Factor(column="x", form=form, at=DEFINED[form][0]).values({"x": np.array([np.nan])})
    np.testing.assert_array_equal(found, [NEUTRAL.get(form, np.nan)])


def test_a_value_about_nothing_is_named_by_its_column() -> None:
    assert str(Factor(column="speed")) == "speed"


def test_the_order_of_the_factors_does_not_matter() -> None:
    rng = np.random.default_rng(1)
    context = {"speed": rng.uniform(20.0, 40.0, 50), "wind": rng.uniform(0.0, 360.0, 50)}
    speed, wind = Factor(column="speed", at=30.0), Factor(column="wind", form=Form.SINE, at=360.0)
    one, other = made(Product, 0.02, factors=(speed, wind)), made(Product, 0.02, factors=(wind, speed))
    np.testing.assert_array_equal(strength(one, **context), strength(other, **context))
    assert one.columns == ("speed", "wind")
    assert other.columns == ("wind", "speed")


def test_beside_a_switch_it_is_the_line_of_the_other_column() -> None:
    """[lane = 1] x: a slope in that lane and none elsewhere."""
    lane = np.array([0.0, 1.0, 2.0, 1.0])
    effect = made(Product, 0.1, factors=(Factor(column="lane", form=Form.EQUALS, at=1.0), Factor(column="x")))
    line = strength(made(Linear, 0.1, column="x"), x=[1.0, 2.0, 3.0, 4.0])
    np.testing.assert_allclose(strength(effect, lane=lane, x=[1.0, 2.0, 3.0, 4.0]), np.where(lane == 1.0, line, 0.0))


def test_either_factor_missing_leaves_the_movement_alone() -> None:
    effect = made(Product, 0.1, reference=(2.0,), factors=(Factor(column="x"), Factor(column="y")))
    np.testing.assert_array_equal(strength(effect, x=[np.nan, 3.0], y=[3.0, np.nan]), [0.0, 0.0])
    assert effect.strength(0.2, {"x": np.ones(2)}) is None


def test_the_quantity_is_one_column_and_the_shape_names_both() -> None:
    effect = made(Product, factors=(Factor(column="x", at=2.0), Factor(column="y", form=Form.PRESENCE)))
    assert quantity(effect, x=[1.0, 2.0], y=[5.0, 5.0]).shape == (2, 1)
    assert effect.shape == "product ((x - 2) x presence(y))"
