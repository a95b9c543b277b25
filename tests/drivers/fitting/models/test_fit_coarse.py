"""The coarse movement's fit: memory and what drivers differ by, each known beforehand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from xosc_lateral.drivers.fitting.models.autoregressive_coarse import (
    DEFAULT_SETTINGS,
    _restored,
    fit_coarse,
)
from xosc_lateral.drivers.model.core.autoregressive.parameters import (
    BORDER,
    COARSE_EVERY,
    GRID,
    Autoregression,
    measuring_low_pass,
    split_bands,
)

STEP = 0.2
MEMORY = 6.0
"""Of the movement about a driver's mean. [s]"""


def movement(rng: np.random.Generator, seconds: float, spread: float = 0.1) -> np.ndarray:
    """First-order wander at 5 Hz with the memory above."""
    n, keep = round(seconds / STEP), np.exp(-STEP / MEMORY)
    noise = rng.normal(size=n + 400) * spread * np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], noise))[400:]


def population(drivers: int, seconds: float, between: float, seed: int) -> tuple[list[np.ndarray], list[str]]:
    """Low-passed runs about the common mean, and whose they are."""
    rng = np.random.default_rng(seed)
    runs = [between * rng.normal() + movement(rng, seconds) for _ in range(drivers)]
    mean = float(np.concatenate(runs).mean())
    return [split_bands(run, STEP)[0] - mean for run in runs], [f"d{k}" for k in range(drivers)]


@pytest.mark.parametrize("between", [0.0, 0.1])
def test_memory_and_differences_between_drivers_are_told_apart(between: float) -> None:
    """0.1 lane widths of movement, and drivers who keep elsewhere by as much or not at all."""
    slow, drives = population(150, 60.0, between, seed=2)
    coarse, found = fit_coarse(slow, drives, DEFAULT_SETTINGS)
    spread = 0.1**2 / np.sqrt(150 * 60.0 / (2.0 * MEMORY))  # of a covariance, from so many independent pairs
    assert found == pytest.approx(between**2, abs=4.0 * (spread + between**2 / np.sqrt(75.0)))
    covariance = coarse.covariance(12)
    np.testing.assert_allclose(covariance[[3, 6]] / covariance[0], np.exp(-np.array([3.0, 6.0]) / MEMORY), atol=0.12)
    assert covariance[0] == pytest.approx(0.1**2, rel=0.2)


def test_one_driver_alone_has_nobody_to_differ_from() -> None:
    slow, _ = population(1, 900.0, 0.0, seed=3)
    coarse, between = fit_coarse(slow, ["d0"], DEFAULT_SETTINGS)
    assert between == 0.0
    assert coarse.order == DEFAULT_SETTINGS.order


def test_short_runs_lower_the_order() -> None:
    slow, drives = population(40, 20.0, 0.0, seed=4)
    assert fit_coarse(slow, drives, DEFAULT_SETTINGS)[0].order == int(0.4 * 20.0)


def test_twice_the_offset_is_twice_the_scale_and_four_times_the_variance_between() -> None:
    slow, drives = population(30, 60.0, 0.1, seed=5)
    one, between = fit_coarse(slow, drives, DEFAULT_SETTINGS)
    two, more = fit_coarse([2.0 * run for run in slow], drives, DEFAULT_SETTINGS)
    assert two.scale == pytest.approx(2.0 * one.scale, rel=1e-9)
    assert more == pytest.approx(4.0 * between, rel=1e-9)
    np.testing.assert_allclose(two.coefficients, one.coefficients, atol=1e-9)


def test_the_mirror_image_is_fitted_alike() -> None:
    slow, drives = population(30, 60.0, 0.1, seed=6)
    one, between = fit_coarse(slow, drives, DEFAULT_SETTINGS)
    other, same = fit_coarse([-run for run in slow], drives, DEFAULT_SETTINGS)
    np.testing.assert_array_equal(one.coefficients, other.coefficients)
    assert (one.scale, between) == (other.scale, same)


def test_what_the_low_pass_took_below_the_border_is_given_back() -> None:
    """A process whose power was lessened as the filter lessens it comes back with the power it had."""
    true = Autoregression(np.array([0.9]), 0.1)
    frequency = np.arange(GRID // 2 + 1) / GRID
    kernel = measuring_low_pass(STEP)
    gain = np.abs(np.exp(-2j * np.pi * np.outer(frequency / COARSE_EVERY, np.arange(len(kernel)))) @ kernel)
    covariance = np.fft.irfft(true.power(frequency) * gain**2, GRID)[:17]
    from scipy.linalg import solve_toeplitz

    lessened = solve_toeplitz(covariance[:-1] + np.eye(16)[0] * 1e-9 * covariance[0], covariance[1:])
    scale = np.sqrt(covariance[0] - lessened @ covariance[1:])
    restored = _restored(Autoregression(lessened, float(scale)), STEP)
    slow = frequency < 0.8 * BORDER
    ratio = restored.power(frequency[slow]) / true.power(frequency[slow])
    np.testing.assert_allclose(ratio, 1.0, atol=0.1)
