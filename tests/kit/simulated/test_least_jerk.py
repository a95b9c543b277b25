"""The move with the least jerk, by what defines it."""

from __future__ import annotations

import numpy as np
import pytest

from examples.driver_simulator.motorway import least_jerk

FINE = np.concatenate([[0.0], least_jerk(20_000)])
STEP = 1.0 / 20_000


@pytest.mark.parametrize("length", [1, 2, 7, 40])
def test_it_ends_where_it_should_in_so_many_steps(length: int) -> None:
    ease = least_jerk(length)
    assert ease.shape == (length,)
    assert ease[-1] == 1.0
    assert (np.diff(ease) > 0.0).all()


def test_it_begins_and_ends_at_rest_without_a_push() -> None:
    for order, bound in ((1, 1e-6), (2, 1e-2)):
        derivative = np.diff(FINE, order) / STEP**order
        assert abs(derivative[0]) < bound * 10.0
        assert abs(derivative[-1]) < bound * 10.0


def test_the_way_back_is_the_way_there() -> None:
    np.testing.assert_allclose(FINE + FINE[::-1], 1.0, atol=1e-12)


def test_its_peak_speed_is_the_published_one() -> None:
    """15 / 8 of the mean speed (Flash and Hogan, 1985)."""
    assert np.diff(FINE).max() / STEP == pytest.approx(15.0 / 8.0, rel=1e-6)


def test_no_other_move_from_rest_to_rest_has_less_jerk() -> None:
    u = np.linspace(0.0, 1.0, 401)
    best = np.sum(np.diff(u**3 * (10.0 - 15.0 * u + 6.0 * u**2), 3) ** 2)
    for size in (0.3, -0.3):
        other = u**3 * (10.0 - 15.0 * u + 6.0 * u**2) + size * u**3 * (1.0 - u) ** 3
        assert np.sum(np.diff(other, 3) ** 2) > best
