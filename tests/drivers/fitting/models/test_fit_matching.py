"""What simulated and measured snippets are compared by, and which way a difference corrects."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.core_models import POPULATION, STEADY
from xosc_lateral.drivers.fitting.models.autoregressive_coarse import DEFAULT_SETTINGS, scaled_spectrum
from xosc_lateral.drivers.fitting.models.autoregressive_fit import (
    LARGEST_STEP,
    MOST_CORRELATED,
    SIMULATED_DRIVERS,
    SNIPPETS_EACH,
    VARIANCE_NUDGE,
    _asked,
    _coarse_gain,
    _corrected,
    _drives_of,
    _gain,
    _log_spectrum,
    _moments,
    _volatile,
    _wiggle,
    matched,
    simulate,
)
from xosc_lateral.drivers.model.core.autoregressive.parameters import GRID, Autoregression

NOTHING, SLOPES = np.zeros(7), np.ones(2)


def snippets(seed: int = 1, n: int = 200) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n, 51)).cumsum(axis=1)


def test_moments_are_means_variances_and_a_covariance_of_log_deviations() -> None:
    rows = snippets()
    logs = [[np.log(np.std(np.diff(row, k))) for row in rows] for k in range(3)]
    expected = [part for own in logs for part in (np.mean(own), np.var(own))]
    np.testing.assert_allclose(_moments(rows), [*expected, np.cov(logs[0], logs[2], bias=True)[0, 1]], rtol=1e-9)


def test_the_unit_moves_the_three_means_and_nothing_else() -> None:
    change = _moments(3.0 * snippets()) - _moments(snippets())
    np.testing.assert_allclose(change, [np.log(3.0), 0.0, np.log(3.0), 0.0, np.log(3.0), 0.0, 0.0], atol=1e-9)


def test_mirrored_snippets_and_snippets_elsewhere_have_the_same_moments() -> None:
    np.testing.assert_allclose(_moments(-snippets()), _moments(snippets()), rtol=1e-12)
    np.testing.assert_allclose(_moments(snippets() + 5.0), _moments(snippets()), rtol=1e-9)


def test_snippets_that_stand_still_have_finite_moments() -> None:
    assert np.isfinite(_moments(np.full((5, 51), 0.2))).all()


def test_twice_the_size_adds_the_log_of_four_to_the_spectrum() -> None:
    # a straight line from end to end is taken out: the slowest ordinate is nothing but rounding
    change = (_log_spectrum([2.0 * snippets()], 50) - _log_spectrum([snippets()], 50))[1:]
    np.testing.assert_allclose(change, np.log(4.0), atol=1e-6)


def test_the_spectrum_of_a_stack_is_that_of_its_runs() -> None:
    stack = snippets(n=20)
    np.testing.assert_allclose(_log_spectrum([stack], 20), _log_spectrum(list(stack), 20), rtol=1e-9)


def test_windows_of_half_a_minute_show_a_fall_that_those_of_ten_seconds_blur() -> None:
    """Power that falls by 14 dB from 0.3 to 0.5 Hz, as drivers' does: how much of it is seen. [dB]"""
    hertz = np.fft.rfftfreq(3000, 0.2)
    noise = np.random.default_rng(3).normal(size=(60, 3000))
    runs = list(np.fft.irfft(np.fft.rfft(noise) * 10.0 ** (-3.5 * (np.clip(hertz, 0.3, 0.5) - 0.3)), n=3000))

    def fall(size: int) -> float:
        at = np.interp([0.3, 0.5], np.fft.rfftfreq(size, 0.2), _log_spectrum(runs, size))
        return float(10.0 / np.log(10.0) * (at[0] - at[1]))

    assert fall(150) == pytest.approx(13.0, abs=0.5)
    assert fall(50) < 11.0


def test_what_is_asked_is_half_way_between_spread_and_speed_and_the_roughness() -> None:
    np.testing.assert_allclose(_asked(np.array([9.0, 0.2, 9.0, 0.4, 9.0, 0.7, 9.0])), [0.3, 0.7])


def test_nothing_lacking_corrects_nothing() -> None:
    same = _corrected(POPULATION, NOTHING, SLOPES, DEFAULT_SETTINGS)
    assert same.coarse.scale == POPULATION.coarse.scale
    assert same.coarse_volatility.total == pytest.approx(POPULATION.coarse_volatility.total)
    assert same.correlation == POPULATION.correlation


