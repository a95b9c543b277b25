"""A carriageway of a motorway as an OpenDRIVE road: straights and bends with clothoids, driving lanes, hard shoulder.

The reference line runs along the median. In right-hand traffic the lanes lie to its right (negative lane ids), in
left-hand traffic to its left; both are driven in the direction of s.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from datetime import datetime
from typing import Any

FIXED_DATE = datetime(2024, 1, 1)  # written where the formats ask for a date: the same settings give the same bytes


def document(root: ET.Element) -> str:
    """An element tree as an indented document."""
    ET.indent(root, "  ")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


ROAD = 1  # id of the only road

SHOULDER = 3.0  # hard shoulder [m]; RAA 2008 (guidelines for motorways), cross-section RQ 31

MEDIAN = 2.0  # paved margin beside the fast lane, and the grass beyond the shoulder [m]

CROSSFALL = 0.025  # least crossfall for drainage, towards the outer edge [-]; RAA 2008


@dataclass(frozen=True, slots=True)
class Straight:
    """A straight."""

    length: float  # [m]


@dataclass(frozen=True, slots=True)
class Bend:
    """An arc between two clothoids of equal length."""

    radius: float  # of the reference line; positive: a left bend [m]
    arc: float  # arc, clothoid: lengths [m]
    clothoid: float

    @property
    def length(self) -> float:
        """Of all three. [m]"""
        return self.arc + 2.0 * self.clothoid


@dataclass(frozen=True, slots=True)
class Motorway:
    """One carriageway."""

    alignment: tuple[Straight | Bend, ...]  # from s = 0
    lanes: int  # driving lanes
    lane_width: float  # [m]
    left_hand: bool = False  # left-hand traffic
    grade: float = 0.0  # rise over run, the same everywhere [-]

    @property
    def length(self) -> float:
        """[m]"""
        return sum(part.length for part in self.alignment)

    def lane(self, index: int) -> int:
        """OpenDRIVE id of a driving lane; 0 is the slow lane beside the hard shoulder."""
        number = self.lanes - index
        return number if self.left_hand else -number

    def to_xml(self, name: str) -> str:
        """The road as an OpenDRIVE document, the same bytes each time."""
        from scenariogeneration import xodr

        rule = xodr.TrafficRule.LHT if self.left_hand else xodr.TrafficRule.RHT
        road = xodr.Road(ROAD, _plan_view(self.alignment), self._lanes(), name=name, rule=rule)
        road.add_type(xodr.RoadType.motorway, 0)
        road.add_elevation(0, 0, self.grade, 0, 0)
        for s, start, slope in self._crossfall():
            road.add_superelevation(s, start, slope, 0, 0)
        file = xodr.OpenDrive(name)
        file.add_road(road)
        file.adjust_roads_and_lanes()
        root = file.get_element()
        header = root.find("header")
        assert header is not None, "scenariogeneration writes a header"
        header.set("date", FIXED_DATE.isoformat())
        return document(root)

    def _lanes(self) -> Any:
        from scenariogeneration import xodr

        solid = xodr.RoadMark(xodr.RoadMarkType.solid, width=0.3)
        broken = xodr.RoadMark(xodr.RoadMarkType.broken, width=0.15, length=6.0, space=12.0)
        centre = xodr.Lane(xodr.LaneType.none)
        centre.add_roadmark(solid)
        section = xodr.LaneSection(0, centre)
        for number in range(self.lanes):
            lane = xodr.Lane(xodr.LaneType.driving, a=self.lane_width)
            lane.add_roadmark(solid if number == self.lanes - 1 else broken)
            self._add(section, lane, outside=True)
        for kind, width in ((xodr.LaneType.shoulder, SHOULDER), (xodr.LaneType.border, MEDIAN)):
            self._add(section, _unmarked(kind, width), outside=True)
        self._add(section, _unmarked(xodr.LaneType.median, MEDIAN), outside=False)
        lanes = xodr.Lanes()
        lanes.add_lanesection(section)
        return lanes

    def _add(self, section: Any, lane: Any, *, outside: bool) -> None:
        if self.left_hand == outside:
            section.add_left_lane(lane)
        else:
            section.add_right_lane(lane)

    def _crossfall(self) -> list[tuple[float, float, float]]:
        """Superelevation as (s, angle there, change per metre): down to the outer edge, in bends down to the inside.

        A positive angle lowers the right side (OpenDRIVE 1.7, section 10.2).
        """
        outwards = -CROSSFALL if self.left_hand else CROSSFALL
        profile, s = {0.0: (outwards, 0.0)}, 0.0
        for part in self.alignment:
            inwards = outwards
            if isinstance(part, Bend):
                inwards = -CROSSFALL if part.radius > 0.0 else CROSSFALL
            if isinstance(part, Bend) and inwards != outwards:
                turn = (inwards - outwards) / part.clothoid
                profile[s] = (outwards, turn)
                profile[s + part.clothoid] = (inwards, 0.0)
                profile[s + part.clothoid + part.arc] = (inwards, -turn)
                profile[s + part.length] = (outwards, 0.0)
            s += part.length
        return [(s, start, slope) for s, (start, slope) in profile.items()]


def _unmarked(kind: Any, width: float) -> Any:
    from scenariogeneration import xodr

    lane = xodr.Lane(kind, a=width)
    lane.add_roadmark(xodr.RoadMark(xodr.RoadMarkType.none))
    return lane


def _plan_view(alignment: tuple[Straight | Bend, ...]) -> Any:
    from scenariogeneration import xodr

    plan = xodr.PlanView(0, 0, 0)
    for part in alignment:
        if isinstance(part, Straight):
            plan.add_geometry(xodr.Line(part.length))
            continue
        curvature = 1.0 / part.radius
        plan.add_geometry(xodr.Spiral(0.0, curvature, part.clothoid))
        plan.add_geometry(xodr.Arc(curvature, part.arc))
        plan.add_geometry(xodr.Spiral(curvature, 0.0, part.clothoid))
    return plan
