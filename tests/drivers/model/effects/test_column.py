"""What effects of columns share: a reference, responses within those seen, one driver's own coefficients."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.effects import STEP, made, strength
from tests.kit.profiles import whole_terms
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Acts, Angular, ColumnEffect, Linear, Saturating, Threshold

WRONG: dict[str, tuple[dict, str]] = {
    "no number": ({"coefficients": (np.nan,)}, "not finite"),
    "endless error": ({"errors": (np.inf,)}, "not finite"),
    "endless lag": ({"lag_s": np.inf}, "not finite"),
    "responds before it is asked": ({"response_s": -0.1}, "below 0 s"),
    "no lag at all": ({"response_order": 0}, "response_order 0, expected 1 to 9"),
    "a delay of lags": ({"response_order": 10}, "response_order 10, expected 1 to 9"),
    "errors of something else": ({"errors": (0.1, 0.1)}, "as many coefficients"),
    "a reference too few": ({"reference": ()}, "as many coefficients"),
    "deviations of something else": ({"between_drivers": (0.1, 0.1)}, "between_drivers"),
    "negative deviation": ({"between_drivers": (-0.1,)}, "between_drivers"),
    "endless deviation": ({"between_drivers": (np.inf,)}, "between_drivers"),
    "ranges of something else": ({"response_range": ((0.0, 1.0), (0.0, 1.0))}, "answer_range"),
    "range upside down": ({"response_range": ((1.0, 0.0),)}, "answer_range"),
    "endless range": ({"response_range": ((0.0, np.inf),)}, "answer_range"),
}


@pytest.mark.parametrize("case", WRONG)
def test_numbers_that_say_nothing_are_refused_with_what_is_wrong(case: str) -> None:
    fields, message = WRONG[case]
    known = {"coefficients": (0.1,), "errors": (0.01,), "reference": (0.0,)}
    with pytest.raises(DriverProfileError, match=f"effect linear: .*{message}"):
        Linear(acts=Acts.LOCATION, column="x", **known | fields)


def test_whole_numbers_and_words_are_taken_as_what_they_mean() -> None:
    effect = Linear(acts="spread", column="x", coefficients=(1,), errors=(0,), reference=(2,))  # type: ignore[arg-type]
    assert effect.acts is Acts.SPREAD
    assert isinstance(effect.coefficients[0], float)


def test_strength_is_proportional_to_the_coefficient_and_mirrored_by_its_sign() -> None:
    x = np.random.default_rng(2).normal(size=300)
    one = strength(made(Linear, 0.1, column="x", lag_s=-0.7, response_s=1.5), x=x)
    np.testing.assert_allclose(
        strength(made(Linear, 0.25, column="x", lag_s=-0.7, response_s=1.5), x=x), 2.5 * one, rtol=0, atol=1e-15
    )
    np.testing.assert_array_equal(strength(made(Linear, -0.1, column="x", lag_s=-0.7, response_s=1.5), x=x), -one)
    np.testing.assert_array_equal(strength(made(Linear, 0.1, column="x", lag_s=-0.7, response_s=1.5), x=-x), -one)


def test_the_column_s_unit_does_not_matter_where_the_coefficient_is_per_unit() -> None:
    metres = np.random.default_rng(3).uniform(0.0, 60.0, 200)
    far = made(Linear, 0.002, column="x", reference=(25.0,), response_s=2.0)
    feet = made(Linear, 0.002 * 0.3048, column="x", reference=(25.0 / 0.3048,), response_s=2.0)
    np.testing.assert_allclose(strength(feet, x=metres / 0.3048), strength(far, x=metres), rtol=0, atol=1e-13)


def test_nothing_changes_at_the_reference() -> None:
    effect = made(Linear, 0.3, column="x", reference=(31.5,), lag_s=0.3, response_s=4.0)
    np.testing.assert_allclose(strength(effect, x=np.full(40, 31.5)), 0.0, atol=1e-14)


def test_responses_beyond_those_that_were_seen_count_as_the_outermost() -> None:
    effect = made(Linear, 0.1, column="x", response_range=((-1.0, 2.0),))
    np.testing.assert_allclose(strength(effect, x=[-9.0, -1.0, 0.5, 2.0, 9.0]), [-0.1, -0.1, 0.05, 0.2, 0.2])


def test_each_component_has_a_range_of_its_own() -> None:
    effect = made(Angular, 1.0, 10.0, column="x", response_range=((-0.5, 0.5), (-1.0, 0.2)))
    np.testing.assert_allclose(strength(effect, x=[90.0, 0.0, 270.0]), [0.5 + 10.0 * 0.0, 0.0 + 2.0, -0.5], atol=1e-12)


def test_the_range_bounds_the_response_and_not_the_column() -> None:
    """A spike of one sample is smoothed away by a slow driver: it is not cut off before."""
    spike = np.zeros(100)
    spike[50] = 10.0
    free = made(Linear, 0.1, column="x", response_s=10.0)
    bounded = made(Linear, 0.1, column="x", response_s=10.0, response_range=((0.0, 1.0),))
    assert strength(free, x=spike).max() < 0.1
    np.testing.assert_array_equal(strength(bounded, x=spike), strength(free, x=spike))


def test_where_there_is_none_stands_the_reference_or_before_a_fit_the_mean() -> None:
    values = {"x": np.array([1.0, np.nan, 3.0])}
    np.testing.assert_array_equal(made(Linear, 1.0, column="x", reference=(7.0,)).known(values)[:, 0], [1.0, 7.0, 3.0])
    np.testing.assert_array_equal(Linear(acts=Acts.LOCATION, column="x").known(values)[:, 0], [1.0, 2.0, 3.0])
    nowhere = {"x": np.full(4, np.nan)}
    np.testing.assert_array_equal(Linear(acts=Acts.LOCATION, column="x").known(nowhere)[:, 0], np.zeros(4))


def test_infinity_is_none_of_a_line_and_the_far_end_of_a_curve() -> None:
    endless = {"x": np.array([0.0, np.inf, -np.inf])}
    np.testing.assert_array_equal(made(Linear, 1.0, column="x", reference=(5.0,)).known(endless)[:, 0], [0.0, 5.0, 5.0])
    curve = made(Saturating, 1.0, column="x", middle=0.0, scale=2.0)
    np.testing.assert_array_equal(curve.known(endless)[:, 0], [0.0, 1.0, -1.0])


@pytest.mark.parametrize("jump", [True, False])
def test_a_threshold_levels_off_only_as_a_step(jump: bool) -> None:
    assert Threshold(acts=Acts.LOCATION, column="x", at=1.0, jump=jump).levels_off is jump


def test_one_row_weighs_what_it_weighs_among_many() -> None:
    effect = made(Angular, 0.3, -0.7, column="x")
    response = np.random.default_rng(4).normal(size=(50, 2))
    whole = effect.weighed(response)
    np.testing.assert_array_equal(np.concatenate([effect.weighed(row[None, :]) for row in response]), whole)


def test_without_coefficients_there_is_no_strength() -> None:
    np.testing.assert_array_equal(Linear(acts=Acts.LOCATION, column="x").weighed(np.ones((3, 0))), np.zeros(3))


def test_drivers_draw_their_own_coefficients_with_the_mean_and_the_spread_between_them() -> None:
    effect = made(Linear, 0.15, column="x", between_drivers=(0.05,))
    drawn = [effect.of_one_driver(np.random.default_rng(seed)) for seed in range(500)]
    slopes = np.array([one.coefficients[0] for one in drawn])
    assert slopes.mean() == pytest.approx(0.15, abs=4.0 * 0.05 / np.sqrt(500))
    assert slopes.std() == pytest.approx(0.05, rel=4.0 / np.sqrt(2.0 * 500))
    assert all(not one.between_drivers for one in drawn)


def test_drivers_who_are_alike_cost_no_random_number() -> None:
    rng, other = np.random.default_rng(5), np.random.default_rng(5)
    effect = made(Linear, 0.15, column="x", between_drivers=(0.0,))
    assert effect.of_one_driver(rng) is effect
    assert rng.random() == other.random()


def test_the_generator_is_left_as_it_is() -> None:
    rng, other = np.random.default_rng(6), np.random.default_rng(6)
    whole_terms(made(Linear, 0.1, column="x"), STEP * np.arange(5), {"x": np.ones(5)}, rng)
    assert rng.random() == other.random()


def test_fields_that_say_nothing_are_not_written() -> None:
    assert not {"between_drivers", "answer_range"} & set(made(Linear, 0.1, column="x").to_dict())
    full = made(Linear, 0.1, column="x", between_drivers=(0.05,), response_range=((0.0, 1.0),)).to_dict()
    assert full["between_drivers"] == [0.05]
    assert full["answer_range"] == [[0.0, 1.0]]


def test_effects_of_this_package_propose_nothing_by_themselves() -> None:
    assert tuple(Linear.proposals("x", np.ones(5))) == ()


def test_what_a_new_effect_must_say_is_asked_for() -> None:
    class Bare(ColumnEffect, frozen=True, kw_only=True):
        column: str

    with pytest.raises(NotImplementedError):
        Bare(acts=Acts.LOCATION, column="x").strength(STEP, {"x": np.ones(3)})
