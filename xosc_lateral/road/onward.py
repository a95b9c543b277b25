"""Onto which of several roads that lie on each other a point has gone from the one that it was on."""

from __future__ import annotations

from collections.abc import Collection

from xosc_lateral.road.index import TOUCHING
from xosc_lateral.road.links import Links
from xosc_lateral.road.places import lane_at
from xosc_lateral.road.positions import LaneCoordinates
from xosc_lateral.road.projection import project_at


def gone_on(
    links: Links,
    found: LaneCoordinates,
    near: tuple[int, float],
    point: tuple[float, float],
    *,
    lane_types: Collection[str] | None,
) -> LaneCoordinates:
    """Of the roads that hold a point, the one that its lane leads on to, and of several the least bent there.

    At the entry of a junction its roads lie on each other, and a point that is between two vertices of a path has no
    other sign of where it goes. Without such a road it stays where it was found. So the reference player has it.

    `found`: where it is without regard to where it came from. `near`: road and s [m] where it was a moment ago.
    `lane_types`: those that count.
    """
    before, s = near
    if found.road == before or found.distance > TOUCHING:
        return found
    road = links.roads[before]
    s, t, _ = project_at(road, *point, s)
    lane = lane_at(road, before, s, t, lane_types).lane
    options = [link for way in (1, -1) for link in links.next_lanes(before, lane, way)]
    for link in sorted(options, key=lambda link: abs(links.roads[link.road].curvature_at(link.s))):
        other = links.roads[link.road]
        s, t, ahead = project_at(other, *point, link.s)
        onward = lane_at(other, link.road, s, t, lane_types)
        if abs(ahead) <= TOUCHING and onward.distance <= TOUCHING and onward.lane != 0:
            return onward
    return found
