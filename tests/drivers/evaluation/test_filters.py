"""What is called movement below 0.5 Hz shows nothing else, not even to a classifier."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.drivers.evaluation.classifier import classifier_two_sample_test
from xosc_lateral.drivers.evaluation.spectra import PASS_FREQUENCY, STOP_FREQUENCY, slow_movement, thinned

STEP = 0.2


@pytest.mark.parametrize(
    ("frequency", "left"),
    [(0.1, 1.0), (PASS_FREQUENCY, 1.0), (0.45, 0.5), (STOP_FREQUENCY, 0.0), (0.6, 0.0), (1.5, 0.0)],
)
def test_movement_above_half_a_hertz_is_gone(frequency: float, left: float) -> None:
    wave = np.sin(2.0 * np.pi * frequency * STEP * np.arange(800) + 0.4)
    found = slow_movement(wave, STEP)[100:-100]
    np.testing.assert_allclose(found, left * wave[100:-100], atol=0.012)


def test_a_straight_path_stays_to_its_very_ends() -> None:
    path = 0.3 + 0.01 * np.arange(200.0)
    np.testing.assert_allclose(slow_movement(path, STEP), path, atol=1e-12)


@pytest.mark.parametrize("path", [[], [0.4], [0.4, 0.4]])
def test_paths_of_nothing_stay_as_they_are(path: list[float]) -> None:
    np.testing.assert_allclose(slow_movement(np.array(path), STEP), path, atol=1e-15)


@pytest.mark.parametrize("step", [1.0, 2.0])
def test_where_a_rate_shows_nothing_faster_nothing_is_taken(step: float) -> None:
    path = np.random.default_rng(0).normal(size=50)
    np.testing.assert_array_equal(slow_movement(path, step), path)


@pytest.mark.parametrize(("step", "every"), [(0.2, 5), (0.04, 25), (2.0, 1)])
def test_rows_are_thinned_to_what_is_left(step: float, every: int) -> None:
    paths = np.arange(80.0).reshape(2, 40)
    np.testing.assert_array_equal(thinned(paths, step), paths[:, ::every])


def test_a_classifier_sees_nothing_of_what_is_faster() -> None:
    rng = np.random.default_rng(1)
    slow = np.array([coloured(rng, 0.0, STOP_FREQUENCY, 1500) for _ in range(150)])
    fast = np.array([coloured(rng, STOP_FREQUENCY, 1.0, 1500) for _ in range(150)])
    drives = np.array([f"d{number}" for number in range(150)])
    middle = slice(675, 825)  # 30 s, as far from the ends as the filter sees
    apart = classifier_two_sample_test(slow[:, middle], (slow + fast)[:, middle], drives, drives, fast=True, seed=0)
    one, other = (np.array([slow_movement(path, STEP)[middle] for path in paths]) for paths in (slow, slow + fast))
    result = classifier_two_sample_test(thinned(one, STEP), thinned(other, STEP), drives, drives, seed=0)
    assert apart is not None and apart.auc > 0.9
    assert result is not None and result.auc == pytest.approx(0.5, abs=0.03)


def coloured(rng: np.random.Generator, low: float, high: float, rows: int) -> np.ndarray:
    """A path with nothing outside a band; inside, a recording's density: some 1e-5 m2/Hz at 0.5 Hz. [m]"""
    frequency = np.fft.rfftfreq(rows, STEP)
    inside = (frequency > low) & (frequency < high)
    density = np.where(inside, 1e-5 / ((0.05 + frequency) / 0.5) ** 6, 0.0)
    lines = rng.normal(size=len(frequency)) + 1j * rng.normal(size=len(frequency))
    return np.fft.irfft(lines * np.sqrt(0.25 * density * rows / STEP), rows)
