"""Innovations as the table shows them: responses that its provider smoothed are taken out smoothed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from tests.kit.coarse import wander
from xosc_lateral.extras.loop.model import innovations, smoothed_as_seen

N = 3000
VALID, DRIVE, SCALE = np.ones(N, dtype=bool), np.zeros(N, dtype=np.intp), np.ones(N)
SMOOTHING_S = 0.7
"""Standard deviation of a Gaussian that leaves 42 % at 0.3 Hz. [s]"""


def movement(seed: int) -> np.ndarray:
    """0.1 m with a memory of 5 s, at 1 Hz."""
    return 0.1 * wander(np.random.default_rng(seed), 5 * N, 5.0)[::5]


def switch() -> np.ndarray:
    """0.3 m to the left, on and off every 50 s."""
    return np.where(np.arange(N) // 50 % 2 == 1, 0.3, 0.0)


def smoothed(values: np.ndarray) -> np.ndarray:
    return np.asarray(gaussian_filter1d(values, SMOOTHING_S))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_response_that_the_table_shows_smoothed_is_taken_out_smoothed(seed: int) -> None:
    moved = smoothed(movement(seed) + switch())
    found = smoothed_as_seen(moved, switch(), VALID, DRIVE, SCALE)
    assert np.abs(found - smoothed(switch())).max() < 0.03
    assert np.abs(switch() - smoothed(switch())).max() > 0.06


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_a_response_that_is_there_as_it_is_stays_as_it_is(seed: int) -> None:
    found = smoothed_as_seen(movement(seed) + switch(), switch(), VALID, DRIVE, SCALE)
    assert np.abs(found - switch()).max() < 0.03


def test_smoothing_keeps_what_stays() -> None:
    """A filter of gain one: far from every edge a response is what it was."""
    found = smoothed_as_seen(smoothed(movement(7) + switch()), switch(), VALID, DRIVE, SCALE)
    inside = (np.arange(N) % 50 >= 5) & (np.arange(N) % 50 < 45)
    np.testing.assert_allclose(found[inside], switch()[inside], atol=1e-12)


@pytest.mark.parametrize("seed", [8, 9])
def test_edges_of_a_smoothed_response_are_no_loud_seconds(seed: int) -> None:
    moved = smoothed(movement(seed) + switch())
    edge = np.isin(np.arange(N) % 50, (0, 1, 49)) & (np.arange(N) > 100)
    rough = innovations(moved - switch(), np.zeros(N), VALID, DRIVE, SCALE)
    rows = innovations(moved, switch(), VALID, DRIVE, SCALE)
    assert np.mean(rough[edge] ** 2) > 3.0 * np.mean(rough[~edge] ** 2)
    assert np.mean(rows[edge] ** 2) < 1.5 * np.mean(rows[~edge] ** 2)


def test_without_a_response_innovations_are_independent_and_alike() -> None:
    rows = innovations(movement(10), np.zeros(N), VALID, DRIVE, SCALE)
    assert rows.std() == pytest.approx(1.0, abs=0.02)
    assert abs(np.corrcoef(rows[1:], rows[:-1])[0, 1]) < 0.05
