"""Lanes and markings of roads as lines of t over s, lane section by lane section."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.world.road import RoadNetwork
from xosc_lateral.world.road.positions import RoadMark

STEP = 2.0
"""Between two points of a line. [m]"""

NO_MARK = frozenset({"none", "curb", "grass", "edge"})
"""Road marks that are no paint."""


def lane_surfaces(
    network: RoadNetwork, road: int, first: float, last: float
) -> Iterator[tuple[str, FloatArray, FloatArray, FloatArray]]:
    """Lanes of one road between two s: the type, and t of the right and of the left edge over s. [m]"""
    start, last = max(0.0, first), min(network.roads[road].length, last)
    while start < last:
        section_start, section_end = network.section_at(road, start)
        if section_end <= start:  # a section of no length: OpenDRIVE forbids it, field files have it
            return
        s = _grid(start, min(section_end, last))
        for lane in network.lanes_at(road, 0.5 * (max(section_start, start) + min(section_end, last))):
            if lane.type != "none":
                centre, half = network.lane_centre_t(road, lane.id, s), 0.5 * network.lane_width(road, lane.id, s)
                yield lane.type, s, centre - half, centre + half
        start = section_end


def markings(
    network: RoadNetwork, road: int, first: float, last: float
) -> Iterator[tuple[RoadMark, FloatArray, FloatArray]]:
    """Paint on one road between two s: the mark, and its t over s. [m]"""
    for mark in network.road_marks(road):
        start, stop = max(first, mark.s_start), min(last, mark.s_end)
        if start < stop and mark.type not in NO_MARK:
            s = _grid(start, stop)
            outer = 0.5 * np.sign(mark.lane) * network.lane_width(road, mark.lane, s) if mark.lane else 0.0
            yield mark, s, network.lane_centre_t(road, mark.lane, s) + outer


def _grid(start: float, stop: float) -> FloatArray:
    """From start to just before stop, where the next section begins."""
    return np.linspace(start, max(start, stop - 1e-6), max(2, int(np.ceil((stop - start) / STEP)) + 1))
