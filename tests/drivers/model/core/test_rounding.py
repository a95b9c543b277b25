"""Parameters keep five digits, and coefficients as many as their spectrum asks for; nothing else changes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.core_models import POPULATION
from xosc_lateral.base.arrays import significant
from xosc_lateral.drivers.fitting.models.autoregressive_fit import DIGITS, rounded
from xosc_lateral.drivers.model.core.autoregressive.parameters import Autoregression
from xosc_lateral.drivers.model.records import plain


def kept(value: float) -> float:
    return significant(value, DIGITS)


@given(st.floats(-1.7976e308, 1.7976e308))
def test_a_number_is_off_by_half_of_its_last_digit_at_most(value: float) -> None:
    assert kept(value) == pytest.approx(value, rel=0.5 * 10.0 ** (1 - DIGITS), abs=1e-300)
    assert kept(kept(value)) == kept(value)


@given(st.floats(1e-6, 1e6))
def test_what_a_processor_s_rounding_makes_of_it_is_gone(value: float) -> None:
    """Unless it lies right between two, and then by one digit alone."""
    beside = kept(value * (1.0 + 4e-16))
    assert beside == pytest.approx(kept(value), rel=10.0 ** (1 - DIGITS))


def test_a_rounded_model_is_the_same_to_its_digits_and_rounding_it_again_changes_nothing() -> None:
    model = POPULATION
    once = rounded(model)
    assert plain(rounded(once)) == plain(once)
    assert once.step == model.step
    assert once.mean == pytest.approx(model.mean, rel=1e-4)
    np.testing.assert_allclose(once.fine.damping, model.fine.damping, rtol=1e-4)
    assert once.limits == pytest.approx(model.limits, rel=1e-4)
    assert once.coarse_volatility.within == pytest.approx(model.coarse_volatility.within, rel=1e-4)
    assert once.fine_volatility.between == pytest.approx(model.fine_volatility.between, rel=1e-4)


@pytest.mark.parametrize("largest", [0.9, 0.99, 0.995])
def test_coefficients_keep_the_spectrum_however_near_they_add_up_to_one(largest: float) -> None:
    """With a memory of 200 s five digits would change the slowest movement by several percent."""
    others = [0.8 * np.exp(1j * angle) for angle in (0.5, -0.5, 1.5, -1.5, 2.5, -2.5)]
    coefficients = -np.real(np.poly([largest, 0.97 * largest, *others]))[1:]
    model = replace(POPULATION, coarse=Autoregression(coefficients, 0.0123456789))
    frequency = np.linspace(0.0, 0.5, 5001)
    kept = rounded(model).coarse
    np.testing.assert_allclose(kept.power(frequency), model.coarse.power(frequency), rtol=3e-3)
    assert max(len(f"{abs(one):e}".split("e")[0].rstrip("0")) for one in kept.coefficients) <= 9


def test_another_processor_s_coefficients_are_mostly_the_same() -> None:
    """Its linear algebra differs by 1e-10 and more: nine digits of each would hardly ever agree."""
    rng = np.random.default_rng(7)
    model, alike = POPULATION, 0
    for _ in range(50):
        moved = model.coarse.coefficients * (1.0 + 2e-10 * rng.normal(size=model.coarse.order))
        elsewhere = replace(model, coarse=Autoregression(moved, model.coarse.scale))
        alike += plain(rounded(elsewhere)) == plain(rounded(model))
    assert alike >= 48
