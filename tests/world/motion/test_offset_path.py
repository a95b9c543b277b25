"""Paths that an action may cut anywhere are nowhere faster than what it may take away, and else as they were."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.own_clock import own_time, way_of
from xosc_lateral.world.motion.driver_clock import CUT_SHARE, DriverClock
from xosc_lateral.world.motion.look import FRAME_TURN, LATERAL_ACCELERATION, LOOK_STEP
from xosc_lateral.world.motion.offset_path import _slower, bounded


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
