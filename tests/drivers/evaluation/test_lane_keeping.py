from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from xosc_lateral.drivers.evaluation.lane_keeping import (
    INDICATORS,
    LONGEST_TLC,
    lane_keeping,
    lane_keeping_indicators,
    time_to_line_crossing,
)
from xosc_lateral.drivers.evaluation.realism import variance_parts

STEP = 0.2


def _column(values: np.ndarray, name: str) -> np.ndarray:
    return values[:, INDICATORS.index(name)]


def test_time_to_line_crossing_is_room_over_lateral_speed() -> None:
    offset = 0.1 * STEP * np.arange(11)[None]  # 0.1 m/s to the left
    time = time_to_line_crossing(offset, np.full((1, 11), 3.8), STEP)
    room = 1.9 - 0.9 - offset[0, 1:]
    np.testing.assert_allclose(time[0], room / 0.1)
    np.testing.assert_allclose(time_to_line_crossing(-offset, np.full((1, 11), 3.8), STEP), time)


def test_a_parked_offset_never_crosses_and_one_beyond_the_marking_has() -> None:
    still = np.full((1, 5), 0.4)
    assert (time_to_line_crossing(still, np.full((1, 5), 3.6), STEP) == LONGEST_TLC).all()
    beyond = np.array([[1.0, 1.1, 1.2]])
    assert (time_to_line_crossing(beyond, np.full((1, 3), 3.6), STEP) == 0.0).all()


def test_indicators_of_a_sine_have_their_closed_form() -> None:
    amplitude, omega = 0.5, 2 * np.pi / 8.0
    time = STEP * np.arange(4001)  # 100 periods
    offset = amplitude * np.sin(omega * time)[None]
    values = lane_keeping_indicators(offset, np.full_like(offset, 3.6), STEP)
    assert _column(values, "sdlp")[0] == pytest.approx(amplitude / np.sqrt(2), rel=1e-3)
    # Differences of a sine: the derivative's amplitude times sinc(omega step / 2) for each order.
    shrink = np.sin(omega * STEP / 2) / (omega * STEP / 2)
    assert _column(values, "lateral_acceleration")[0] == pytest.approx(
        amplitude * omega**2 * shrink**2 / np.sqrt(2), rel=1e-3
    )
    assert _column(values, "lateral_jerk")[0] == pytest.approx(amplitude * omega**3 * shrink**3 / np.sqrt(2), rel=1e-3)
    beyond = 1 - 2 * np.arcsin(0.375 / amplitude) / np.pi  # share of a sine beyond a level
    assert _column(values, "beyond_wandering_zone")[0] == pytest.approx(beyond, abs=0.02)


def test_variance_parts_are_recovered_from_planted_ones() -> None:
    rng = np.random.default_rng(5)
    drivers = np.repeat(np.arange(400), rng.integers(1, 9, 400))
    own = 0.25 * rng.standard_normal(400)
    means = own[drivers] + 0.15 * rng.standard_normal(len(drivers))
    windows = means[:, None] + 0.1 * rng.standard_normal((len(drivers), 51))
    found = variance_parts(windows, drivers)
    assert found.between == pytest.approx(0.25**2, rel=0.2)  # standard error of a variance of 400: 7 %
    assert found.within == pytest.approx(0.15**2 + 0.1**2 / 51, rel=0.1)
    assert found.inside == pytest.approx(0.1**2 * 50 / 51, rel=0.02)


def test_figures_of_an_hour_are_those_of_a_known_process() -> None:
    """An autoregression of order one: variance, squared difference and correlation are known."""
    rng, step, memory, size = np.random.default_rng(3), 0.2, 5.0, 0.2
    keep = np.exp(-step / memory)
    drives = np.empty((20, 18_000))
    drives[:, 0] = size * rng.standard_normal(20)
    for k in range(1, drives.shape[1]):
        drives[:, k] = keep * drives[:, k - 1] + np.sqrt(1 - keep**2) * size * rng.standard_normal(20)
    found = lane_keeping(0.3 + drives, 3.5, step, recorded=(20 * 3600.0, 20))
    assert abs(found.sdlp - size) < 4.0 * found.errors["sdlp"] < 0.006
    assert found.mean == pytest.approx(0.3, abs=4.0 * found.errors["mean"])
    assert found.restlessness == pytest.approx(size * np.sqrt(2.0 * (1.0 - keep)) / step, rel=0.01)
    assert found.memory == pytest.approx(memory, rel=0.05)
    assert found.limit_near_line == pytest.approx(1.75 - 0.9 - 0.2)
    assert found.near_line == pytest.approx(0.0401, rel=0.1)  # normal: above 0.65 m at 0.3 +- 0.2 m
    assert found.drifts == 0.0


def test_errors_are_those_of_as_much_driving_as_was_recorded() -> None:
    """An autoregression: the variance of a mean over T is 2 size^2 memory / T, of a variance 2 size^4 memory / T."""
    rng, step, memory, size, seconds = np.random.default_rng(4), 0.2, 3.0, 0.2, 180.0
    keep = np.exp(-step / memory)
    noise = np.sqrt(1 - keep**2) * size * rng.standard_normal((60, 18_000))
    noise[:, 0] = size * rng.standard_normal(60)
    drives = lfilter([1.0], [1.0, -keep], noise, axis=1)
    once, four = (lane_keeping(drives, 3.5, step, recorded=(n * seconds, n)).errors for n in (1, 4))
    assert once["mean"] == pytest.approx(size * np.sqrt(2 * memory / seconds), rel=0.3)  # 60 drives: 9 % of an error
    assert once["sdlp"] == pytest.approx(size * np.sqrt(0.5 * memory / seconds), rel=0.35)
    assert four["mean"] == pytest.approx(0.5 * once["mean"])
    assert lane_keeping(drives, 3.5, step).errors == {}


def test_a_lane_drift_is_a_metre_for_eight_seconds_on_one_side() -> None:
    drive = np.zeros((1, 18_000))
    drive[0, 1000:1040] = 1.2  # 8 s
    drive[0, 3000:3030] = 1.2  # 6 s
    drive[0, 5000:5025], drive[0, 5025:5050] = 1.2, -1.2
    assert lane_keeping(drive, 3.5, 0.2).drifts == pytest.approx(1.0)
