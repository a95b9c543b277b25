"""What is compared in windows: spectra, memory and distances with known values."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from xosc_lateral.drivers.evaluation.lane_keeping import INDICATORS
from xosc_lateral.drivers.evaluation.metrics import METRICS
from xosc_lateral.drivers.evaluation.snippets import (
    BANDS,
    LAGS,
    UNITS,
    Features,
    autocorrelation_of,
    band_power,
    column_distances,
    differences,
    features_of,
    named_distances,
    named_means,
    resolved_bands,
)

STEP = 0.2
RNG = np.random.default_rng(1)


def windows(n: int = 80, seconds: float = 30.0, size: float = 0.1, seed: int = 2) -> np.ndarray:
    """First-order movement with a memory of 4 s."""
    rng, m = np.random.default_rng(seed), round(seconds / STEP)
    keep, paths = np.exp(-STEP / 4.0), np.empty((n, m))
    paths[:, 0] = rng.normal(size=n)
    for row in range(1, m):
        paths[:, row] = keep * paths[:, row - 1] + np.sqrt(1.0 - keep**2) * rng.normal(size=n)
    return size * paths


def features(offset: np.ndarray) -> Features:
    return features_of(offset, np.full(offset.shape, 3.5), STEP)


ALL = np.arange(80)


def test_white_noise_has_an_even_density_of_its_variance_over_the_nyquist_band() -> None:
    power = band_power(0.1 * RNG.normal(size=(400, 300)), STEP).mean(axis=0)
    np.testing.assert_allclose(power, 2.0 * STEP * 0.01, rtol=4.0 / np.sqrt(400))  # a band may hold one ordinate


def test_a_wave_stands_in_its_band_and_in_no_other() -> None:
    wave = 0.1 * np.sin(2.0 * np.pi * 0.2 * STEP * np.arange(300))[None]
    bands = resolved_bands(60.0)
    power = band_power(wave, STEP)[0]
    strongest = int(np.argmax(power))
    low, high = bands[strongest]
    assert low <= 0.2 < high
    assert power[[k for k in range(len(bands)) if abs(k - strongest) > 1]].max() < 0.01 * power[strongest]


def test_a_straight_line_has_no_power() -> None:
    assert band_power(0.3 + 0.02 * np.arange(100.0)[None], STEP).max() < 1e-20


@pytest.mark.parametrize(("seconds", "lowest"), [(60.0, 1.0 / 60.0), (10.0, 0.1), (5.0, 0.2)])
def test_a_window_goes_through_what_it_resolves_at_least_once(seconds: float, lowest: float) -> None:
    bands = resolved_bands(seconds)
    assert bands[0][0] >= lowest
    assert bands[-1][1] == pytest.approx(float(BANDS[-1]))
    assert all(one[1] == pytest.approx(other[0]) for one, other in pairwise(bands))
    assert resolved_bands(seconds, highest=0.4)[-1][1] <= 0.4


def test_memory_is_that_of_the_movement() -> None:
    found = autocorrelation_of(features(windows(n=600, seconds=60.0)), np.arange(600))
    np.testing.assert_allclose(found, np.exp(-np.array(LAGS) / 4.0), atol=0.06)


def test_no_movement_stays_as_it_is() -> None:
    still = features(np.full((3, 150), 0.2))
    np.testing.assert_array_equal(autocorrelation_of(still, np.arange(3)), np.ones(still.products.shape[1]))


@pytest.mark.parametrize(("seconds", "lags"), [(10.0, 3), (20.0, 4), (60.0, 6)])
def test_lags_up_to_half_a_window_are_used(seconds: float, lags: int) -> None:
    assert features(windows(seconds=seconds)).products.shape == (80, lags)


def test_the_same_windows_are_no_distance_apart_in_any_order() -> None:
    own = features(windows())
    assert differences(own, own, ALL, ALL[::-1]) == pytest.approx(dict.fromkeys(UNITS, 0.0), abs=1e-9)


def test_twice_the_movement_is_six_decibels_and_the_same_memory() -> None:
    one, two = features(windows()), features(2.0 * windows())
    found = differences(one, two, ALL, ALL)
    assert found["spectrum"] == pytest.approx(20.0 * np.log10(2.0), abs=0.01)
    assert found["memory"] == pytest.approx(0.0, abs=1e-9)
    assert found["metrics"] > 0.3


def test_another_place_is_seen_by_metrics_and_not_by_spectrum_and_memory() -> None:
    found = differences(features(windows()), features(windows() + 0.15), ALL, ALL)
    assert found["metrics"] > 0.3
    assert found["spectrum"] == pytest.approx(0.0, abs=1e-6)
    # products of early and of late rows about one mean: what they differ by in 80 windows is taken for memory
    assert found["memory"] < 0.1


def test_rows_that_count_twice_are_those_rows_twice() -> None:
    own = features(windows())
    rows = np.array([3, 3, 5])
    taken = own.take(rows)
    assert len(taken) == 3
    assert differences(own, own, rows, ALL) == pytest.approx(differences(taken, own, np.arange(3), ALL))


def test_names_stand_beside_their_numbers() -> None:
    one, two = features(windows()), features(windows(size=0.2))
    distances = named_distances(one, two)
    assert tuple(distances) == (*METRICS, *INDICATORS)
    assert distances["std"] == pytest.approx(column_distances(one.metrics, two.metrics)[METRICS.index("std")])
    means = named_means(one, two)
    assert means["sdlp"][1] == pytest.approx(2.0 * means["sdlp"][0])