def test_log_sizes_that_lack_so_much_enlarge_the_scale_by_it() -> None:
    lacks = np.array([0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    larger = _corrected(POPULATION, lacks, SLOPES, DEFAULT_SETTINGS)
    assert larger.coarse.scale == pytest.approx(POPULATION.coarse.scale * np.exp(0.1))


@pytest.mark.parametrize(
    ("lack", "step"), [(0.05, 0.05), (-0.05, -0.05), (9.0, VARIANCE_NUDGE), (-9.0, -VARIANCE_NUDGE)]
)
def test_volatility_grows_by_what_lacks_over_the_slope_and_no_further_than_was_tried(lack: float, step: float) -> None:
    lacks = np.array([0.0, lack, 0.0, lack, 0.0, 0.0, 0.0])
    found = _corrected(POPULATION, lacks, SLOPES, DEFAULT_SETTINGS)
    assert found.coarse_volatility.total == pytest.approx(POPULATION.coarse_volatility.total * np.exp(step))
    assert found.fine_volatility.total == pytest.approx(POPULATION.fine_volatility.total)


def test_a_correlation_stays_between_nothing_and_one() -> None:
    for lack, expected in ((99.0, MOST_CORRELATED), (-99.0, 0.0)):
        found = _corrected(POPULATION, np.array([0.0] * 6 + [lack]), SLOPES, DEFAULT_SETTINGS)
        assert found.correlation == expected


def test_both_volatilities_are_moved_by_their_own_factor() -> None:
    moved = _volatile(POPULATION, np.log(2.0), np.log(0.5))
    assert moved.coarse_volatility.total == pytest.approx(2.0 * POPULATION.coarse_volatility.total)
    assert moved.fine_volatility.total == pytest.approx(0.5 * POPULATION.fine_volatility.total)


@pytest.mark.parametrize(("lack", "factor"), [(0.0, 1.0), (0.2, np.exp(0.1)), (9.0, np.exp(LARGEST_STEP))])
def test_noise_is_raised_by_half_the_log_power_that_it_lacks(lack: float, factor: float) -> None:
    gain = _gain(POPULATION, np.full(26, lack))
    np.testing.assert_allclose(gain, factor)
    assert gain.shape == POPULATION.fine.damping.shape


def test_a_straight_path_has_no_wiggle_and_a_parabola_the_same_everywhere() -> None:
    t = np.arange(60.0)
    np.testing.assert_allclose(_wiggle((3.0 + 0.1 * t, t)), 0.0, atol=1e-12)
    np.testing.assert_allclose(_wiggle((t**2, t)), 2.0 * 5.0**2)


def test_drives_beyond_one_batch_are_others() -> None:
    few, many = (_drives_of(STEADY, 51, 7, drivers) for drivers in (SIMULATED_DRIVERS, SIMULATED_DRIVERS + 3))
    np.testing.assert_array_equal(many[:SIMULATED_DRIVERS], few)
    assert many.shape == (SIMULATED_DRIVERS + 3, SNIPPETS_EACH * 51)
    assert not np.array_equal(many[SIMULATED_DRIVERS:], many[:3])


def test_simulated_drives_are_the_model_s_drives() -> None:
    starts = np.array([0.1, -0.1, 0.0])
    made = simulate(STEADY, 40, 7, drivers=3, starts=starts)
    assert made.shape == (3, 40)
    np.testing.assert_allclose(made[:, 0], starts, atol=1e-12)
    np.testing.assert_array_equal(made, simulate(STEADY, 40, 7, drivers=3, starts=starts))


# ---- the coarse movement's spectrum ----------------------------------------------------------------------------------
FREQUENCY = np.arange(GRID // 2 + 1) / GRID
"""Cycles per coarse step, which is a second: [Hz]."""


def bump(size: float) -> np.ndarray:
    """Amplitude that many times as large from 0.3 to 0.4 Hz."""
    return 1.0 + (size - 1.0) * np.exp(-(((FREQUENCY - 0.35) / 0.05) ** 2))


def test_a_gain_of_one_leaves_the_autoregression_and_another_is_in_its_spectrum() -> None:
    coarse = Autoregression(np.concatenate([POPULATION.coarse.coefficients, np.zeros(14)]), POPULATION.coarse.scale)
    same = scaled_spectrum(coarse, np.ones(len(FREQUENCY)))
    np.testing.assert_allclose(same.power(FREQUENCY), coarse.power(FREQUENCY), rtol=1e-3)
    larger = scaled_spectrum(coarse, bump(1.3))
    ratio = np.sqrt(larger.power(FREQUENCY) / coarse.power(FREQUENCY))
    np.testing.assert_allclose(ratio, bump(1.3), rtol=0.03)


def test_the_coarse_movement_is_raised_by_half_the_log_power_that_it_lacks_and_only_near_the_border() -> None:
    gain = _coarse_gain(np.full(76, 0.2), DEFAULT_SETTINGS)
    assert gain[(FREQUENCY >= 0.33) & (FREQUENCY <= 0.4)] == pytest.approx(np.exp(0.1))
    assert gain[(FREQUENCY <= 0.2) | (FREQUENCY >= 0.45)] == pytest.approx(1.0)
    assert _coarse_gain(np.full(76, 9.0), DEFAULT_SETTINGS).max() == pytest.approx(np.exp(LARGEST_STEP))


@pytest.mark.parametrize("size", [0.8, 1.25])
def test_power_that_a_model_lacks_or_has_too_much_near_the_border_comes_back(size: float) -> None:
    """Runs are of a population; the model begins with a spectrum that is off by 2 dB from 0.3 to 0.4 Hz."""
    long = np.concatenate([POPULATION.coarse.coefficients, np.zeros(14)])
    truth = replace(POPULATION, coarse=Autoregression(long, POPULATION.coarse.scale))
    runs = list(simulate(truth, 601, 3, drivers=300))
    off = replace(truth, coarse=scaled_spectrum(truth.coarse, bump(size)))
    found = matched(off, runs, DEFAULT_SETTINGS)
    near = (FREQUENCY > 0.33) & (FREQUENCY < 0.38)
    before, after = (
        10.0 * np.abs(np.log10(model.coarse.power(FREQUENCY[near]) / truth.coarse.power(FREQUENCY[near]))).mean()
        for model in (off, found)
    )
    assert before > 1.3
    assert after < 0.3 * before
