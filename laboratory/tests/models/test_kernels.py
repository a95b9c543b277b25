"""The loop that steers to targets, against the differential equation that it stands for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from laboratory.board.models.kernels import steer_to_targets

STEP, INNER = 0.005, 10
LATERAL, HEADING = -0.001, -0.05
"""A vehicle that is to the left turns to the right; one that points left, too."""


def steered(speed: np.ndarray, targets: np.ndarray, lasting: np.ndarray) -> np.ndarray:
    return steer_to_targets(speed, targets, lasting, STEP, INNER, LATERAL, HEADING)


def test_without_a_target_nothing_moves() -> None:
    rows = steered(np.full((2, 50), 30.0), np.zeros((2, 3)), np.ones((2, 3)))
    assert rows.shape == (2, 50)
    assert not rows.any()


@pytest.mark.parametrize("speed", [15.0, 30.0])
def test_a_target_that_comes_up_evenly_is_followed_as_the_equation_says(speed: float) -> None:
    """heading' = v (k e + c heading), offset' = v sin(heading), e = offset + target as it comes up."""
    target, lasts = 0.5, 4.0
    rows = steered(np.full((1, 200), speed), np.array([[target, target]]), np.array([[lasts, 1e9]]))[0]

    def rates(time: float, state: np.ndarray) -> list[float]:
        offset, heading = state
        wanted = target * min(time / lasts, 1.0)
        return [speed * np.sin(heading), speed * (LATERAL * (offset + wanted) + HEADING * heading)]

    time = STEP * INNER * np.arange(200)
    exact = solve_ivp(rates, (0.0, time[-1]), [0.0, 0.0], t_eval=time, max_step=0.02, rtol=1e-8).y[0]
    np.testing.assert_allclose(rows, exact, atol=4e-3)
    assert rows[-1] < 0.0  # the drift counts against the vehicle's own offset


def test_it_settles_where_the_last_target_is() -> None:
    rows = steered(np.full((1, 4000), 30.0), np.array([[0.3, 0.3]]), np.array([[2.0, 1e9]]))[0]
    assert rows[-1] == pytest.approx(-0.3, abs=1e-3)


def test_every_vehicle_has_targets_of_its_own() -> None:
    speed, targets = np.full((2, 100), 25.0), np.array([[0.4, 0.4], [-0.4, -0.4]])
    rows = steered(speed, targets, np.full((2, 2), 3.0))
    np.testing.assert_allclose(rows[0], -rows[1], atol=1e-12)
    alone = steered(speed[:1], targets[:1], np.full((1, 2), 3.0))
    np.testing.assert_array_equal(alone[0], rows[0])


def test_nobody_drifts_who_stands() -> None:
    assert not steered(np.zeros((1, 100)), np.array([[0.5]]), np.array([[1.0]])).any()
