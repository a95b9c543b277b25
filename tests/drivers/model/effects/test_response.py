"""The driver's response against numpy's interpolation and scipy's filter, which it does without."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.kit.profiles import whole_terms
from xosc_lateral.drivers.model.effects import Drift
from xosc_lateral.drivers.model.effects.response import Response, respond, split_shift
from xosc_lateral.drivers.model.linear_filters import WORTH_IMPORTING

STEP = 0.2
LAGS = (0.0, 1.0, -1.0, 0.6, 0.53, -0.71, 0.05, -0.05, 1e-12, -1e-12, 9.9, -9.9, 10.0, -10.0, 55.5, -55.5)


def quantity(n: int, *components: int) -> np.ndarray:
    return np.random.default_rng(n).normal(size=(n, *components)).cumsum(axis=0)


@pytest.mark.parametrize("lag_s", LAGS)
@pytest.mark.parametrize("n", [1, 2, 3, 50, 51])
def test_a_delay_is_numpys_linear_interpolation_that_holds_the_borders(lag_s: float, n: int) -> None:
    values = quantity(n)
    expected = np.interp(np.arange(n) - lag_s / STEP, np.arange(n), values)
    np.testing.assert_allclose(respond(values, STEP, lag_s, 0.0), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("response_s", [0.01, 0.7, 60.0])
@pytest.mark.parametrize("n", [1, 2, 500, WORTH_IMPORTING + 1])
def test_a_lag_is_scipys_filter_started_settled(response_s: float, n: int) -> None:
    values, keep = quantity(n), np.exp(-STEP / response_s)
    expected, _ = lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])
    np.testing.assert_allclose(respond(values, STEP, 0.0, response_s), expected, rtol=0, atol=1e-12)


def test_lags_in_a_row_are_one_after_the_other_also_block_by_block() -> None:
    values = quantity(300, 2)
    whole = respond(values, STEP, -0.53, 1.0, order=3)
    once = respond(values, STEP, -0.53, 1.0)
    np.testing.assert_allclose(whole, respond(respond(once, STEP, 0.0, 1.0), STEP, 0.0, 1.0), rtol=0, atol=1e-12)
    blocks = Response(STEP, -0.53, 1.0, order=3)
    parts = [blocks.take(values[:1]), *(blocks.take(values[k : k + 1]) for k in range(1, 90)), blocks.take(values[90:])]
    np.testing.assert_array_equal(np.concatenate([*parts, blocks.finish(values[:0])]), whole)


def test_after_two_lags_a_jump_is_a_bend_and_after_one_a_kink() -> None:
    jump = (np.arange(100) >= 50).astype(float)
    once, twice = (np.diff(respond(jump, STEP, 0.0, 1.0, order=order)) for order in (1, 2))
    assert np.abs(np.diff(once)).max() > 0.9 * once.max()
    assert np.abs(np.diff(twice)).max() < 0.6 * twice.max()


def test_every_component_is_responseed_by_itself() -> None:
    values = quantity(300, 3)
    apart = [respond(column, STEP, 0.53, 2.0) for column in values.T]
    np.testing.assert_array_equal(respond(values, STEP, 0.53, 2.0), np.stack(apart, axis=1))


def test_the_quantity_itself_is_left_as_it_was() -> None:
    for lag_s in (0.0, 0.4, -0.3):
        values = quantity(40, 1)
        kept = values.copy()
        respond(values, STEP, lag_s, 1.0)[:] = 0.0
        np.testing.assert_array_equal(values, kept)


def test_nothing_is_responseed_with_nothing() -> None:
    assert respond(np.empty((0, 2)), STEP, 0.3, 1.0).shape == (0, 2)


@pytest.mark.parametrize("steps", [0.0, 5.0, -5.0, 2.25, -2.25, 1e-17, -1e-17])
def test_a_shift_is_split_into_whole_steps_and_a_share(steps: float) -> None:
    whole, share = split_shift(steps)
    assert 0.0 <= share <= 1.0
    assert whole + share == pytest.approx(-steps, abs=1e-15)


def test_a_drift_is_scipys_filter_of_its_noise() -> None:
    n, effect = 2000, Drift(size=0.3, correlation_s=40.0)
    keep = np.exp(-STEP / 40.0)
    noise = np.random.default_rng(5).normal(size=n) * 0.3 * np.sqrt(1.0 - keep**2)
    noise[0] = np.random.default_rng(5).normal() * 0.3
    drift = whole_terms(effect, STEP * np.arange(n), {}, np.random.default_rng(5)).location
    np.testing.assert_allclose(drift, lfilter([1.0], [1.0, -keep], noise), rtol=0, atol=1e-12)


def test_effects_of_a_scenario_of_minutes_import_no_scipy() -> None:
    code = (
        "import sys, numpy as np\n"
        "from xosc_lateral.drivers.model.effects import Drift\n"
        "from xosc_lateral.drivers.model.effects.response import respond\n"
        "respond(np.ones(900), 0.2, 0.5, 2.0)\n"
        "drift = Drift(size=0.1)\n"
        "drift.advance(drift.begin(np.random.default_rng(1), 0.2), 0.2 * np.arange(900), 0.2)\n"
        "assert 'scipy' not in sys.modules and 'numba' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
