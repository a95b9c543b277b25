"""Whether drivers differ: against scipy's analysis of variance, planted scatter, and drives of one driver."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import f_oneway, kstest

from xosc_lateral.extras.loop import core_model
from xosc_lateral.extras.loop.core_model import DRIVERS_LEVEL, MIN_DRIVES, MIN_SECONDS, DriverVariance

SECONDS = 120


def drivers(
    seed: int, drives: int, *, shift: float = 0.0, log_spread: float = 0.0, known: np.ndarray | None = None,
    seconds: int = SECONDS,
) -> tuple[DriverVariance | None, list[np.ndarray]]:  # fmt: skip
    """Drives by the second, white at 0.1 m about levels of their own; also each drive's offsets."""
    rng = np.random.default_rng(seed)
    scale = 0.1 * np.exp(log_spread * rng.standard_normal(drives))
    levels = shift * rng.standard_normal(drives) + (0.0 if known is None else known)
    rows = scale[:, None] * rng.standard_normal((drives, seconds))
    whitener = SimpleNamespace(
        scale=0.1, drive=np.repeat(np.arange(drives), seconds), valid=np.ones(drives * seconds, dtype=bool)
    )
    fitted = SimpleNamespace(whitener=whitener, movement=rows.ravel() / 0.1, levels=levels)
    found = core_model.test_population(fitted, np.zeros(drives) if known is None else known)  # type: ignore[arg-type]
    own = levels if known is None else levels - known
    return found, [row + level for row, level in zip(rows, own, strict=True)]


@pytest.mark.parametrize("shift", [0.0, 0.03, 0.15])
def test_the_probability_is_that_of_an_analysis_of_variance_with_halves_as_repeats(shift):
    found, rows = drivers(1, 12, shift=shift)
    halves = [(row[: SECONDS // 2], row[SECONDS // 2 :]) for row in rows]
    means = f_oneway(*([a.mean(), b.mean()] for a, b in halves)).pvalue
    spreads = f_oneway(*([np.log(a.std()), np.log(b.std())] for a, b in halves)).pvalue
    assert found is not None
    assert found.p_value == pytest.approx(max(min(1.0, 2.0 * min(means, spreads)), core_model.MINIMUM_P), rel=1e-6)


@pytest.mark.parametrize(("shift", "log_spread"), [(0.15, 0.0), (0.2, 0.3), (0.0, 0.4)])
def test_the_scatter_that_was_planted_comes_back_without_the_noise(shift, log_spread):
    """200 drives: a standard deviation is known to 5 %, and what is not there to about a hundredth."""
    found, _ = drivers(2, 200, shift=shift, log_spread=log_spread)
    assert found is not None and found.is_found and found.drives == 200
    assert found.shift == pytest.approx(shift, rel=0.15, abs=0.01)
    assert found.log_spread == pytest.approx(log_spread, rel=0.15, abs=0.05)


def test_drives_of_one_driver_are_told_from_none_and_their_probabilities_are_even():
    found = [drivers(100 + seed, 20)[0] for seed in range(200)]
    p_values = [one.p_value for one in found if one is not None]
    assert len(p_values) == 200
    assert sum(p < DRIVERS_LEVEL for p in p_values) <= 3  # 0.4 expected of 200
    # twice the smaller of two: never too small, whatever the two have to do with each other
    assert kstest(p_values, "uniform", alternative="greater").pvalue > 0.001


def test_what_an_effect_between_drives_explains_is_no_driver():
    keeps = np.linspace(-0.4, 0.4, 60)
    explained, _ = drivers(3, 60, known=keeps)
    assert explained is not None and not explained.is_found and explained.shift < 0.02


def test_few_drives_and_short_ones_say_nothing():
    assert drivers(4, MIN_DRIVES)[0] is not None
    assert drivers(4, MIN_DRIVES - 1)[0] is None
    assert drivers(4, 20, seconds=2 * MIN_SECONDS)[0] is not None
    assert drivers(4, 20, seconds=2 * MIN_SECONDS - 1)[0] is None


def test_scatter_is_tested_as_in_an_analysis_of_variance() -> None:
    halves = np.random.default_rng(2).normal(size=(12, 2)) + np.random.default_rng(3).normal(size=(12, 1))
    _, p_value = core_model._scatter(halves)
    assert p_value == pytest.approx(f_oneway(*halves).pvalue, rel=1e-9)


def test_scatter_between_drives_is_freed_of_noise() -> None:
    rng = np.random.default_rng(4)
    halves = 0.3 * rng.normal(size=(4000, 1)) + 0.5 * rng.normal(size=(4000, 2))
    deviation, p_value = core_model._scatter(halves)
    assert deviation == pytest.approx(0.3, abs=0.02)
    assert p_value < 1e-6
    assert core_model._scatter(0.5 * rng.normal(size=(10, 2)))[0] >= 0.0
