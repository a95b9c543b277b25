"""What really happens: lane changes with their beginning, crossing and end, and the lane keeping between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import BoolArray
from xosc_lateral.workflows.detection.tracks import STEP, Track
from xosc_lateral.workflows.recordings.cuts import DEFAULT_CUTS
from xosc_lateral.workflows.recordings.lateral import SETTLED, Course, lateral_speed

MARGIN = round(DEFAULT_CUTS.margin / STEP)
"""No lane keeping is counted so near to a lane change, and an alarm so shortly before it has seen it: its beginning is
known no better. [rows]"""
EDGE = round(DEFAULT_CUTS.edge / STEP)
"""Nor so near to the ends of a track, where a lane change may begin or end unseen. [rows]"""


@dataclass(frozen=True, slots=True)
class LaneChange:
    """Rows of a track between which it changes lanes."""

    side: int  # 1: to the left, -1: to the right
    begin: int  # last row without movement to that side of 0.1 m/s or more
    crossing: int  # first row with the vehicle's side on the marking
    centre: int  # first row with the vehicle's reference point in the other lane
    end: int  # first row without that movement, near the new lane's centre


@dataclass(frozen=True, eq=False, slots=True)
class Truth:
    """Lane changes that were seen from their beginning, and rows of lane keeping, shape (n,)."""

    changes: tuple[LaneChange, ...]
    keeping: BoolArray


def truth_of(track: Track) -> Truth:
    """Lane changes and lane keeping of a track, by its movement across the lanes alone: the same for every source."""
    n, time = len(track), track.time
    width = track.size.width
    room = np.maximum(0.5 * (track.rows.lane_width - width), SETTLED)
    course = Course(time, track.lateral, track.base, track.level, lateral_speed(time, track.lateral), room)
    keeping = track.rows.following.copy()
    keeping[:EDGE], keeping[max(n - EDGE, 0) :] = False, False
    changes = []
    for rough in course.maneuvers():
        keeping[max(rough.first - MARGIN, 0) : rough.last + MARGIN + 1] = False
        if rough.lanes and not rough.cut and not rough.aborted and rough.first >= EDGE:
            changes.append(_lane_change(track, rough.first, rough.last, 1 if rough.lanes > 0 else -1))
    return Truth(tuple(changes), keeping)


def _lane_change(track: Track, begin: int, end: int, side: int) -> LaneChange:
    level, base = track.level, track.base[begin]
    centre = begin + int(np.argmax(side * (level[begin : end + 1] - level[begin]) > 0))
    towards = side * (track.lateral[begin : centre + 1] - base)
    reached = towards + 0.5 * track.size.width >= 0.5 * track.rows.lane_width[begin : centre + 1]
    return LaneChange(side, begin, begin + int(np.argmax(reached)) if reached.any() else centre, centre, end)


STILL = 0.01
"""Lateral speed that nobody drives at throughout; played maneuvers come down to rounding. [m/s]"""


def moves_in_lane(track: Track, truth: Truth) -> bool:
    """Whether a vehicle moves sideways while it keeps its lane."""
    rate = np.abs(np.diff(track.rows.offset, prepend=track.rows.offset[:1])) / STEP
    return bool((rate[truth.keeping] > STILL).any())
