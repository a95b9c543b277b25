"""Effects of context columns: each quantity against its definition, the response against its closed form."""

import json

import numpy as np
import pytest

from tests.kit.effects import EXAMPLES, OF_OTHER_COLUMNS, ONE
from tests.kit.profiles import effect_from_dict, whole_terms
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import (
    EFFECTS,
    Acts,
    Angular,
    ColumnEffect,
    Factor,
    Form,
    Levels,
    Linear,
    Magnitude,
    Nearness,
    Piecewise,
    Product,
    Proximity,
    Threshold,
)
from xosc_lateral.drivers.model.effects.response import respond

STEP = 0.2
TIME = STEP * np.arange(500)


def strength(effect: ColumnEffect, **context: np.ndarray) -> np.ndarray:
    found = effect.strength(STEP, context)
    assert found is not None
    return found


def test_a_step_is_responseed_like_a_first_order_lag_after_the_delay() -> None:
    jump = (TIME >= 20.0).astype(float)
    response = respond(jump, STEP, 3.0, 2.0)
    late = TIME - 23.0
    # the discrete lag responds within the sample in which the input moves: half a step ahead of the continuous one
    expected = np.where(late >= -1e-9, 1.0 - np.exp(-(late + STEP) / 2.0), 0.0)
    assert response == pytest.approx(expected, abs=1e-9)


def test_a_negative_lag_looks_ahead_and_holds_the_last_value() -> None:
    ramp = TIME.copy()
    response = respond(ramp, STEP, -1.0, 0.0)
    assert response[:-5] == pytest.approx(ramp[5:])
    assert response[-5:] == pytest.approx(np.full(5, ramp[-1]))


def test_the_response_starts_settled() -> None:
    assert respond(np.full(50, 7.0), STEP, 0.5, 4.0) == pytest.approx(np.full(50, 7.0))


def test_linear_acts_about_its_reference_and_is_neutral_where_there_is_none() -> None:
    effect = Linear(acts=Acts.LOCATION, column="x", coefficients=(2.0,), errors=(0.1,), reference=(3.0,))
    values = np.array([3.0, 4.0, np.nan])
    assert strength(effect, x=values) == pytest.approx([0.0, 2.0, 0.0])


def test_a_magnitude_is_the_same_to_either_side() -> None:
    effect = Magnitude(acts=Acts.LOCATION, column="x", coefficients=(2.0,), errors=(0.1,), reference=(1.0,))
    assert strength(effect, x=np.array([-3.0, 3.0, 0.0, np.nan])) == pytest.approx([4.0, 4.0, -2.0, 0.0])


@pytest.mark.parametrize(
    ("above", "jump", "expected"),
    [
        (True, True, [0.0, 0.0, 1.0, 0.0]),
        (False, True, [1.0, 0.0, 0.0, 0.0]),
        (True, False, [0.0, 0.0, 2.0, 0.0]),
        (False, False, [3.0, 0.0, 0.0, 0.0]),
    ],
)
def test_a_threshold_acts_on_one_side_only(above: bool, jump: bool, expected: list[float]) -> None:
    effect = Threshold(acts=Acts.LOCATION, column="x", at=5.0, above=above, jump=jump)
    assert effect.quantity({"x": np.array([2.0, 5.0, 7.0, np.nan])})[:, 0] == pytest.approx(expected)


def test_a_curve_bends_at_its_knots() -> None:
    effect = Piecewise(
        acts=Acts.LOCATION,
        column="x",
        knots=(1.0, 3.0),
        coefficients=(1.0, -1.0, 2.0),
        errors=(0.0, 0.0, 0.0),
        reference=(0.0, 0.0, 0.0),
    )
    assert strength(effect, x=np.array([0.0, 1.0, 2.0, 3.0, 4.0])) == pytest.approx([0.0, 1.0, 1.0, 1.0, 3.0])


def test_an_angle_has_no_seam() -> None:
    effect = Angular(acts=Acts.LOCATION, column="x", coefficients=(1.0, 1.0), errors=(0.0, 0.0), reference=(0.0, 0.0))
    low, high = strength(effect, x=np.array([0.01])), strength(effect, x=np.array([359.99]))
    assert low == pytest.approx(high, abs=1e-3)


def test_nearness_fades_with_distance_and_is_nothing_where_there_is_none() -> None:
    effect = Nearness(acts=Acts.LOCATION, column="x", scale=10.0)
    assert effect.quantity({"x": np.array([5.0, 10.0, 40.0, np.nan])})[:, 0] == pytest.approx([1.0, 1.0, 0.25, 0.0])
    there = Nearness(acts=Acts.LOCATION, column="x", presence=True)
    assert there.quantity({"x": np.array([5.0, np.nan])})[:, 0] == pytest.approx([1.0, 0.0])


def test_a_side_wind_is_the_product_of_speed_and_the_sine_of_its_direction() -> None:
    effect = Product(
        acts=Acts.LOCATION,
        factors=(Factor(column="speed"), Factor(column="direction", form=Form.SINE, at=360.0)),
        **ONE,
    )
    found = strength(effect, speed=np.array([10.0, 10.0, 10.0]), direction=np.array([90.0, 180.0, 270.0]))
    assert found == pytest.approx([5.0, 0.0, -5.0], abs=1e-9)


