"""One road: reference line, lane sections, surface, links; everything that is known about one place on it."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, nan

from xosc_lateral.world.road.geometry import Line, ReferenceElement
from xosc_lateral.world.road.lanes import LaneSection
from xosc_lateral.world.road.surface import Surface


@dataclass(frozen=True, slots=True)
class RoadLink:
    """What a road is linked to at one of its ends."""

    element_type: str  # "road" or "junction"
    element_id: str
    contact: str  # where the other road is touched: "start", "end", or "": the file does not say (junctions)


@dataclass(frozen=True, slots=True)
class Connection:
    """A way through a junction: from an incoming road onto a connecting one.

    `lanes` holds (from, to) lane ids; empty: the file gives none.
    """

    incoming_road: str
    connecting_road: str
    contact: str
    lanes: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Junction:
    """A junction and its connections."""

    id: str
    name: str
    connections: tuple[Connection, ...]


@dataclass(frozen=True, eq=False, slots=True)
class Road:
    """One road."""

    id: str
    name: str
    length: float  # [m]
    rule: str  # side of the traffic: "RHT" or "LHT"
    junction: str | None  # that it is a connecting road of
    starts: tuple[float, ...]  # s of each element [m]
    elements: tuple[ReferenceElement, ...]
    sections: tuple[LaneSection, ...]  # gapless over [0, length]
    surface: Surface
    speeds: tuple[tuple[float, float], ...]  # s [m], and limit from there on [m/s] (``road/type/speed``); inf: none
    directions: Mapping[int, int]  # of travel along s, by lane id
    predecessor: RoadLink | None
    successor: RoadLink | None
    section_starts: tuple[float, ...] = field(init=False)
    is_flat: bool = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "section_starts", tuple(section.start for section in self.sections))
        heights = any(lane.heights for section in self.sections for lane in section.lanes)
        object.__setattr__(self, "is_flat", self.surface.is_flat and not heights)

    def section_at(self, s: float) -> LaneSection:
        """The lane section at s; beyond the ends the first or last one. `s` in [m]."""
        return self.sections[self.section_number(s)]

    def section_number(self, s: float) -> int:
        """Index of the lane section at s; beyond the ends the first or last one. `s` in [m]."""
        return max(bisect_right(self.section_starts, s) - 1, 0)

    def reference_at(self, s: float) -> tuple[float, float, float]:
        """x, y, heading of the reference line. [m], [rad]"""
        i = bisect_right(self.starts, s) - 1
        if i < 0:
            i = 0
        return self.elements[i].at(s - self.starts[i])

    def curvature_at(self, s: float) -> float:
        """Curvature of the reference line. [1/m]"""
        i = bisect_right(self.starts, s) - 1
        if i < 0:
            i = 0
        return self.elements[i].curvature_at(s - self.starts[i])

    def stretch_of(self, lane: int, s: float) -> tuple[float, float, ReferenceElement, float, float]:
        """Range around s on one element of the reference line [m], that element, its start, and t of the lane. [m]

        Where the lane's middle changes along s, its t is NaN; on a line, where it does not matter, 0.
        """
        i = max(bisect_right(self.starts, s) - 1, 0)
        low = self.starts[i] if i else -inf
        high = self.starts[i + 1] if i + 1 < len(self.starts) else inf
        element = self.elements[i]
        if isinstance(element, Line):
            return low, high, element, self.starts[i], 0.0
        here = self.section_at(s).by_id.get(lane)
        if here is None:
            return low, high, element, self.starts[i], nan
        j = max(bisect_right(here.starts, s) - 1, 0)
        low = max(low, here.starts[j] if j else -inf)
        high = min(high, (*here.starts[j + 1 :], inf)[0])
        return low, high, element, self.starts[i], nan if any(here.centre[j][1:]) else here.centre[j][0]
