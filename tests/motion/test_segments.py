"""Segments and the reasons why the rest is none."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

from tests.motion.made_motion import drive, entity, two_roads
from xosc_lateral.motion.nominal import Activity
from xosc_lateral.motion.segments import StretchKind, cut_stretches

ACTIVE = int(Activity.ACTIVE)


def test_free_driving_is_one_segment_across_a_road_border(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    (stretch,) = cut_stretches(drive(network, entity(), start=400.0), network)
    assert stretch.is_road_following
    assert (stretch.start, stretch.end) == (0.0, 10.0)


def test_each_reason_is_named_and_no_row_is_lost(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    activity = np.full(501, ACTIVE, dtype=np.uint8)
    activity[100:150] |= int(Activity.LATERAL)
    activity[200:220] |= int(Activity.TRAJECTORY)
    activity[490:] = 0
    speed = np.full(501, 30.0)
    speed[300:350] = 10.0
    stretches = cut_stretches(drive(network, entity(), activity=activity, speed=speed), network)
    assert [stretch.kind for stretch in stretches] == [
        StretchKind.ROAD_FOLLOWING,
        StretchKind.LATERAL_ACTION,
        StretchKind.ROAD_FOLLOWING,
        StretchKind.TRAJECTORY,
        StretchKind.ROAD_FOLLOWING,
        StretchKind.SLOW,
        StretchKind.ROAD_FOLLOWING,
        StretchKind.ABSENT,
    ]
    assert stretches[0].first == 0
    assert stretches[-1].last == 500
    assert all(a.last + 1 == b.first for a, b in pairwise(stretches))


def test_exactly_40_km_h_counts_as_road_following_and_a_hair_less_does_not(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    assert cut_stretches(drive(network, entity(), speed=40 / 3.6), network)[0].is_road_following
    assert cut_stretches(drive(network, entity(), speed=11.1), network)[0].kind is StretchKind.SLOW


def test_a_teleport_cuts_and_wrong_way_driving_is_no_segment(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    activity = np.full(501, ACTIVE, dtype=np.uint8)
    activity[250] |= int(Activity.TELEPORTED)
    motion = drive(network, entity(), activity=activity)
    assert [stretch.first for stretch in cut_stretches(motion, network)] == [0, 250]
    motion.heading_relative[:] = np.pi
    assert {stretch.kind for stretch in cut_stretches(motion, network)} == {StretchKind.AGAINST_LANE}


def test_a_trailer_has_no_driver(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    (stretch,) = cut_stretches(drive(network, entity()), network, is_trailer=True)
    assert stretch.kind is StretchKind.TRAILER
