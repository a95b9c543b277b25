"""Drives of the autoregressive model: where they begin, and how they bend before the limits."""

from __future__ import annotations

import json

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.core_models import POPULATION, STEADY
from xosc_lateral.drivers.model.core.autoregressive.model import HEADROOM, KNEE_SHARE, AutoregressiveState, _bends
from xosc_lateral.drivers.model.core.autoregressive.parameters import Autoregression
from xosc_lateral.drivers.model.core.base import Start
from xosc_lateral.drivers.model.records import plain, read_as

WILD = replace(STEADY, coarse=Autoregression(STEADY.coarse.coefficients, 0.3))
"""Would leave the road without limits."""


def seed(number: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(number)


def test_bends_begin_at_a_share_of_the_way_to_either_limit() -> None:
    knees, limits = _bends(STEADY, np.array([STEADY.mean]))
    np.testing.assert_allclose(limits[:, 0], STEADY.limits)
    np.testing.assert_allclose(knees[:, 0], STEADY.mean + KNEE_SHARE * (np.array(STEADY.limits) - STEADY.mean))


@pytest.mark.parametrize(("first", "side"), [(0.39, 1), (0.55, 1), (-0.44, 0), (-0.7, 0)])
def test_who_starts_far_out_has_the_knee_there_and_room_beyond(first: float, side: int) -> None:
    knees, limits = _bends(STEADY, np.array([first]))
    assert knees[side, 0] == first
    sign = 1.0 if side else -1.0
    assert sign * limits[side, 0] >= sign * first + HEADROOM - 1e-15
    other = _bends(STEADY, np.array([STEADY.mean]))
    np.testing.assert_array_equal(knees[1 - side], other[0][1 - side])


def test_coarse_movement_never_passes_the_limits_and_reaches_far() -> None:
    coarse, _ = WILD.stream(seed(1)).take(5000)
    low, high = WILD.limits
    assert low <= coarse.min() < 0.95 * low  # the hyperbolic tangent is 1 to rounding far out
    assert 0.95 * high < coarse.max() <= high


def test_between_the_knees_nothing_is_bent() -> None:
    """A model with limits far away moves the same as long as it stays inside."""
    free = replace(STEADY, limits=(-1.0, 1.0))
    bent, straight = STEADY.stream(seed(2)).take(3000)[0], free.stream(seed(2)).take(3000)[0]
    knees = _bends(STEADY, np.array([STEADY.mean]))[0][:, 0]
    inside = (straight > knees[0]) & (straight < knees[1])
    assert inside.mean() > 0.9
    np.testing.assert_array_equal(bent[inside], straight[inside])


def test_bending_keeps_the_order() -> None:
    free = replace(WILD, limits=(-1.0, 1.0))
    bent, straight = WILD.stream(seed(3)).take(400)[0], free.stream(seed(3)).take(400)[0]
    calm = np.abs(straight) < 0.75  # where the far limits don't bend either
    order = np.argsort(straight[calm])
    assert (np.diff(bent[calm][order]) >= 0.0).all()


@pytest.mark.parametrize("start", [Start(0.15), Start(-0.3, spread=1.4, fine=0.6), Start(0.1, spread=0.5, fine=2.0)])
def test_every_driver_starts_where_he_is_told_to(start: Start) -> None:
    stream = POPULATION.stream(seed(4), start, drivers=50)
    coarse, fine = stream.take(1)
    made = stream.mean + start.spread * (coarse[0] - stream.mean) + start.fine * fine[0]
    np.testing.assert_allclose(made, np.full(50, start.rel_offset), atol=1e-12)


def test_each_driver_may_have_a_start_of_his_own() -> None:
    starts = np.linspace(-0.3, 0.3, 7)
    coarse, fine = POPULATION.stream(seed(5), Start(starts), drivers=7).take(1)
    np.testing.assert_allclose(coarse[0] + fine[0], starts, atol=1e-12)


def test_a_start_is_forgotten() -> None:
    """After a minute nothing is left of 0.2 lane widths."""
    right, left = (STEADY.stream(seed(6), Start(STEADY.mean + side), drivers=400).take(320) for side in (-0.2, 0.2))
    gap = (left[0] + left[1] - right[0] - right[1]).mean(axis=1)
    assert gap[0] == pytest.approx(0.4)
    assert abs(gap[-1]) < 1e-9


def test_a_movement_that_can_t_vary_stays_at_its_mean_whatever_the_start() -> None:
    still = replace(STEADY, coarse=Autoregression(np.array([0.5]), 0.0), fine=replace(STEADY.fine, damping=np.zeros(3)))
    coarse, fine = still.stream(seed(7), Start(0.2)).take(5)
    np.testing.assert_array_equal(coarse, np.full(5, STEADY.mean))
    np.testing.assert_array_equal(fine, np.zeros(5))


def test_one_driver_alone_is_the_first_row_of_an_axis_of_one() -> None:
    alone, listed = POPULATION.stream(seed(8), Start(0.1)), POPULATION.stream(seed(8), Start(0.1), drivers=1)
    assert alone.mean == float(np.asarray(listed.mean)[0])
    for one, other in zip(alone.take(30), listed.take(30), strict=True):
        assert one.shape == (30,)
        np.testing.assert_array_equal(one, other[:, 0])


@pytest.mark.parametrize("drivers", [None, 3])
def test_a_state_from_json_goes_on_bit_by_bit(drivers: int | None) -> None:
    stream = POPULATION.stream(seed(9), Start(0.1), drivers=drivers)
    stream.take(17)
    state = read_as(AutoregressiveState, json.loads(json.dumps(plain(stream.state))))
    for one, other in zip(stream.take(60), POPULATION.resume(state).take(60), strict=True):
        np.testing.assert_array_equal(one, other)


def test_no_sample_of_the_grid_is_special() -> None:
    """Mean square of the movement's second difference, by the phase of the coarse step: the same for all."""
    coarse = STEADY.stream(seed(10), drivers=2000).take(10)[0]
    rough = (np.diff(coarse, 2, axis=0) ** 2).mean(axis=1)
    np.testing.assert_allclose(rough / rough.mean(), 1.0, atol=4.0 * np.sqrt(2.0 / 2000))
