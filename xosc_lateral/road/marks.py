"""Road markings of one road, gathered from its lanes."""

from __future__ import annotations

from xosc_lateral.road.positions import RoadMark
from xosc_lateral.road.road import Road


def road_marks(road: Road) -> tuple[RoadMark, ...]:
    """Markings at the outer edges of all lanes, lane 0 included, section by section from left to right."""
    marks: list[RoadMark] = []
    for section in road.sections:
        left = [lane for lane in section.lanes if lane.id > 0]
        right = [lane for lane in section.lanes if lane.id < 0]
        for lane in (*left, section.centre, *right):
            marks += [mark for mark in lane.marks if mark.type != "none"]
    return tuple(marks)
