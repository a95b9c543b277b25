"""Segments and the reasons why the rest is none."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

from tests.kit.motion import drive, entity, two_roads
from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.motion.segments import SegmentKind, cut_segments

ACTIVE = int(Activity.ACTIVE)


def test_free_driving_is_one_segment_across_a_road_border(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    (span,) = cut_segments(drive(network, entity(), start=400.0), network)
    assert span.is_road_following
    assert (span.start, span.end) == (0.0, 10.0)


def test_each_reason_is_named_and_no_row_is_lost(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    activity = np.full(501, ACTIVE, dtype=np.uint8)
    activity[100:150] |= int(Activity.LATERAL)
    activity[200:220] |= int(Activity.TRAJECTORY)
    activity[490:] = 0
    speed = np.full(501, 30.0)
    speed[300:350] = -1.0
    spans = cut_segments(drive(network, entity(), activity=activity, speed=speed), network)
    assert [span.kind for span in spans] == [
        SegmentKind.ROAD_FOLLOWING,
        SegmentKind.LATERAL_ACTION,
        SegmentKind.ROAD_FOLLOWING,
        SegmentKind.TRAJECTORY,
        SegmentKind.ROAD_FOLLOWING,
        SegmentKind.BACKWARDS,
        SegmentKind.ROAD_FOLLOWING,
        SegmentKind.ABSENT,
    ]
    assert spans[0].first == 0
    assert spans[-1].last == 500
    assert all(a.last + 1 == b.first for a, b in pairwise(spans))


def test_who_drives_slowly_or_stands_follows_the_road(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    for speed in (0.0, 3.0, 11.1):
        assert cut_segments(drive(network, entity(), speed=speed), network)[0].is_road_following


def test_a_teleport_cuts_and_only_who_drives_across_the_lane_follows_none(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    activity = np.full(501, ACTIVE, dtype=np.uint8)
    activity[250] |= int(Activity.TELEPORTED)
    motion = drive(network, entity(), activity=activity)
    assert [span.first for span in cut_segments(motion, network)] == [0, 250]
    motion = motion.having(heading_relative=np.full(501, np.pi))  # overtaking on the lane of those who come towards it
    assert all(span.is_road_following for span in cut_segments(motion, network))
    motion = motion.having(heading_relative=np.full(501, np.pi / 2))
    assert {span.kind for span in cut_segments(motion, network)} == {SegmentKind.ACROSS_LANE}


def test_a_trailer_has_no_driver(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    (span,) = cut_segments(drive(network, entity()), network, is_trailer=True)
    assert span.kind is SegmentKind.TRAILER
