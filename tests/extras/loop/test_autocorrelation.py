"""Autoregression and whitening against closed forms and against a dense covariance matrix."""

import numpy as np
import pytest
from scipy.linalg import toeplitz

from xosc_lateral.extras.loop.autocorrelation import Whitener, fit_autoregression, positions_in_run, unbiased


def second_order(n: int, seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=n + 500)
    values = np.zeros(n + 500)
    for t in range(2, n + 500):
        values[t] = 1.5 * values[t - 1] - 0.7 * values[t - 2] + 0.3 * noise[t]
    return values[500:]


def test_fit_recovers_the_process_it_was_simulated_from() -> None:
    n = 20_000
    process = fit_autoregression(second_order(n, 1), np.ones(n, dtype=bool), 2)
    assert process.lags[-1] == pytest.approx([1.5, -0.7], abs=4 / np.sqrt(n))
    assert process.deviations[-1] == pytest.approx(0.3, rel=4 / np.sqrt(2 * n))


def test_lower_order_predictors_follow_from_the_process() -> None:
    process = fit_autoregression(second_order(50_000, 2), np.ones(50_000, dtype=bool), 2)
    a, b = process.lags[-1]
    assert process.lags[1] == pytest.approx([a / (1 - b)], rel=1e-6)  # Yule-Walker
    variance = (1 - b) / ((1 + b) * ((1 - b) ** 2 - a**2)) * process.deviations[-1] ** 2
    assert process.deviations[0] ** 2 == pytest.approx(variance, rel=1e-6)


def test_whitening_is_the_inverse_of_the_covariance_within_stretches() -> None:
    values = second_order(60, 3)
    valid = np.ones(60, dtype=bool)
    valid[25:31] = False
    process = fit_autoregression(second_order(50_000, 2), np.ones(50_000, dtype=bool), 2)
    whitener = Whitener(process, valid, np.zeros(60, dtype=np.intp), np.ones(60))
    a, b = process.lags[-1]
    gamma = np.empty(60)
    gamma[0] = process.deviations[0] ** 2
    gamma[1] = a / (1 - b) * gamma[0]
    for lag in range(2, 60):
        gamma[lag] = a * gamma[lag - 1] + b * gamma[lag - 2]
    expected = sum(
        values[rows] @ np.linalg.solve(toeplitz(gamma[: len(values[rows])]), values[rows])
        for rows in (slice(0, 25), slice(31, 60))
    )
    white = whitener.white(values)
    assert white @ white == pytest.approx(expected, rel=1e-8)


def test_means_of_long_stretches_give_a_memory_that_few_coefficients_hold() -> None:
    """A slow wander beside a quick one: what whitening leaves below 1/60 Hz is near the level of the rest."""
    rng = np.random.default_rng(8)
    n = 30_000
    slow, quick = np.zeros(n), np.zeros(n)
    pushes = rng.normal(size=(2, n))
    for t in range(1, n):
        slow[t] = np.exp(-1 / 50) * slow[t - 1] + 0.1 * pushes[0, t]
        quick[t] = 0.7 * quick[t - 1] + 0.5 * pushes[1, t]
    valid = np.ones(n, dtype=bool)
    process = fit_autoregression(slow + quick, valid, 12, longest=96)
    assert process.order == 96
    white = Whitener(process, valid, np.zeros(n, dtype=np.intp), np.ones(n)).rows(slow + quick)
    power = np.abs(np.fft.rfft(white)) ** 2 / n
    frequency = np.fft.rfftfreq(n)
    assert power[(frequency > 1e-3) & (frequency < 1 / 60)].mean() == pytest.approx(1.0, abs=0.2)


def test_intercepts_of_drives_are_taken_out() -> None:
    drive, valid = np.repeat([0, 1], 100), np.ones(200, dtype=bool)
    valid[95:105] = False  # drives never touch on a timeline
    process = fit_autoregression(second_order(5_000, 5), np.ones(5_000, dtype=bool), 3)
    whitener = Whitener(process, valid, drive, np.ones(200))
    assert whitener.rows(np.where(drive == 0, 3.0, -2.0)) == pytest.approx(np.zeros(200), abs=1e-9)


def test_positions_count_within_stretches() -> None:
    valid = np.array([True, True, False, True, True, True])
    assert positions_in_run(valid).tolist() == [0, 1, -1, 0, 1, 2]


def test_levels_of_short_drives_do_not_make_the_process_look_forgetful() -> None:
    """An AR(1) seen for a minute at a time with a level of its own: Nickell's bias, and what is left of it."""
    drives, seconds, rho = 240, 60, 0.9
    rng = np.random.default_rng(4)
    values = np.zeros((drives, seconds + 200))
    for t in range(1, values.shape[1]):
        values[:, t] = rho * values[:, t - 1] + rng.normal(size=drives)
    valid = np.tile(np.arange(seconds + 40) < seconds, drives)
    drive = np.repeat(np.arange(drives), seconds + 40)
    seen = np.zeros((drives, seconds + 40))
    seen[:, :seconds] = values[:, -seconds:] - values[:, -seconds:].mean(axis=1, keepdims=True)
    biased = fit_autoregression(seen.ravel(), valid, 1)
    better = unbiased(biased, valid, drive, 1)
    chance = np.sqrt((1 - rho**2) / (drives * seconds))
    assert biased.lags[-1][0] < rho - 5 * chance
    assert better.lags[-1][0] == pytest.approx(rho, abs=3 * chance)
    assert better.deviations[-1] == pytest.approx(1.0, rel=0.03)


def test_the_noise_is_white_and_beside_what_is_seen() -> None:
    n, noise = 50_000, 0.8
    seen = second_order(n, 5)
    noisy = seen + noise * np.random.default_rng(6).normal(size=n)
    valid = np.ones(n, dtype=bool)
    found = fit_autoregression(seen, valid, 4, longest=16, noise=noise)
    made = fit_autoregression(noisy, valid, 4, longest=16)
    assert found.lags[-1] == pytest.approx(made.lags[-1], abs=6 / np.sqrt(n))
    assert found.deviations[-1] == pytest.approx(made.deviations[-1], rel=4 / np.sqrt(2 * n))
