"""An entity's way over roads that are drawn by hand: places on it, places beside it, and where no path leads on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.kit.motion import RADIUS, drive, entity, two_roads
from tests.kit.places import hand_written
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, made_vehicle
from xosc_lateral.world.motion.way import Way, way_of

ACROSS = 5.25
"""Middle of the second lane, to the right of the reference line. [m]"""
BEND = RADIUS + ACROSS
"""Radius of that lane on road "b", which bends to the left. [m]"""


@pytest.fixture
def way(tmp_path: Path) -> Way:
    """From 350 m of road "a" on, at 30 m/s along s for 10 s; then on to the end of road "b"."""
    network = two_roads(tmp_path)
    return way_of(drive(network, entity(), start=350.0), network, 2000.0, has_route=False)


def test_a_way_leads_through_the_places_driven_and_on_to_where_the_lane_ends(way: Way) -> None:
    assert way.distance[0] == 0.0 and (np.diff(way.distance) >= 0.0).all()
    assert (way.road == np.where(way.distance <= 150.0, 0, 1)).all()
    (end,) = way.breaks
    assert (end.why, end.place.road, end.behind) == ("the lane ends", "b", np.inf)
    assert end.place.s == pytest.approx(600.0) and end.place.t == pytest.approx(-ACROSS)
    driven = 150.0 + 150.0 * BEND / RADIUS  # in the bend farther than along s; from there on s itself is counted
    assert end.distance == way.distance[-1] == pytest.approx(driven + 450.0, abs=0.1)
    assert way.next_break(0.0) is end and way.next_break(end.distance) is None


def test_a_way_that_is_long_enough_has_no_end(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    assert not way_of(drive(network, entity(), start=350.0), network, 400.0, has_route=False).breaks


def test_who_is_put_into_another_lane_begins_anew_there_and_who_is_found_there_has_lost_his(tmp_path: Path) -> None:
    network, row = two_roads(tmp_path), np.arange(501)
    for bits, why in ((Activity.TELEPORTED, []), (Activity.ACTIVE, ["the lane ends"])):
        activity = np.where(row == 250, int(Activity.ACTIVE | bits), int(Activity.ACTIVE)).astype(np.uint8)
        motion = drive(network, entity(), activity=activity).having(lane=np.where(row < 250, -2, -3).astype(np.int32))
        assert [one.why for one in way_of(motion, network, 0.0, has_route=False).breaks] == why


@pytest.mark.parametrize("aside", [0.4, -0.3])
def test_places_on_a_way_and_aside_of_it_are_those_of_a_line_and_an_arc(tmp_path: Path, way: Way, aside: float) -> None:
    at = np.array([0.0, 0.7, 20.3, 149.0, 200.0, 290.1])
    nominal, there = way.points(two_roads(tmp_path), at, np.full(len(at), aside))
    turned = np.clip(at - 150.0, 0.0, None) / BEND
    expected = 500.0 + np.minimum(at - 150.0, 0.0) + BEND * np.sin(turned), RADIUS - BEND * np.cos(turned)
    np.testing.assert_allclose(nominal, expected, atol=0.02)  # of 0.04 m that it is longer in the step with the joint
    np.testing.assert_allclose(there, [-aside * np.sin(turned), aside * np.cos(turned)], atol=1e-3)


def test_ways_along_the_reference_line_of_a_bend_are_shorter_on_its_outside(way: Way) -> None:
    straight, bend, later = way.along(np.array([100.0, 200.0, 300.0]))
    assert straight == pytest.approx(100.0)
    assert later - bend == pytest.approx(100.0 * RADIUS / BEND)


def round_a_ring() -> Way:
    """On a ring of two roads that are drawn against each other, half of it each: 314.2 m."""
    network = hand_written("ring")
    time = np.arange(0.0, 10.0, 0.1)
    rows = {name: np.zeros(len(time)) for name in ("y", "offset", "heading_relative", "speed")}
    road, lane = np.zeros(len(time), dtype=np.int32), np.full(len(time), -1, dtype=np.int32)
    rows |= {"x": 20.0 * time, "s": 20.0 * time, "road": road, "lane": lane}
    activity = np.ones(len(time), dtype=np.uint8)
    motion = EntityMotion.of(made_vehicle("T", 4.8, 1.9, 1.4), time, **rows, activity=activity)
    return way_of(motion, network, 700.0, has_route=False)


def test_a_way_ends_where_s_turns_round_and_goes_on_behind() -> None:
    way = round_a_ring()
    assert [one.why for one in way.breaks] == ["s runs the other way"] * 2
    first = way.breaks[0]
    assert first.distance == pytest.approx(314.2, abs=5.0) and first.place.road == "a"
    assert first.lanes[0].road == "b" and first.side == -1.0 and way.side_at(400.0) == -1.0
    assert first.behind == pytest.approx(first.distance + 10.0, abs=10.0)
    assert way.span_at(400.0) == pytest.approx((314.2, 628.3), abs=5.0)


def test_a_stretch_with_the_same_s_is_open_at_both_ends_of_the_way() -> None:
    way = round_a_ring()
    assert way.span_at(100.0) == pytest.approx((0.0, 314.2), abs=5.0)
    assert way.span_at(690.0) == (pytest.approx(628.3, abs=5.0), np.inf)
    for at in (100.0, 400.0, 690.0):
        first, last = way.span_at(at)
        assert way.side_at(first) == way.side_at(min(last, 700.0)) == way.side_at(at)
    assert (way.side_at(-1.0), way.side_at(0.0), way.side_at(690.0)) == (1.0, 1.0, 1.0)
