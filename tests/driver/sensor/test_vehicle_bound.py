"""The prior on a driver's spectrum: its slopes, its knots, and what lies between and beyond them."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.driver.sensor.vehicle_bound import (
    BEND_SD,
    CORRECTIONS,
    FREE_BELOW,
    KNOTS,
    LAGS,
    N_KNOTS,
    PRIOR_ROWS,
    PRIOR_VALUES,
    SLOPE_SD,
    SLOPES,
    STEEPEST_KNOWN,
    density,
    expected_slope,
    interpolation,
)

LOG = np.log(KNOTS)


def power_law(slope: float) -> np.ndarray:
    """Log densities at the knots of a density that falls by one power throughout."""
    return slope * LOG - 3.0


# ---- knots -----------------------------------------------------------------------------------------------------------
def test_knots_rise_from_a_minute_and_more_to_what_no_steering_does() -> None:
    assert np.all(np.diff(KNOTS) > 0.0)
    assert 1.0 / KNOTS[0] >= 60.0  # slower than the minute within which a lane is kept
    assert KNOTS[-1] > LAGS  # beyond the corner of muscles and vehicle


def test_knots_are_close_enough_for_the_bends_between_the_corners() -> None:
    """A polygon through the knots is nowhere a decibel off the density with the prior's slope at every frequency."""
    fine = np.exp(np.linspace(np.log(FREE_BELOW), LOG[-1], 4001))
    slope = expected_slope(fine)
    exact = np.concatenate([[0.0], np.cumsum(0.5 * (slope[1:] + slope[:-1]) * np.diff(np.log(fine)))])
    inside = KNOTS >= FREE_BELOW - 1e-12
    polygon = np.interp(np.log(fine), LOG[inside], np.interp(LOG[inside], np.log(fine), exact))
    assert 10.0 / np.log(10.0) * np.abs(polygon - exact).max() < 1.0


def test_corners_of_the_prior_lie_between_knots_of_either_side() -> None:
    for corner in (FREE_BELOW, CORRECTIONS, LAGS):
        assert np.count_nonzero(corner - 1e-12 > KNOTS) >= 3
        assert np.count_nonzero(corner + 1e-12 < KNOTS) >= 2


# ---- slopes ----------------------------------------------------------------------------------------------------------
def test_the_slope_is_that_of_keeping_a_lane_below_and_of_two_integrations_and_more_above() -> None:
    assert expected_slope(np.array([FREE_BELOW]))[0] == pytest.approx(-1.0)
    assert expected_slope(np.array([CORRECTIONS * (1.0 - 1e-9)]))[0] == pytest.approx(-3.5, abs=1e-6)
    assert expected_slope(np.array([LAGS]))[0] == pytest.approx(-5.5 - 1.5)
    assert expected_slope(np.array([1e3]))[0] == pytest.approx(-8.5, abs=1e-5)  # -4 - 1.5 - 3


def test_it_only_ever_falls_faster() -> None:
    assert np.all(np.diff(expected_slope(np.linspace(FREE_BELOW, 5.0, 2000))) <= 1e-12)


@pytest.mark.parametrize("slope", [-8.0, -4.0, -1.0, 0.0, 2.0])
def test_slopes_of_a_power_law_are_its_power(slope: float) -> None:
    np.testing.assert_allclose(SLOPES @ power_law(slope), np.full(N_KNOTS - 1, slope), atol=1e-9)


def test_what_has_the_expected_slopes_is_the_likeliest() -> None:
    """Slopes of its own as the prior's, and any change of one knot above the free part costs something."""
    middle = np.exp(0.5 * (LOG[1:] + LOG[:-1]))
    slopes = np.where(middle > FREE_BELOW, expected_slope(np.maximum(middle, FREE_BELOW)), 0.0)
    free = middle <= FREE_BELOW
    slopes[free] = slopes[~free][0]  # straight on, so that it bends nowhere there
    knots = np.concatenate([[0.0], np.cumsum(slopes * np.diff(LOG))])
    cost = np.square(PRIOR_ROWS @ knots - PRIOR_VALUES).sum()
    assert cost == pytest.approx(0.0, abs=1e-18)
    for k in np.flatnonzero(KNOTS > 1.5 * FREE_BELOW):
        moved = knots.copy()
        moved[k] += 0.1
        assert np.square(PRIOR_ROWS @ moved - PRIOR_VALUES).sum() > 1e-3


def test_the_level_is_free() -> None:
    """How much somebody moves is no matter of the prior: adding a constant costs nothing."""
    np.testing.assert_allclose(PRIOR_ROWS @ np.ones(N_KNOTS), 0.0, atol=1e-9)


def test_one_slope_by_one_deviation_costs_one_and_its_two_bends() -> None:
    middle = np.exp(0.5 * (LOG[1:] + LOG[:-1]))
    k = int(np.flatnonzero(middle > FREE_BELOW)[3])
    moved = np.zeros(N_KNOTS)
    moved[k + 1 :] = SLOPE_SD * (LOG[k + 1] - LOG[k])  # only slope k is another
    expected = 1.0 + 2.0 * (SLOPE_SD / BEND_SD) ** 2
    assert np.square(PRIOR_ROWS @ moved).sum() == pytest.approx(expected)


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
