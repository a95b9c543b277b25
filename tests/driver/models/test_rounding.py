"""Parameters keep nine digits each, whatever their size, and nothing else changes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.driver.models.made_models import POPULATION
from xosc_lateral.driver.models.autoregressive.rounding import DIGITS, _tidy, rounded
from xosc_lateral.driver.records import plain


@given(st.floats(allow_nan=False, allow_infinity=False, width=64))
def test_a_number_is_off_by_half_of_its_last_digit_at_most(value: float) -> None:
    assert _tidy(value) == pytest.approx(value, rel=0.5 * 10.0 ** (1 - DIGITS), abs=1e-300)
    assert _tidy(_tidy(value)) == _tidy(value)


@given(st.floats(1e-6, 1e6))
def test_what_a_processor_s_rounding_makes_of_it_is_gone(value: float) -> None:
    """Unless it lies right between two, and then by one digit alone."""
    beside = _tidy(value * (1.0 + 4e-16))
    assert beside == pytest.approx(_tidy(value), rel=10.0 ** (1 - DIGITS))


def test_a_rounded_model_is_the_same_to_nine_digits_and_rounding_it_again_changes_nothing() -> None:
    model = POPULATION
    once = rounded(model)
    assert plain(rounded(once)) == plain(once)
    assert once.step == model.step
    assert once.mean == pytest.approx(model.mean, rel=1e-8)
    np.testing.assert_allclose(once.coarse.coefficients, model.coarse.coefficients, rtol=1e-8)
    np.testing.assert_allclose(once.fine.damping, model.fine.damping, rtol=1e-8)
    assert once.limits == pytest.approx(model.limits, rel=1e-8)
    assert once.coarse_volatility.within == pytest.approx(model.coarse_volatility.within, rel=1e-8)
    assert once.fine_volatility.between == pytest.approx(model.fine_volatility.between, rel=1e-8)
