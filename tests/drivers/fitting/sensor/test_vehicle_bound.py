"""The prior on a driver's spectrum: its slopes, its knots, and what lies between and beyond them."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.drivers.fitting.sensor.likelihood import (
    BEND_SD,
    BRISKER_SD,
    BRISKEST_CORNER,
    FREE_BELOW,
    KNOTS,
    LAG_CORNER,
    N_KNOTS,
    N_STATE,
    SLOPE_SD,
    SLOPES,
    SLOWER_SD,
    STEEPEST_KNOWN,
    density,
    expected_log_density,
    interpolation,
    prior,
)

LOG = np.log(KNOTS)


def expected_state() -> np.ndarray:
    """The likeliest of the prior, up to its level: straight on where slopes are free."""
    values, log = expected_log_density(KNOTS), np.log(KNOTS)
    first = int(np.flatnonzero(0.5 * (log[1:] + log[:-1]) > np.log(FREE_BELOW))[0])
    values[:first] = values[first] + (SLOPES @ values)[first] * (log[:first] - log[first])
    return np.append(values, 0.0)


def power_law(slope: float) -> np.ndarray:
    """Log densities at the knots of a density that falls by one power throughout."""
    return slope * LOG - 3.0


# ---- knots -----------------------------------------------------------------------------------------------------------
def test_knots_rise_from_a_minute_and_more_to_what_no_steering_does() -> None:
    assert np.all(np.diff(KNOTS) > 0.0)
    assert 1.0 / KNOTS[0] >= 60.0  # slower than the minute within which a lane is kept
    assert KNOTS[-1] > LAG_CORNER  # beyond the corner of muscles and vehicle


def test_knots_are_close_enough_for_the_bends_between_the_corners() -> None:
    """A polygon through the knots is nowhere a decibel off the expected density."""
    fine = np.exp(np.linspace(np.log(FREE_BELOW), LOG[-1], 4001))
    polygon = np.interp(np.log(fine), LOG, expected_log_density(KNOTS))
    assert 10.0 / np.log(10.0) * np.abs(polygon - expected_log_density(fine)).max() < 1.0


def test_corners_of_the_prior_lie_between_knots_of_either_side() -> None:
    for corner in (FREE_BELOW, BRISKEST_CORNER, LAG_CORNER):
        assert np.count_nonzero(corner - 1e-12 > KNOTS) >= 2
        assert np.count_nonzero(corner + 1e-12 < KNOTS) >= 2


# ---- slopes ----------------------------------------------------------------------------------------------------------
def slope_at(frequency: float, shift: float = 0.0) -> float:
    """Numerically, of log power over log frequency."""
    below, above = (expected_log_density(np.array([frequency * np.exp(h)]), shift)[0] for h in (-1e-5, 1e-5))
    return float(above - below) / 2e-5


def test_the_slope_is_that_of_keeping_a_lane_below_and_of_two_integrations_and_more_above() -> None:
    assert slope_at(1e-3) == pytest.approx(-1.0, abs=1e-4)
    assert slope_at(BRISKEST_CORNER) == pytest.approx(
        -3.5 - 3.0 * BRISKEST_CORNER**2 / (1.0 + BRISKEST_CORNER**2), abs=1e-6
    )
    assert slope_at(LAG_CORNER) == pytest.approx(-6.0 - 1.5, abs=0.01)
    assert slope_at(1e3) == pytest.approx(-9.0, abs=1e-4)  # -4 - 2 - 3


def test_the_corner_moves_with_its_shift_and_the_lags_stay() -> None:
    shift = np.log(0.5)
    lags = lambda f: 3.0 * f**2 / (1.0 + f**2)  # noqa: E731
    assert slope_at(0.5 * BRISKEST_CORNER, shift) + lags(0.5 * BRISKEST_CORNER) == pytest.approx(
        slope_at(BRISKEST_CORNER) + lags(BRISKEST_CORNER), abs=1e-6
    )
    assert slope_at(1e3, shift) == pytest.approx(slope_at(1e3), abs=1e-4)


def test_it_only_ever_falls_faster() -> None:
    log = np.linspace(np.log(FREE_BELOW), np.log(5.0), 2000)
    assert np.all(np.diff(expected_log_density(np.exp(log)), 2) <= 1e-12)


@pytest.mark.parametrize("slope", [-8.0, -4.0, -1.0, 0.0, 2.0])
def test_slopes_of_a_power_law_are_its_power(slope: float) -> None:
    np.testing.assert_allclose(SLOPES @ power_law(slope), np.full(N_KNOTS - 1, slope), atol=1e-9)


def cost(state: np.ndarray) -> float:
    return float(np.square(prior(state)[0]).sum())


def test_what_is_expected_is_the_likeliest() -> None:
    """And any change of one knot above the free part costs something, as does another corner."""
    state = expected_state()
    assert cost(state) == pytest.approx(0.0, abs=1e-18)
    for k in (*np.flatnonzero(KNOTS > 1.5 * FREE_BELOW), N_KNOTS):
        moved = state.copy()
        moved[k] += 0.1
        assert cost(moved) > 1e-3


@pytest.mark.parametrize("shift", [-0.7, -0.01, 0.02])
@pytest.mark.parametrize("is_corner_free", [True, False])
def test_the_jacobian_is_that_of_the_residuals(shift: float, is_corner_free: bool) -> None:
    state = np.append(np.random.default_rng(3).normal(size=N_KNOTS), shift)
    jacobian = prior(state, is_corner_free=is_corner_free)[1]
    for k in range(N_STATE):
        nudge = 1e-6 * np.eye(N_STATE)[k]
        after, before = (prior(state + h, is_corner_free=is_corner_free)[0] for h in (nudge, -nudge))
        np.testing.assert_allclose((after - before) / 2e-6, jacobian[:, k], atol=1e-6)


def test_a_driver_of_slower_corrections_costs_what_his_corner_does() -> None:
    """His own slopes cost nothing where the corner is free, and a lot where it is not."""
    shift = -0.4
    values = expected_log_density(KNOTS, shift)
    first = int(np.argmax(0.5 * (LOG[1:] + LOG[:-1]) > np.log(FREE_BELOW)))
    slope = (SLOPES @ values)[first]
    values[:first] = values[first] + slope * (LOG[:first] - LOG[first])
    state = np.append(values, shift)
    assert cost(state) == pytest.approx((shift / SLOWER_SD) ** 2)
    held = float(np.square(prior(state, is_corner_free=False)[0]).sum())
    assert held > 4.0 * cost(state)


def test_a_brisker_corner_is_hardly_allowed() -> None:
    state = expected_state()
    state[N_KNOTS] = 0.2
    assert cost(state) > (0.2 / BRISKER_SD) ** 2
    state[N_KNOTS] = -0.2
    assert cost(state) < 0.5 * (0.2 / BRISKER_SD) ** 2


def test_the_level_is_free() -> None:
    """How much somebody moves is no matter of the prior: adding a constant changes nothing."""
    state = np.append(np.random.default_rng(4).normal(size=N_KNOTS), -0.2)
    louder = state + 2.0 * (np.arange(N_STATE) < N_KNOTS)
    np.testing.assert_allclose(prior(louder)[0], prior(state)[0], atol=1e-9)


def test_one_slope_by_one_deviation_costs_one_and_its_two_bends() -> None:
    middle = np.exp(0.5 * (LOG[1:] + LOG[:-1]))
    k = int(np.flatnonzero(middle > FREE_BELOW)[3])
    moved = expected_state()
    moved[k + 1 : N_KNOTS] += SLOPE_SD * (LOG[k + 1] - LOG[k])  # only slope k is another
    assert cost(moved) == pytest.approx(1.0 + 2.0 * (SLOPE_SD / BEND_SD) ** 2)


# ---- between and beyond ----------------------------------------------------------------------------------------------
def test_between_knots_it_is_numpys_interpolation_and_outside_it_stays() -> None:
    rng = np.random.default_rng(1)
    knots, frequency = rng.normal(size=N_KNOTS), np.exp(rng.uniform(np.log(1e-4), np.log(20.0), 500))
    np.testing.assert_allclose(interpolation(frequency) @ knots, np.interp(np.log(frequency), LOG, knots), atol=1e-12)
    np.testing.assert_allclose(interpolation(frequency).sum(axis=1), 1.0)


def test_at_the_knots_it_is_their_own_value() -> None:
    np.testing.assert_allclose(interpolation(KNOTS), np.eye(N_KNOTS), atol=1e-12)


@pytest.mark.parametrize(("slope", "beyond"), [(-7.0, -7.0), (STEEPEST_KNOWN, STEEPEST_KNOWN), (-1.0, STEEPEST_KNOWN)])
def test_beyond_the_last_knot_it_goes_on_falling_at_least_as_an_acceleration_does(slope: float, beyond: float) -> None:
    knots = power_law(slope)
    last, twice = density(knots, np.array([KNOTS[-1], 2.0 * KNOTS[-1]]))
    assert np.log(twice / last) == pytest.approx(beyond * np.log(2.0))


def test_a_power_law_is_given_back_and_at_zero_it_is_that_of_the_first_knot() -> None:
    knots = power_law(-5.0)
    frequency = np.linspace(KNOTS[0], 6.0, 300)
    np.testing.assert_allclose(density(knots, frequency), np.exp(-3.0) * frequency**-5.0, rtol=1e-9)
    assert density(knots, np.array([0.0]))[0] == pytest.approx(np.exp(knots[0]))
