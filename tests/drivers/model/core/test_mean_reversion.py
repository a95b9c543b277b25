"""A series read off at a changing rate, against scipy's Hermite splines and exact cases."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from xosc_lateral.drivers.model.core.base import ClockState, take_at_rate

FloatArray = NDArray[np.float64]


def source_of(values: FloatArray) -> Callable[[int], FloatArray]:
    """Hands an array of shape (n, drivers) out piece by piece, as a core model does."""
    given_out = 0

    def source(n: int) -> FloatArray:
        nonlocal given_out
        given_out += n
        assert given_out <= len(values), "more was asked for than there is"
        return values[given_out - n : given_out]

    return source


def noise(n: int, drivers: int = 1, seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).normal(size=(n, drivers))


def test_without_a_rate_the_source_is_handed_through() -> None:
    values = noise(50, 3)
    np.testing.assert_array_equal(take_at_rate(ClockState(), source_of(values), 50, None), values)


@pytest.mark.parametrize("rate", [1, 2, 3])
def test_whole_rates_take_every_so_manieth_value(rate: int) -> None:
    values = noise(100, 2)
    read = take_at_rate(ClockState(), source_of(values), 30, np.full(30, float(rate)))
    np.testing.assert_array_equal(read, values[: 30 * rate : rate])


def test_between_the_values_lie_hermite_cubics_with_central_slopes() -> None:
    values = noise(60)
    read = take_at_rate(ClockState(), source_of(values), 150, np.full(150, 0.35))
    slopes = 0.5 * (values[2:, 0] - values[:-2, 0])
    spline = CubicHermiteSpline(np.arange(1, 59), values[1:-1, 0], slopes)
    times = 0.35 * np.arange(150)
    inside = times >= 1.0  # before the first value there is none
    np.testing.assert_allclose(read[inside, 0], spline(times[inside]), atol=1e-12)


def test_a_parabola_stays_one() -> None:
    values = (np.arange(40.0) ** 2)[:, None]
    read = take_at_rate(ClockState(), source_of(values), 40, np.full(40, 0.7))[:, 0]
    times = np.cumsum(np.full(40, 0.7)) - 0.7
    np.testing.assert_allclose(read[times >= 1.0], times[times >= 1.0] ** 2, atol=1e-9)


@given(st.lists(st.floats(0.05, 4.0), min_size=2, max_size=40), st.integers(1, 39))
def test_pieces_are_the_whole_bit_by_bit(rates: list[float], cut: int) -> None:
    values, rate = noise(200, 2, seed=3), np.array(rates)
    cut = min(cut, len(rate))
    whole = take_at_rate(ClockState(), source_of(values), len(rate), rate)
    state, source = ClockState(), source_of(values)
    first = take_at_rate(state, source, cut, rate[:cut])
    second = take_at_rate(state, source, len(rate) - cut, rate[cut:])
    np.testing.assert_array_equal(np.concatenate([first, second]), whole)


def test_a_state_holds_no_more_than_it_needs() -> None:
    state, source = ClockState(), source_of(noise(3000))
    for _ in range(100):
        take_at_rate(state, source, 10, np.full(10, 1.7))
        assert state.held is not None
        assert len(state.held) <= 6


def test_twice_the_rate_halves_the_time_that_a_movement_is_remembered() -> None:
    rng, keep = np.random.default_rng(5), 0.98
    values = np.zeros((40_000, 1))
    for k in range(1, len(values)):
        values[k] = keep * values[k - 1] + rng.normal()
    slow = take_at_rate(ClockState(), source_of(values), 30_000, np.full(30_000, 0.5))[:, 0]
    fast = take_at_rate(ClockState(), source_of(values), 19_000, np.full(19_000, 2.0))[:, 0]
    assert np.corrcoef(slow[20:], slow[:-20])[0, 1] == pytest.approx(keep**10, abs=0.06)
    assert np.corrcoef(fast[20:], fast[:-20])[0, 1] == pytest.approx(keep**40, abs=0.06)


@pytest.mark.parametrize("rate", [[0.0, 1.0], [1.0, -1.0], [1.0, np.nan], [1.0, np.inf], [1.0]])
def test_rates_that_stop_or_turn_the_time_are_refused(rate: list[float]) -> None:
    with pytest.raises(ValueError, match="rate: expected 2 finite values > 0"):
        take_at_rate(ClockState(), source_of(noise(10)), 2, np.array(rate))
