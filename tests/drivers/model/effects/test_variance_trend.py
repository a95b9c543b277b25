"""Spread that grows with time on the road."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.profiles import whole_terms
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import VarianceTrend

RNG = np.random.default_rng(0)


def test_equal_times_multiply_by_equal_factors() -> None:
    terms = whole_terms(
        VarianceTrend(factor=1.6, fine_factor=0.8, from_s=0.0, to_s=1000.0), np.arange(0.0, 1001.0, 100.0), {}, RNG
    )
    assert terms.spread is not None
    assert terms.fine is not None
    np.testing.assert_allclose(terms.spread[1:] / terms.spread[:-1], 1.6**0.1)
    np.testing.assert_allclose(terms.fine[1:] / terms.fine[:-1], 0.8**0.1)
    assert terms.spread[-1] / terms.spread[0] == pytest.approx(1.6)


def test_the_geometric_mean_over_the_fitted_time_is_one() -> None:
    spread = whole_terms(
        VarianceTrend(factor=3.0, from_s=50.0, to_s=650.0), np.linspace(50.0, 650.0, 301), {}, RNG
    ).spread
    assert np.log(spread).mean() == pytest.approx(0.0, abs=1e-12)  # type: ignore[arg-type]


def test_the_inverse_factor_is_the_same_drive_backwards() -> None:
    time = np.linspace(0.0, 600.0, 61)
    up, down = (whole_terms(VarianceTrend(factor=f, to_s=600.0), time, {}, RNG).spread for f in (2.0, 0.5))
    np.testing.assert_allclose(down, np.asarray(up)[::-1])


def test_a_fitted_time_of_nothing_is_a_jump_and_no_division_by_it() -> None:
    spread = whole_terms(VarianceTrend(factor=4.0, from_s=10.0, to_s=10.0), np.array([0.0, 10.0, 20.0]), {}, RNG).spread
    np.testing.assert_allclose(np.asarray(spread), [0.5, 0.5, 2.0])


def test_nothing_is_added_and_nothing_made_faster() -> None:
    terms = whole_terms(VarianceTrend(factor=2.0), np.arange(3.0), {}, RNG)
    assert terms.location is None
    assert terms.rate is None


@pytest.mark.parametrize("field", ["factor", "fine_factor"])
def test_factors_are_above_nothing(field: str) -> None:
    with pytest.raises(DriverProfileError, match=f"variance-trend: {field} = 0"):
        VarianceTrend(**{"factor": 2.0} | {field: 0.0})
