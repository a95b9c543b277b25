"""Whittle's likelihood of driver plus sensor: its gradient, and what it says where nothing is random."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import approx_fprime

from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.fitting.sensor.likelihood import (
    KNOTS,
    N_KNOTS,
    Colour,
    Known,
    SensorData,
    _Problem,
    density,
    interpolation,
    solve,
)
from xosc_lateral.drivers.fitting.sensor.periodogram import Periodogram, periodogram, windows_of

WHITE, COLOURED, CORNER = 2e-5, 4e-4, 0.8


def driver_density(frequency: np.ndarray) -> np.ndarray:
    """Flat below 0.03 Hz, falling with the fourth power beyond 0.15 Hz. [m2/Hz]"""
    return 0.3 / ((1.0 + (frequency / 0.03) ** 2) * (1.0 + (frequency / 0.15) ** 4))


def measured(colour: Colour | None = None, weight: float = 200.0) -> Periodogram:
    """What is expected of a periodogram, without chance."""
    frequency = np.geomspace(0.02, 1.5, 90)
    density = driver_density(frequency) + WHITE
    if colour is not None:
        density = density + COLOURED * colour.shape(frequency)
    return Periodogram(frequency, density, np.full(90, weight))


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("corner", [0.3, 2.0])
def test_the_integral_is_that_of_the_shape(order: int, corner: float) -> None:
    colour = Colour(order, corner)
    expected = quad(lambda f: float(colour.shape(np.array(f))), 0.0, np.inf)[0]
    assert colour.integral(np.inf) == pytest.approx(expected, rel=1e-6)
    assert colour.shape(np.array([0.0, corner])) == pytest.approx([1.0, 0.5])


@pytest.mark.parametrize("colour", [Colour(), Colour(2, CORNER)])
def test_gradient_and_information_are_those_of_the_loss(colour: Colour) -> None:
    data = measured(colour if colour.order else None)
    problem = _Problem(SensorData(data, np.zeros(90)), colour)
    point = problem.start() + 0.1 * np.random.default_rng(1).normal(size=problem.size)
    loss, gradient, information = problem.at(point)
    numeric = approx_fprime(point, lambda p: problem.at(p)[0], 1e-6)
    np.testing.assert_allclose(gradient, numeric, rtol=2e-3, atol=2e-3 * np.abs(gradient).max())
    assert np.isfinite(loss)
    assert np.linalg.eigvalsh(information).min() > 0.0


def test_a_driver_and_a_white_floor_come_apart() -> None:
    data = measured()
    found = solve(SensorData(data, np.zeros(90)), Colour())
    assert np.exp(found.white) == pytest.approx(WHITE, rel=0.1)
    assert found.colour == -np.inf
    slow = data.frequency < 0.3
    fitted = np.exp(interpolation(data.frequency) @ found.knots)
    np.testing.assert_allclose(fitted[slow], driver_density(data.frequency)[slow], rtol=0.15)
    assert len(found.knots) == len(KNOTS) == N_KNOTS


def test_of_an_error_that_is_known_rounding_has_its_part() -> None:
    """Where nobody could tell them apart by their spectra: both are white, and as large as one another."""
    data, rate = measured(weight=20.0), 20.0
    noise, level = 0.5 * WHITE * 0.5 * rate, np.full(90, 0.5 * WHITE)
    known = Known(float(np.sqrt(2.0 * noise)), rate, rounding=noise)
    found = solve(SensorData(data, level, known), Colour())
    assert np.exp(found.white) == pytest.approx(0.5 * WHITE, rel=0.02)
    counted_twice = solve(SensorData(data, level, Known(known.deviation, rate)), Colour())
    assert np.exp(counted_twice.white) > 0.7 * WHITE


def test_a_coloured_part_comes_apart_too() -> None:
    colour = Colour(2, CORNER)
    found = solve(SensorData(measured(colour, weight=2000.0), np.zeros(90)), colour)
    assert np.exp(found.colour) == pytest.approx(COLOURED, rel=0.3)


@pytest.mark.parametrize("corner", [0.15, 0.2, 0.27])
def test_how_a_driver_goes_on_below_the_noise_is_told_by_where_his_spectrum_turns(corner: float) -> None:
    """Noise hides him from his corner on, and beyond it is most of his acceleration."""
    frequency = np.geomspace(0.02, 1.5, 90)

    def true(at: np.ndarray) -> np.ndarray:
        shape = 1.0 / (at * (1.0 + (at / corner) ** 5) * (1.0 + at**2) ** 1.5)
        return shape * corner * WHITE  # half the noise's at the corner

    data = Periodogram(frequency, true(frequency) + WHITE, np.full(90, 400.0))
    found = solve(SensorData(data, np.zeros(90)), Colour())
    fine = np.linspace(0.02, 2.5, 2000)
    accelerations = [float((fine**4 * one).sum()) for one in (density(found.knots, fine), true(fine))]
    assert np.sqrt(accelerations[0] / accelerations[1]) == pytest.approx(1.0, abs=0.15)


def test_beside_a_low_passed_error_the_corner_is_not_looked_for() -> None:
    colour = Colour(2, CORNER)
    found = solve(SensorData(measured(colour, weight=2000.0), np.zeros(90)), colour)
    assert found.state[N_KNOTS] == pytest.approx(0.0, abs=1e-6)


def test_a_floor_that_is_known_already_is_not_found_again() -> None:
    data = measured()
    found = solve(SensorData(data, np.full(90, 0.9 * WHITE)), Colour())
    assert np.exp(found.white) < 0.3 * WHITE


def test_a_noise_level_that_is_known_is_kept_to() -> None:
    rate, deviation = 25.0, 0.02  # five times what the floor alone would be
    found = solve(SensorData(measured(weight=5.0), np.zeros(90), Known(deviation, rate)), Colour())
    free = solve(SensorData(measured(weight=5.0), np.zeros(90)), Colour())
    assert np.exp(found.white) * 0.5 * rate == pytest.approx(deviation**2, rel=0.2)
    assert found.white > free.white


def test_going_on_from_a_solution_finds_it_again() -> None:
    data = measured()
    first = solve(SensorData(data, np.zeros(90)), Colour())
    again = solve(SensorData(data, np.zeros(90)), Colour(), start=first)
    assert again.loss == pytest.approx(first.loss, abs=1e-2)
    assert again.white == pytest.approx(first.white, abs=0.01)


# ---- periodograms ----------------------------------------------------------------------------------------------------
def test_the_density_of_runs_integrates_to_their_variance() -> None:
    rng = np.random.default_rng(2)
    runs = [rng.normal(size=4000) * 0.1 for _ in range(5)]
    frequency, windows = windows_of(runs, 0.2)
    assert float(np.trapezoid(windows.mean(axis=0), frequency)) == pytest.approx(0.01, rel=0.03)


def test_bins_keep_the_power_and_weigh_what_they_hold() -> None:
    rng = np.random.default_rng(3)
    frequency, windows = windows_of([rng.normal(size=20_000)], 0.2)
    binned = periodogram(frequency, windows)
    inside = (frequency > 1.5 * frequency[1]) & (frequency <= 1.5)
    assert binned.count == pytest.approx((0.53 * len(windows) + 0.5) * inside.sum())
    assert np.average(binned.density, weights=binned.weight) == pytest.approx(windows[:, inside].mean(), rel=1e-9)
    assert np.all(np.diff(binned.frequency) > 0.0)
    # a mean of `weight` independent exponential variables: its relative variance is 1 / weight
    scaled = (binned.density / 0.4 - 1.0) * np.sqrt(binned.weight)  # white noise of variance 1 at 5 Hz: 2 * 0.2
    assert np.std(scaled) == pytest.approx(1.0, abs=0.35)


def test_runs_that_hold_no_window_are_refused_with_their_length() -> None:
    with pytest.raises(NotEnoughDataError, match=r"no run of 12\.8 s; the longest lasts 10 s"):
        windows_of([np.zeros(50), np.zeros(20)], 0.2)
    with pytest.raises(NotEnoughDataError, match="the longest lasts 0 s"):
        windows_of([], 0.2)
