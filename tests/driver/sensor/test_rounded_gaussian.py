"""A rounded normal variable: closed forms of others as the oracle."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.driver.sensor.rounded_gaussian import RoundedGaussian, gaussian_behind


def test_of_one_threshold_in_the_middle_the_covariance_is_sheppard_s_arcsine() -> None:
    """Two values, as often each: covariance g^2 arcsin(r) / 2 pi (Sheppard 1899)."""
    coin = RoundedGaussian(mean=10.0, deviation=1.0, step=20.0)
    correlation = np.array([-0.9, -0.3, 0.0, 0.2, 0.7, 0.95, 0.999])
    expected = 20.0**2 * np.arcsin(correlation) / (2.0 * np.pi)
    assert coin.covariance(correlation) == pytest.approx(expected, rel=2e-3, abs=1e-6)
    assert coin.moments == pytest.approx((10.0, 100.0))


@pytest.mark.parametrize(("mean", "step"), [(0.0, 2.0), (0.13, 1.0), (0.4, 3.5), (-0.2, 0.7)])
def test_at_full_correlation_it_is_the_variance(mean: float, step: float) -> None:
    one = RoundedGaussian(mean, 0.8, step)
    assert one.covariance(np.ones(1))[0] == pytest.approx(one.moments[1], rel=1e-4)
    assert one.correlation(float(one.covariance(np.array([0.6]))[0])) == pytest.approx(0.6, abs=1e-3)


def test_fine_steps_add_a_twelfth_of_their_square_and_no_covariance() -> None:
    """Sheppard's corrections."""
    one = RoundedGaussian(0.02, 1.0, 0.3)
    assert one.moments == pytest.approx((0.02, 1.0 + 0.3**2 / 12.0), rel=1e-6)
    assert one.error == pytest.approx(0.3**2 / 12.0, rel=1e-6)
    assert one.covariance(np.array([0.4, 0.8])) == pytest.approx([0.4, 0.8], rel=1e-3)
    assert one.variance_per_kurtosis == pytest.approx(0.0, abs=1e-6)


def test_moments_and_error_are_those_of_rounded_numbers() -> None:
    one = RoundedGaussian(0.3, 0.5, 0.9)
    quantile = (np.arange(200_000) + 0.5) / 200_000
    from scipy.special import ndtri

    values = 0.3 + 0.5 * ndtri(quantile)
    rounded = 0.9 * np.round(values / 0.9)
    assert one.moments == pytest.approx((rounded.mean(), rounded.var()), rel=1e-3)
    assert one.error == pytest.approx(np.mean((rounded - values) ** 2), rel=1e-3)
    both = np.mean((rounded - rounded.mean()) * (values - 0.3)) / 0.5
    assert one.covariance_with_cause == pytest.approx(both, rel=1e-3)
    found = gaussian_behind(rounded, 0.9)
    assert (found.mean, found.deviation) == pytest.approx((0.3, 0.5), rel=2e-3)


@pytest.mark.parametrize("step", [1.4, 2.0, 4.0])
def test_a_heavier_tail_moves_the_variance_by_what_edgeworth_s_series_says(step: float) -> None:
    """Half the time a little calmer, half a little livelier: excess kurtosis 3 d^2, variance 1."""
    d = 0.1
    parts = [RoundedGaussian(0.1, float(np.sqrt(v)), step).moments for v in (1.0 - d, 1.0 + d)]
    mean = np.mean([m for m, _ in parts])
    variance = np.mean([v + m**2 for m, v in parts]) - mean**2
    normal = RoundedGaussian(0.1, 1.0, step)
    slope = (RoundedGaussian(0.1, np.sqrt(1.001), step).moments[1] - normal.moments[1]) / 0.001
    told_too_much = (variance - normal.moments[1]) / slope
    assert -normal.variance_per_kurtosis * 3.0 * d**2 == pytest.approx(told_too_much, rel=0.1)
