"""What measured and simulated offsets are described by, and what measured ones differ from themselves by."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from xosc_lateral.extras.loop.residual import (
    OSCILLATION,
    SPARE_ROWS,
    _mean_of_finite,
    expected,
    half_samples,
    size_of,
    statistics_of,
)
from xosc_lateral.extras.loop.significance import as_one_degree
from xosc_lateral.extras.loop.timeline import Timeline

STEP = 0.2
N = 12_000


def timeline(offset: np.ndarray, valid: np.ndarray | None = None) -> Timeline:
    n = len(offset)
    valid = np.ones(n, dtype=bool) if valid is None else valid
    zero = np.zeros(n, dtype=np.intp)
    return Timeline(("d",), zero, STEP * np.arange(n), offset, valid, np.full(n, 3.5), {}, frozenset())


EVERY = np.ones(N, dtype=bool)


# ---- the description -------------------------------------------------------------------------------------------------
def test_a_mean_that_follows_a_column_shows_in_its_bins_and_nowhere_else() -> None:
    column = np.repeat(np.random.default_rng(1).normal(size=20), N // 20)
    statistics = statistics_of(timeline(np.zeros(N)), {"x": column})
    found = statistics.describe(0.1 * column, EVERY)
    np.testing.assert_allclose(found["mean by x"], 0.1 * statistics.middles["x"], atol=0.01)
    assert len(found["mean by x"]) == len(statistics.middles["x"]) >= 4
    assert "mean by time" not in found  # where a car keeps over time is its base's business
    assert found["spread by x"].max() < 0.05


def test_a_spread_that_follows_a_column_shows_in_its_bins() -> None:
    rng = np.random.default_rng(2)
    column = np.repeat([0.0, 1.0] * 10, N // 20)
    statistics = statistics_of(timeline(np.zeros(N)), {"x": column})
    noise = rng.normal(size=N)
    found = statistics.describe(np.where(column > 0.5, 0.3, 0.1) * noise, EVERY)
    middles = statistics.middles["x"]
    assert found["spread by x"][np.argmax(middles)] / found["spread by x"][np.argmin(middles)] == pytest.approx(
        3.0, rel=0.15
    )


@pytest.mark.parametrize("amplitude", [0.05, 0.2])
@pytest.mark.parametrize("period", [8.0, 12.0, 30.0])
def test_an_oscillation_has_its_amplitude_whatever_its_phase(amplitude: float, period: float) -> None:
    time = STEP * np.arange(N)
    statistics = statistics_of(timeline(np.zeros(N)), {}, 1.0 / period)
    for phase in (0.0, 1.0, 2.5):
        wave = amplitude * np.sin(2.0 * np.pi * time / period + phase)
        assert statistics.describe(wave, EVERY)[OSCILLATION][0] == pytest.approx(amplitude, rel=0.02)


def test_bands_of_white_noise_are_those_of_differences_of_moving_averages() -> None:
    noise = np.random.default_rng(3).normal(size=N)
    found = statistics_of(timeline(np.zeros(N)), {}).describe(noise, EVERY)["movement by band"]
    # the finest: noise less its mean over m rows has the variance 1 - 1 / m
    assert 0.5 < found[0] < 1.0
    assert np.all(np.diff(found) < 0.0)
    assert found[-1] < 0.3


def test_rows_that_are_not_used_say_nothing() -> None:
    column = np.random.default_rng(4).normal(size=N).cumsum()
    offset = np.random.default_rng(5).normal(size=N)
    statistics = statistics_of(timeline(np.zeros(N)), {"x": column})
    used = np.arange(N) < N // 2
    changed = np.where(np.arange(N) < N // 2 + 400, offset, 99.0)
    np.testing.assert_array_equal(
        statistics.describe(offset, used)["mean by x"], statistics.describe(changed, used)["mean by x"]
    )


def test_bins_with_hardly_any_rows_are_left_out() -> None:
    column = np.repeat([0.0, 1.0, 2.0, 3.0, 4.0], N // 5)
    statistics = statistics_of(timeline(np.zeros(N)), {"x": column})
    used = EVERY.copy()
    used[SPARE_ROWS - 1 : N // 5] = False  # one row short in the first
    found = statistics.describe(np.ones(N), used)["mean by x"]
    assert np.isnan(found).sum() == 1
    np.testing.assert_allclose(found[np.isfinite(found)], 1.0)


def test_what_is_expected_is_the_mean_over_runs() -> None:
    runs = np.random.default_rng(6).normal(size=(3, N))
    statistics = statistics_of(timeline(np.zeros(N)), {"x": np.random.default_rng(7).normal(size=N)})
    several = [statistics.describe(run, EVERY)["spread by time"] for run in runs]
    np.testing.assert_allclose(expected(statistics, runs, EVERY)["spread by time"], np.mean(several, axis=0))


# ---- its floor -------------------------------------------------------------------------------------------------------
@pytest.mark.pages
def test_a_floor_is_the_standard_error_of_a_mean_over_independent_blocks() -> None:
    """Blocks of a minute with a level of their own: a bin over all of them is sure to sigma / sqrt(blocks)."""
    rng = np.random.default_rng(8)
    blocks = np.repeat(np.arange(40), N // 40)
    column = np.tile(np.repeat([0.0, 1.0], 150), 40)  # every block has its half in either bin
    sizes = []
    for _ in range(12):
        offset = np.repeat(0.2 * rng.normal(size=40), N // 40)
        statistics = statistics_of(timeline(offset), {"x": column})
        splits = half_samples(statistics, offset, blocks, rng)
        sizes.append(np.mean([np.mean(split["mean by x"] ** 2) for split in splits]))
    assert np.sqrt(np.mean(sizes)) == pytest.approx(0.2 / np.sqrt(40), rel=0.2)


def test_a_drive_that_is_the_same_everywhere_differs_from_itself_by_nothing() -> None:
    blocks = np.repeat(np.arange(40), N // 40)
    statistics = statistics_of(timeline(np.ones(N)), {"x": np.tile(np.repeat([0.0, 1.0], 150), 40)})
    halves = half_samples(statistics, np.ones(N), blocks, np.random.default_rng(1))
    assert max(size_of(half) for half in halves) == pytest.approx(0.0, abs=1e-12)


def test_every_group_counts_the_same_however_many_bins_it_has() -> None:
    nan = float("nan")
    differences = {"a": np.array([1.0, 1.0, 1.0, 1.0, nan]), "b": np.array([3.0]), "c": np.array([nan])}
    assert size_of(differences) == pytest.approx(np.sqrt((1.0 + 9.0) / 2.0))
    assert size_of({"c": np.array([nan])}) == 0.0


def test_a_mean_is_of_what_there_is() -> None:
    np.testing.assert_array_equal(
        _mean_of_finite(np.array([[1.0, np.nan, np.nan], [3.0, 5.0, np.nan]])), [2.0, 5.0, np.nan]
    )


# ---- low frequencies -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("degrees", [1, 2, 8])
def test_a_score_of_several_degrees_becomes_one_of_one_degree_as_rare(degrees: int) -> None:
    for p_value in (0.5, 1e-2, 1e-8):
        score = float(chi2.isf(p_value, degrees))
        assert chi2.sf(as_one_degree(score, degrees), 1) == pytest.approx(p_value, rel=1e-6)
