"""Volatility: log-normal factors that wander."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.fitting.models.autoregressive_fit import autocovariance, fit_volatility, log_power
from xosc_lateral.drivers.model.core.autoregressive.parameters import Volatility, averaged_covariance


def wander(n: int, memory: float, rng: np.random.Generator) -> np.ndarray:
    keep, values, x = np.exp(-1 / memory), np.empty(n), rng.normal()
    for i, shock in enumerate(rng.normal(size=n)):
        values[i] = x
        x = keep * x + np.sqrt(1 - keep**2) * shock
    return values


def test_covariance_of_window_means_is_that_of_an_averaged_wander() -> None:
    fine = wander(2_000_000, 60.0, np.random.default_rng(0))  # memory 6 s at 10 Hz
    means = fine.reshape(-1, 20).mean(axis=1)  # windows of 2 s
    found, _ = autocovariance([means], 5)
    assert np.allclose(found, averaged_covariance(5, 2.0, 6.0), atol=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_fit_recovers_what_was_planted(seed: int) -> None:
    rng = np.random.default_rng(seed)
    series, steady = [], []
    for _ in range(300):
        factor = np.exp(np.sqrt(0.10) * rng.normal() + np.sqrt(0.15) * np.repeat(wander(60, 6.0, rng), 5))
        white = rng.normal(size=300)
        series.append(log_power(factor * white, 10))
        steady.append(log_power(white, 10))
    covariance, counts = autocovariance(series, 20)
    found = fit_volatility(covariance - autocovariance(steady, 20)[0], counts, 2.0, population=True)
    assert found.between == pytest.approx(0.10, abs=5 * 0.10 * np.sqrt(2 / 300))
    assert found.within == pytest.approx(0.15, abs=0.05)
    assert 3.0 <= found.correlation_time <= 12.0


def test_what_lasts_in_one_drive_wanders_slowly_and_differs_between_several() -> None:
    excess, counts = np.full(20, 0.2), np.full(20, 100.0)
    assert fit_volatility(excess, counts, 2.0, population=True).between == pytest.approx(0.2)
    alone = fit_volatility(excess, counts, 2.0, population=False)
    assert (alone.between, alone.slow) == (0.0, pytest.approx(0.2))


def test_steady_movement_has_no_volatility() -> None:
    assert fit_volatility(np.full(10, -0.01), np.ones(10), 2.0, population=True).total == 0.0


def test_contradictions_are_refused() -> None:
    for values in ((-0.1, 0.1, 5.0), (0.1, 0.1, 0.0), (float("nan"), 0.1, 1.0)):
        with pytest.raises(DriverProfileError, match="volatility"):
            Volatility(*values)
