"""Autoregressions."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.fitting.models.likelihood import fit_autoregression
from xosc_lateral.drivers.model.core.autoregressive.parameters import Autoregression, stabilise
from xosc_lateral.drivers.model.linear_filters import recur

SECOND_ORDER = np.array([1.6, -0.8])


def series(coefficients: np.ndarray, noise: np.ndarray) -> np.ndarray:
    values = np.zeros(len(noise) + len(coefficients))
    for t, shock in enumerate(noise):
        values[t + len(coefficients)] = shock + coefficients @ values[t : t + len(coefficients)][::-1]
    return values[len(coefficients) :]


def test_first_order_has_its_closed_forms() -> None:
    model = Autoregression(np.array([0.9]), 0.3)
    lags = np.arange(10)
    assert np.allclose(model.covariance(10), 0.09 / (1 - 0.81) * 0.9**lags)
    frequency = np.array([0.0, 0.1, 0.5])
    assert np.allclose(model.power(frequency), 0.09 / (1 + 0.81 - 1.8 * np.cos(2 * np.pi * frequency)))


def test_second_order_meets_the_yule_walker_equations() -> None:
    covariance = Autoregression(SECOND_ORDER, 1.0).covariance(6)
    for lag in range(2, 6):
        assert covariance[lag] == pytest.approx(1.6 * covariance[lag - 1] - 0.8 * covariance[lag - 2])


@pytest.mark.parametrize("seed", range(5))
def test_fit_recovers_coefficients_although_the_driver_is_lively_at_times(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mood = np.exp(0.8 * np.repeat(rng.normal(size=100), 50))
    values = series(SECOND_ORDER, mood * rng.normal(size=5000))
    found, _ = fit_autoregression([values[:2000], values[2000:]], 2, every=1, drivers=["a", "a"])
    # Standard error of each coefficient: sqrt((1 - 0.8^2) / n) = 0.0085; lively moments count exp(4 * 0.8^2) times as
    # much, and as much fewer are the moments that decide: for normal moods, sum(m^2)^2 / sum(m^4) = exp(-4 0.8^2) n.
    assert np.abs(found.coefficients - SECOND_ORDER).max() < 3 * 0.0085 * np.exp(2 * 0.8**2)


def test_a_driver_who_corrects_only_what_is_too_far_off_keeps_his_spread() -> None:
    """Drifts at random within a tolerance, then comes back briskly: the stationary variance is the series' own."""
    rng = np.random.default_rng(0)
    values = np.zeros(20_000)
    for t in range(1, len(values)):
        far = abs(values[t - 1]) > 1.0
        values[t] = values[t - 1] * (1.0 - 0.8 * far) + (0.3 if far else 0.1) * rng.normal()
    found, _ = fit_autoregression([values], 4, every=1, drivers=["a"])
    assert np.sqrt(found.covariance(1)[0]) == pytest.approx(values.std(), rel=0.05)


def test_each_driver_counts_by_his_own_size() -> None:
    """Four calm drivers of one memory and a wild one of another: the wild one is no more than one of five."""
    rng = np.random.default_rng(0)
    calm = [series(np.array([0.5]), rng.normal(size=2000)) for _ in range(4)]
    wild = 30.0 * series(np.array([0.9]), rng.normal(size=2000))
    found, _ = fit_autoregression([*calm, wild], 1, every=1, drivers=["a", "b", "c", "d", "e"])
    alone, _ = fit_autoregression([*calm, wild], 1, every=1, drivers=["a"] * 5)
    assert 0.5 < found.coefficients[0] < 0.75
    assert alone.coefficients[0] == pytest.approx(0.9, abs=0.03)


def test_a_step_may_be_several_samples() -> None:
    rng = np.random.default_rng(0)
    slow = series(np.array([0.8]), rng.normal(size=4000))
    found, _ = fit_autoregression([np.repeat(slow, 5)[2:]], 1, every=5, drivers=["a"])
    assert found.coefficients[0] == pytest.approx(0.8, abs=0.05)


def test_roots_beyond_are_pulled_in_and_others_left() -> None:
    assert np.array_equal(stabilise(SECOND_ORDER), SECOND_ORDER)
    pulled = stabilise(np.array([2.02, -1.02]))  # roots 1.02 and 1.0
    assert np.sort(np.abs(np.roots([1.0, *-pulled]))) == pytest.approx([0.995, 0.995], abs=1e-6)
    with pytest.raises(DriverProfileError, match=r"modulus 1\.0200"):
        Autoregression(np.array([2.02, -1.02]), 1.0)


def test_running_on_is_the_recursion() -> None:
    noise = np.random.default_rng(1).normal(size=40)
    expected = series(SECOND_ORDER, noise)
    first = recur(np.zeros(2), noise[:15], SECOND_ORDER)
    second = recur(first[-2:], noise[15:], SECOND_ORDER)
    assert np.allclose(np.concatenate([first[2:], second[2:]]), expected)
