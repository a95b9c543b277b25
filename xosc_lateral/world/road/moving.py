"""Moving along lanes over sections, roads and junctions, and which road a moved point has gone on to."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from math import inf, nextafter

from xosc_lateral.world.road.index import LANE_TOLERANCE
from xosc_lateral.world.road.lanes import LaneSection
from xosc_lateral.world.road.links import Links
from xosc_lateral.world.road.places import find_lane, lane_at, normal_angle
from xosc_lateral.world.road.positions import Advance, LaneCoordinates, LaneLink
from xosc_lateral.world.road.projection import project_at
from xosc_lateral.world.road.road import Road

Chooser = Callable[[Sequence[LaneLink]], LaneLink]
"""Picks one of several ways on; gets at least one."""

_JOINT_TOLERANCE = 1e-3
"""Lanes of two sections touch with a gap of no more, such as one that has closed and one that opens beside it. [m]"""


def advance(
    links: Links,
    road: int,
    lane: int,
    s: float,
    distance: float,
    *,
    choose: Chooser | None = None,
    direction: int | None = None,
) -> Advance:
    """Move along s, following lane links (see `RoadNetwork.advance`). `s` and `distance` in [m]."""
    way = links.roads[road].directions.get(lane, 1) if direction is None else direction
    if distance < 0.0:
        way, distance = -way, -distance
    here = links.roads[road]
    section = here.section_at(s)
    links_passed = 0
    while True:
        room = section.end - s if way > 0 else s - section.start
        last = section.end >= here.length if way > 0 else section.start <= 0.0
        # a section does not hold its own end: whoever reaches it exactly is in the next one
        if distance < room or (distance == room and (last or way < 0)):
            return Advance(road, lane, s + way * distance, way, 0.0)
        distance -= max(room, 0.0)
        if not last:
            beyond = here.section_at(section.end if way > 0 else _just_before(section.start))
            follower = follow_section(here, section, beyond, lane, way)
            if follower is None:
                return Advance(road, lane, _just_before(section.end) if way > 0 else section.start, way, distance)
            s = section.end if way > 0 else section.start
            lane, section = follower, beyond
            continue
        s = section.end if way > 0 else section.start
        options = links.next_lanes(road, lane, way)
        links_passed += 1
        # A ring of roads without length would never end.
        if not options or links_passed > 100_000:
            return Advance(road, lane, s, way, distance)
        link = options[0]
        if len(options) > 1:
            link = choose(options) if choose else straightest(links.roads, options)
        road, lane, s, way = link
        here = links.roads[road]
        section = here.sections[0 if way > 0 else -1]


def straightest(roads: Sequence[Road], options: Sequence[LaneLink]) -> LaneLink:
    """The link whose road turns least; of equals the first."""
    return min(options, key=lambda link: abs(_turn(roads[link.road])))


def most_turning(roads: Sequence[Road], options: Sequence[LaneLink]) -> LaneLink:
    """The link whose road turns most; of equals the first."""
    return max(options, key=lambda link: abs(_turn(roads[link.road])))


def _turn(road: Road) -> float:
    return normal_angle(road.reference_at(road.length)[2] - road.reference_at(0.0)[2])


def follow_section(road: Road, section: LaneSection, beyond: LaneSection, lane: int, way: int) -> int | None:
    """The lane that goes on in the next section of the same road.

    Where a file gives no link, the lane of the same id goes on if it touches; OpenDRIVE asks for links only where lanes
    are connected, but many files leave them out between sections.
    """
    at = section.end if way > 0 else section.start
    here = section.by_id.get(lane) or find_lane(road, lane, at)
    for target in here.successors if way > 0 else here.predecessors:
        if target in beyond.by_id:
            return target
    same = beyond.by_id.get(lane)
    if same is None:
        return None
    (centre, _, width), (other, _, other_width) = here.state_at(at), same.state_at(at)
    return lane if abs(centre - other) <= 0.5 * max(width, other_width) + _JOINT_TOLERANCE else None


def _just_before(s: float) -> float:
    """The last place of the section that ends at s."""
    return nextafter(s, -inf)


def gone_on(
    links: Links,
    located: LaneCoordinates,
    near: tuple[int, float],
    point: tuple[float, float],
    *,
    lane_types: Collection[str] | None,
) -> LaneCoordinates:
    """Of the roads that hold a point, the one that its lane leads on to, and of several the least bent there.

    At the entry of a junction its roads lie on each other, and a point that is between two vertices of a path has no
    other sign of where it goes. Without such a road it stays where it was found. So the reference player has it.

    `located`: where it is without regard to where it came from. `near`: road and s [m] where it was a moment ago.
    `lane_types`: those that count.
    """
    before, s = near
    if located.road == before or located.distance > LANE_TOLERANCE:
        return located
    road = links.roads[before]
    s, t, _ = project_at(road, *point, s)
    lane = lane_at(road, before, s, t, lane_types).lane
    options = [link for way in (1, -1) for link in links.next_lanes(before, lane, way)]
    for link in sorted(options, key=lambda link: abs(links.roads[link.road].curvature_at(link.s))):
        other = links.roads[link.road]
        s, t, ahead = project_at(other, *point, link.s)
        onward = lane_at(other, link.road, s, t, lane_types)
        if abs(ahead) <= LANE_TOLERANCE and onward.distance <= LANE_TOLERANCE and onward.lane != 0:
            return onward
    return located
