"""Paths that an action may cut anywhere are nowhere faster than what it may take away, and else as they were."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.segment import own_time, way_of
from xosc_lateral.world.motion.driver_clock import CUT_SHARE, DriverClock
from xosc_lateral.world.motion.look import FRAME_TURN, LATERAL_ACCELERATION, LOOK_STEP
from xosc_lateral.world.motion.offset_path import _slower, bounded, calm


@pytest.mark.parametrize("seed", range(5))
def test_the_slower_movement_is_the_nearest_that_there_is(seed: int) -> None:
    """Two places that are farther apart than the way between them: each has to give half of it, and none more."""
    rng = np.random.default_rng(seed)
    values, way = np.cumsum(rng.normal(0.0, 0.1, 200)), np.cumsum(rng.uniform(0.02, 0.08, 200))
    slower = _slower(values, way)
    assert (np.abs(np.diff(slower)) <= np.diff(way) + 1e-12).all()
    apart = np.abs(values[:, None] - values) - np.abs(way[:, None] - way)
    assert np.abs(slower - values).max() == pytest.approx(0.5 * apart.max())


@pytest.mark.parametrize("speed", [3.0, 6.4, 8.0, 15.0, 30.0])
def test_where_an_action_may_begin_nobody_has_more_lateral_speed_than_it_may_take_away(speed: float) -> None:
    """Seen on the road: by how much the path is turned, and how fast the car moves sideways at that speed."""
    distance = np.arange(0.0, 2000.0, 0.2)
    clock = DriverClock(distance, np.full(len(distance), speed), own_time(distance / speed, np.full(10_000, speed)))
    turn, sideways = CUT_SHARE * FRAME_TURN, CUT_SHARE * LATERAL_ACCELERATION * LOOK_STEP
    most = min(turn, sideways / speed)
    at = clock.distance_at(np.arange(2.0, clock.time[-1] - 2.0, 0.01))
    for slope, is_changed in ((0.5 * most, False), (2.0 * most, True)):
        rate = slope * float(way_of(np.array([speed]))[0])
        sways = lambda place, rate=rate: rate / 0.8 * np.sin(0.8 * clock.time_at(place))  # noqa: E731
        assert np.abs(np.gradient(sways(at), at)).max() == pytest.approx(slope, rel=0.01)
        moves = bounded(sways, clock, is_cut=True)(at)
        assert np.abs(np.gradient(moves, at)).max() <= most * 1.02
        assert np.allclose(moves, sways(at)) is not is_changed


@pytest.mark.parametrize("end", [True, False])
def test_a_piece_begins_without_lateral_speed_and_ends_so_if_asked_and_is_else_the_movement(end: bool) -> None:
    """It sways by 0.24 m/s where it is cut, at 15 m/s; places stay, speeds there go."""
    distance = np.arange(0.0, 1000.0, 0.2)
    clock = DriverClock(distance, np.full(len(distance), 15.0), distance / 15.0)
    sways = lambda place: 0.3 * np.sin(0.8 * clock.time_at(place))  # noqa: E731
    first, last = clock.distance_at(np.array([2.0, 15.0]) * np.pi / 0.8)  # fastest to the left, and to the right
    at = np.arange(first, last, 0.05)
    moves = calm(sways, clock, at, end=end)
    rates = np.gradient(moves, at / 15.0)
    assert abs(np.gradient(sways(at), at / 15.0)[[0, -1]]) == pytest.approx([0.24, 0.24], abs=0.001)
    assert rates[[0, -1]] == pytest.approx([0.0, 0.0 if end else -0.24], abs=0.005)
    np.testing.assert_allclose(moves[[0, -1]], sways(at[[0, -1]]), atol=1e-6)
    middle = np.abs(at - 0.5 * (first + last)) < 100.0
    np.testing.assert_allclose(moves[middle], sways(at[middle]), atol=1e-9)
