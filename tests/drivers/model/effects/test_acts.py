"""From a strength to terms: added to the place, or the exponential of it as a bounded factor."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.drivers.model.effects.base import FACTOR_LIMIT, LOG_LIMIT, Acts, terms_of

PARTS = ("location", "spread", "rate", "fine")
FACTORS = [Acts.SPREAD, Acts.RATE, Acts.FINE]


@pytest.mark.parametrize("acts", list(Acts))
def test_an_effect_acts_on_the_part_that_it_is_named_after_and_on_no_other(acts: Acts) -> None:
    terms = terms_of(acts, np.array([0.1, -0.2]))
    assert [part for part in PARTS if getattr(terms, part) is not None] == [acts.value]


def test_a_shift_is_the_strength_itself_however_large() -> None:
    strength = np.array([-30.0, 0.0, 0.15, 30.0])
    np.testing.assert_array_equal(terms_of(Acts.LOCATION, strength).location, strength)


@pytest.mark.parametrize("acts", FACTORS)
def test_factors_are_numpys_exponential_of_the_clipped_strength(acts: Acts) -> None:
    strength = np.random.default_rng(1).normal(scale=2.0, size=200)
    found = getattr(terms_of(acts, strength), acts.value)
    np.testing.assert_allclose(found, np.exp(np.clip(strength, -LOG_LIMIT, LOG_LIMIT)), rtol=1e-15)
    assert found.max() == pytest.approx(FACTOR_LIMIT)
    assert found.min() == pytest.approx(1.0 / FACTOR_LIMIT)


@pytest.mark.parametrize("acts", FACTORS)
def test_the_opposite_strength_is_the_inverse_factor(acts: Acts) -> None:
    strength = np.linspace(-3.0, 3.0, 41)
    one, other = (getattr(terms_of(acts, sign * strength), acts.value) for sign in (1.0, -1.0))
    np.testing.assert_allclose(one * other, 1.0, rtol=1e-12)


@pytest.mark.parametrize("acts", FACTORS)
def test_two_small_strengths_together_are_their_factors_multiplied(acts: Acts) -> None:
    first, second = np.array([0.1, -0.3, 0.7]), np.array([0.2, 0.4, -0.5])
    both = getattr(terms_of(acts, first + second), acts.value)
    apart = getattr(terms_of(acts, first), acts.value) * getattr(terms_of(acts, second), acts.value)
    np.testing.assert_allclose(both, apart, rtol=1e-12)
