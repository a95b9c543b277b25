"""Drift and step of the mean, scored at low frequencies beside the wander that a drive has anyway."""

from __future__ import annotations

import numpy as np
import pytest

from tests.identification.made_coarse import coarse_of, movement
from xosc_lateral.identification.low_frequency import (
    EDGE_S,
    STEP_GRID_S,
    _levels,
    _OrdinaryDrift,
    _resigned,
    _steps,
    find_low_frequency,
)
from xosc_lateral.identification.regression import Coarse, Fitted, fit_model

SECONDS = 1800.0
N = round(SECONDS / 0.2)
AT = 900.0


def drive(step: float, seed: int) -> Coarse:
    jump = step * (np.arange(N) * 0.2 >= AT)
    return coarse_of(jump + movement(np.random.default_rng(seed), SECONDS))


@pytest.fixture(scope="module")
def jumped() -> tuple[Coarse, Fitted]:
    coarse = drive(0.2, 131)
    return coarse, fit_model(coarse, ())


def test_a_step_of_20_centimetres_is_told_from_a_drift_sure_and_dated(jumped: tuple[Coarse, Fitted]) -> None:
    found = find_low_frequency(*jumped, np.random.default_rng(1))
    assert found is not None
    assert found.is_step
    assert found.p_value < 0.002
    assert found.at == pytest.approx(AT, abs=5.0)


def test_a_mean_that_stays_is_no_step(jumped: tuple[Coarse, Fitted]) -> None:
    coarse = drive(0.0, 132)
    found = find_low_frequency(coarse, fit_model(coarse, ()), np.random.default_rng(1))
    assert found is not None
    assert found.p_value > 0.01


def test_drives_of_minutes_say_nothing() -> None:
    coarse = coarse_of(movement(np.random.default_rng(133), 400.0))
    assert find_low_frequency(coarse, fit_model(coarse, ()), np.random.default_rng(1)) is None


def test_steps_are_tried_every_quarter_of_a_minute_away_from_the_ends(jumped: tuple[Coarse, Fitted]) -> None:
    coarse, fitted = jumped
    jumps, moments = _steps(coarse, fitted.whitener)
    first, last = np.flatnonzero(coarse.valid)[[0, -1]]
    assert moments[0] == first + EDGE_S - 1
    assert last - moments[-1] >= EDGE_S
    assert (np.diff(moments) == STEP_GRID_S).all()
    assert jumps.shape == (len(coarse), len(moments))


def test_several_drives_have_no_common_step() -> None:
    coarse = coarse_of(movement(np.random.default_rng(134), SECONDS), drives=2)
    jumps, moments = _steps(coarse, fit_model(coarse, ()).whitener)
    assert jumps.shape == (len(coarse), 0)
    assert len(moments) == 0


def test_signs_of_whole_minutes_change_nothing_within_them(jumped: tuple[Coarse, Fitted]) -> None:
    coarse, fitted = jumped
    null = _resigned(fitted.rows, fitted.whitener, np.random.default_rng(2))
    one = next(null)
    inside = coarse.valid
    assert np.std(one[inside]) == pytest.approx(np.std(fitted.rows[inside]), rel=0.02)
    same = np.sign(one[inside] * fitted.rows[inside])
    assert 0.2 < np.mean(same > 0.0) < 0.8
    flips = np.abs(np.diff(same)) > 1.0
    assert flips.mean() < 3.0 / 60.0


def test_ordinary_wanders_are_one_without_any_and_add_most_at_the_slowest() -> None:
    levels = _levels(600)
    np.testing.assert_array_equal(levels[0], np.ones(301))
    assert (np.diff(levels[-1]) <= 0.0).all()
    assert levels.min() == 1.0


def test_white_rows_have_hardly_any_ordinary_wander_and_slow_ones_have() -> None:
    rng = np.random.default_rng(3)
    white = rng.normal(size=1800)
    slow = white + 0.5 * np.convolve(rng.normal(size=1899), np.exp(-np.arange(100) / 40.0), "valid")
    told = [_OrdinaryDrift.of(rows).typical()[2:10].mean() for rows in (white, slow)]
    assert told[0] < 2.5
    assert told[1] > 2.0 * told[0]


def test_likelihoods_of_wanders_are_shares() -> None:
    share = _OrdinaryDrift.of(np.random.default_rng(4).normal(size=900)).share
    assert share.sum() == pytest.approx(1.0)
    assert share.min() >= 0.0
