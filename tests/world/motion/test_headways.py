"""Headway and time to collision, in closed form: free space over speed, and over the closing speed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from xosc_lateral.world.motion.gaps import RoadPath, closest_following

TIME = np.arange(0.0, 10.0, 0.1)
LENGTH, WIDTH, CENTRE = 5.0, 2.0, 1.4


def vehicle(name: str, start: float, speed: float, t: float = 0.0, forward: int = 1) -> RoadPath:
    s = start + forward * speed * TIME
    ones = np.ones(len(TIME))
    return RoadPath(
        name, s, t * ones, np.zeros(len(TIME), dtype=np.int32), s, t * ones, forward * np.ones(len(TIME), dtype=int),
        speed * ones, LENGTH, WIDTH, CENTRE,
    )  # fmt: skip


def test_a_car_that_closes_in() -> None:
    """30 m/s behind 25 m/s, 55 m of free space at the start: after 9.9 s there are 5.5 m left."""
    follower, leader = vehicle("A", 0.0, 30.0), vehicle("B", 55.0 + LENGTH, 25.0)
    (found,) = closest_following([follower, leader]).values()
    left = 55.0 - 5.0 * TIME[-1]
    assert (found.follower, found.leader) == ("A", "B")
    assert found.headway == pytest.approx(left / 30.0)
    assert found.time_to_collision == pytest.approx(left / 5.0)


def test_against_s_the_order_is_that_of_travel() -> None:
    follower, leader = vehicle("A", 500.0, 20.0, forward=-1), vehicle("B", 500.0 - 30.0 - LENGTH, 20.0, forward=-1)
    (found,) = closest_following([follower, leader]).values()
    assert (found.follower, found.leader) == ("A", "B")
    assert found.headway == pytest.approx(30.0 / 20.0)
    assert math.isinf(found.time_to_collision)


def test_neighbours_on_other_lanes_or_oncoming_follow_nobody() -> None:
    beside, oncoming = vehicle("B", 20.0, 20.0, t=3.5), vehicle("C", 100.0, 20.0, forward=-1)
    assert closest_following([vehicle("A", 0.0, 30.0), beside, oncoming]) == {}


@pytest.mark.parametrize(("t", "follows"), [(1.9, True), (-1.9, True), (2.1, False), (-2.1, False)])
def test_widths_have_to_overlap(t: float, follows: bool) -> None:
    found = closest_following([vehicle("A", 0.0, 20.0), vehicle("B", 40.0, 20.0, t=t)])
    assert bool(found) == follows


def test_whoever_is_absent_or_off_the_road_does_not_count() -> None:
    leader = vehicle("B", 40.0, 20.0)
    absent = replace(leader, x=np.full(len(TIME), np.nan))
    off = replace(leader, road=np.full(len(TIME), -1, dtype=np.int32))
    assert closest_following([vehicle("A", 0.0, 20.0), absent]) == {}
    assert closest_following([vehicle("A", 0.0, 20.0), off]) == {}