def test_levels_have_a_value_each_and_others_none() -> None:
    effect = Levels(
        acts=Acts.LOCATION,
        column="lane",
        levels=(1.0, 2.0),
        coefficients=(0.1, 0.3),
        errors=(0.0, 0.0),
        reference=(0.0, 0.0),
    )
    assert strength(effect, lane=np.array([0.0, 1.0, 2.0, 3.0])) == pytest.approx([0.0, 0.1, 0.3, 0.0])


@pytest.mark.parametrize("acts", [Acts.SPREAD, Acts.RATE, Acts.FINE])
def test_factors_multiply_and_stay_within_bounds(acts: Acts) -> None:
    effect = Linear(acts=acts, column="x", coefficients=(1.0,), errors=(0.0,), reference=(0.0,))
    context = {"x": np.array([0.0, np.log(2.0), 100.0, -100.0])}
    terms = whole_terms(effect, TIME[:4], context, np.random.default_rng(0))
    factor = {Acts.SPREAD: terms.spread, Acts.RATE: terms.rate, Acts.FINE: terms.fine}[acts]
    assert factor == pytest.approx([1.0, 2.0, 5.0, 0.2])
    assert terms.location is None


def test_a_missing_column_leaves_the_movement_alone() -> None:
    effect = Linear(acts=Acts.LOCATION, column="rain", **ONE)
    terms = whole_terms(effect, TIME, {"speed": TIME}, np.random.default_rng(0))
    assert (terms.location, terms.spread, terms.rate, terms.fine) == (None, None, None, None)


def test_every_known_effect_is_tried_here() -> None:
    assert {type(example) for example in (*EXAMPLES, *OF_OTHER_COLUMNS)} == set(EFFECTS)


@pytest.mark.parametrize("effect", EXAMPLES, ids=lambda effect: effect.kind)
def test_effects_survive_json(effect: ColumnEffect) -> None:
    again = effect_from_dict(json.loads(json.dumps(effect.to_dict(), allow_nan=False)))
    assert again == effect


@pytest.mark.parametrize("effect", EXAMPLES, ids=lambda effect: effect.kind)
def test_terms_are_finite_and_repeatable(effect: ColumnEffect) -> None:
    context = {"x": np.sin(TIME), "y": 10.0 * TIME}
    first, second = (whole_terms(effect, TIME, context, np.random.default_rng(3)) for _ in range(2))
    for name in ("location", "spread", "rate", "fine"):
        one, other = getattr(first, name), getattr(second, name)
        if one is None:
            assert other is None
        else:
            assert np.isfinite(one).all()
            assert np.array_equal(one, other)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"kind": "psychic"}, "psychic"),
        ({"kind": "linear", "acts": "location", "column": "x", "coefficients": [1.0]}, "as many"),
        ({"kind": "linear", "acts": "location", "column": "x", "sise": 1.0}, "sise"),
        ({"kind": "linear", "acts": "telepathy", "column": "x"}, "telepathy"),
        ({"kind": "saturating", "acts": "location", "column": "x", "middle": 0.0, "scale": 0.0}, "scale"),
        ({"kind": "piecewise", "acts": "location", "column": "x", "knots": [2.0, 1.0]}, "increase"),
        ({"kind": "drift", "size": -1.0}, "size"),
        ({"kind": "cycle", "amplitude": 0.1}, "period_s"),
        ({"kind": "product", "acts": "location", "factors": [{"column": "x", "form": "value", "at": 0}]}, "factors"),
    ],
)
def test_what_is_no_effect_is_refused_with_its_name(data: dict, message: str) -> None:
    with pytest.raises(DriverProfileError, match=message):
        effect_from_dict(data)


def test_a_neighbour_counts_in_full_alongside_less_afar_and_not_at_all_when_there_is_none() -> None:
    effect = Proximity(acts=Acts.LOCATION, column="x", scale=20.0, **ONE)
    felt = effect.quantity({"x": np.array([0.0, 20.0, -20.0, 400.0, np.nan])})[:, 0]
    assert felt == pytest.approx([1.0, np.exp(-1), np.exp(-1), 0.0, 0.0], abs=1e-8)


def test_a_proximity_without_a_scale_is_refused() -> None:
    with pytest.raises(DriverProfileError, match="must be above 0"):
        Proximity(acts=Acts.LOCATION, column="x", scale=0.0, **ONE)


@pytest.mark.parametrize("effect", [effect for effect in EXAMPLES if isinstance(effect, ColumnEffect)])
def test_nobody_in_sight_is_far_away_where_the_curve_levels_off_and_else_is_none(effect: ColumnEffect) -> None:
    """Infinity, against a kilometre and against NaN."""
    there = {"y": np.full(5, 90.0)}
    unseen, far, none = (strength(effect, x=np.full(5, value), **there) for value in (np.inf, 1000.0, np.nan))
    curves = {"saturating", "nearness", "proximity"}
    assert unseen == pytest.approx(far, abs=0.02) if effect.kind in curves else np.array_equal(unseen, none)
