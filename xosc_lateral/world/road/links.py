"""Where lanes and roads lead: road links, lane links, junctions; and moving along them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import hypot, inf, nextafter

from xosc_lateral.world.road.lanes import Lane, LaneSection
from xosc_lateral.world.road.positions import Advance, LaneLink
from xosc_lateral.world.road.road import Connection, Junction, Road, RoadLink, find_lane, lane_pose, normal_angle

End = tuple[int, int]
"""A road as entered: its index, and +1 (at its start, to go along s) or -1 (at its end)."""


Chooser = Callable[[Sequence[LaneLink]], LaneLink]
"""Picks one of several ways on; gets at least one."""


class Links:
    """Links between lanes and roads; look-ups are kept, since a player asks the same ones again and again."""

    def __init__(self, roads: Sequence[Road], junctions: Sequence[Junction]) -> None:
        self.roads = roads
        self._index = {road.id: i for i, road in enumerate(roads)}
        self.junctions = {junction.id: junction for junction in junctions}
        self._links: dict[tuple[int, int, int], tuple[LaneLink, ...]] = {}
        self._ends: dict[End, tuple[End, ...]] = {}

    def next_lanes(self, road: int, lane: int, direction: int) -> tuple[LaneLink, ...]:
        """Lanes that follow a lane of the last (first) section when leaving the road at its end (+1) or start (-1)."""
        key = (road, lane, direction)
        if key not in self._links:
            self._links[key] = tuple(dict.fromkeys(self._find_links(*key)))
        return self._links[key]

    def _find_links(self, road: int, lane: int, direction: int) -> Iterator[LaneLink]:
        here = self.roads[road]
        link = here.successor if direction > 0 else here.predecessor
        lane_here = here.sections[-1 if direction > 0 else 0].by_id.get(lane)
        if link is None or lane_here is None or lane == 0:
            return
        if link.element_type == "junction":
            onward = [
                *self._through_junction(here, lane_here, link, direction),
                *self._back_through_direct_junction(here, lane_here, link, direction),
            ]
            yield from onward or self._against_traffic(here, lane_here, link, direction)
            return
        other = self._index.get(link.element_id)
        if other is None:
            return
        contact = link.contact or self._contact_of(road, direction, other)
        # as the lane says, else as the other side says
        ids = lane_here.successors if direction > 0 else lane_here.predecessors
        there = _end_section(self.roads[other], contact).by_id
        if ids:
            targets = [target for target in ids if target in there and target != 0]
        else:
            targets = _lanes_linked_to(here, lane_here, direction, self.roads[other], contact)
        for target in targets:
            yield self._enter(other, target, contact)

    def _through_junction(self, here: Road, lane: Lane, link: RoadLink, direction: int) -> Iterator[LaneLink]:
        junction = self.junctions.get(link.element_id)
        for connection in junction.connections if junction else ():
            other = self._index.get(connection.connecting_road)
            if connection.incoming_road != here.id or other is None:
                continue
            contact = connection.contact or "start"
            targets = [to for source, to in connection.lanes if source == lane.id]
            if not connection.lanes:  # those that name the lane as their own link
                targets = _lanes_linked_to(here, lane, direction, self.roads[other], contact)
            for target in targets:
                if target in _end_section(self.roads[other], contact).by_id:
                    yield self._enter(other, target, contact)

    def _against_traffic(self, here: Road, lane: Lane, link: RoadLink, direction: int) -> Iterator[LaneLink]:
        """Into a junction on a lane that leads out of it: connections hold the other way, lanes name their links."""
        for other, contact in self._roads_back(here, link.element_id, direction):
            for candidate in _lanes_linked_to(here, lane, direction, self.roads[other], contact):
                yield self._enter(other, candidate, contact)

    def _back_through_direct_junction(
        self, here: Road, lane: Lane, link: RoadLink, direction: int
    ) -> Iterator[LaneLink]:
        """Direct junctions have no connecting roads whose own links lead back: their connections hold both ways."""
        for connection, other, contact in self._direct_connections(here, link, direction):
            section = _end_section(self.roads[other], contact)
            for source, target in connection.lanes:
                if target == lane.id and source in section.by_id:
                    yield self._enter(other, source, contact)

    def _direct_connections(self, here: Road, link: RoadLink, direction: int) -> Iterator[tuple[Connection, int, str]]:
        """Connections of a direct junction that end where this road is left; incoming road, and its end there."""
        junction = self.junctions.get(link.element_id)
        for connection in junction.connections if junction and here.junction != link.element_id else ():
            other = self._index.get(connection.incoming_road)
            touches = "end" if direction > 0 else "start"
            if connection.connecting_road != here.id or (connection.contact or "start") != touches or other is None:
                continue
            incoming = self.roads[other]
            for back, contact in ((incoming.successor, "end"), (incoming.predecessor, "start")):
                if back and back.element_type == "junction" and back.element_id == link.element_id:
                    yield connection, other, contact

    def _contact_of(self, road: int, direction: int, other: int) -> str:
        """Contact point that a file leaves out: the end of the other road that is nearer."""
        here, there = self.roads[road], self.roads[other]
        x, y, _ = here.reference_at(here.length if direction > 0 else 0.0)
        ends = (there.reference_at(s) for s in (0.0, there.length))
        to_start, to_end = ((u - x) ** 2 + (v - y) ** 2 for u, v, _ in ends)
        return "start" if to_start <= to_end else "end"

    def _enter(self, road: int, lane: int, contact: str) -> LaneLink:
        return LaneLink(road, lane, *((0.0, 1) if contact == "start" else (self.roads[road].length, -1)))

    def next_roads(self, road: int, direction: int) -> tuple[End, ...]:
        """Roads that can be entered when leaving this one at its end (+1) or start (-1), driven there either way."""
        key = (road, direction)
        if key not in self._ends:
            self._ends[key] = tuple(dict.fromkeys(self._find_roads(road, direction)))
        return self._ends[key]

    def _find_roads(self, road: int, direction: int) -> Iterator[End]:
        here = self.roads[road]
        link = here.successor if direction > 0 else here.predecessor
        if link is None:
            return
        if link.element_type != "junction":
            other = self._index.get(link.element_id)
            if other is not None:
                yield other, 1 if (link.contact or self._contact_of(road, direction, other)) == "start" else -1
            return
        junction = self.junctions.get(link.element_id)
        for connection in junction.connections if junction else ():
            other = self._index.get(connection.connecting_road)
            if connection.incoming_road == here.id and other is not None:
                yield other, 1 if connection.contact != "end" else -1
        for _, other, contact in self._direct_connections(here, link, direction):
            yield other, 1 if contact == "start" else -1
        # Files list a connection from the road that drives into it only; on the way back it is found by its own links.
        for other, contact in self._roads_back(here, link.element_id, direction):
            yield other, 1 if contact == "start" else -1

    def _roads_back(self, here: Road, junction: str, direction: int) -> Iterator[tuple[int, str]]:
        """Roads of a junction that lead to this one's end (+1) or start (-1) by their own links, and by which end."""
        touched = "end" if direction > 0 else "start"
        for index, other in enumerate(self.roads):
            ends = ((other.predecessor, "start", -1), (other.successor, "end", 1)) if other.junction == junction else ()
            for back, contact, way in ends:
                if back is None or (back.element_type, back.element_id) != ("road", here.id):
                    continue
                if (back.contact or self._contact_of(index, way, self._index[here.id])) == touched:
                    yield index, contact

    # ---- moving along lanes over sections, roads and junctions -------------------------------------------------------
    def advance(
        self,
        road: int,
        lane: int,
        s: float,
        distance: float,
        *,
        choose: Chooser | None = None,
        direction: int | None = None,
    ) -> Advance:
        """Move along s by `distance` [m] (negative: backwards) over sections, roads and junctions, by lane links.

        `direction` of positive distance: +1 along s, -1 against; default the lane's travel direction. `choose` picks
        one of several links; default the straightest. Ends at the lane's end, saying what remains.
        """
        way = self.roads[road].directions.get(lane, 1) if direction is None else direction
        if distance < 0.0:
            way, distance = -way, -distance
        here = self.roads[road]
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
            options = self.next_lanes(road, lane, way)
            links_passed += 1
            # A ring of roads without length would never end.
            if not options or links_passed > 100_000:
                return Advance(road, lane, s, way, distance)
            link = options[0]
            if len(options) > 1:
                link = choose(options) if choose else self.straightest(options)
            road, lane, s, way = link
            here = self.roads[road]
            section = here.sections[0 if way > 0 else -1]

    def straightest(self, options: Sequence[LaneLink]) -> LaneLink:
        """The link whose road turns least from entry to exit; of equals the first."""
        return min(options, key=self._turn)

    def most_turning(self, options: Sequence[LaneLink]) -> LaneLink:
        """The link whose road turns most; of equals the first."""
        return max(options, key=self._turn)

    def _turn(self, link: LaneLink) -> float:
        road = self.roads[link.road]
        return abs(normal_angle(road.reference_at(road.length)[2] - road.reference_at(0.0)[2]))


def _lanes_linked_to(here: Road, lane: Lane, direction: int, other: Road, contact: str) -> list[int]:
    """Lanes at an end of another road that name this lane as their own link, the one that it touches first."""
    lanes = _end_section(other, contact).lanes
    linked = [each.id for each in lanes if lane.id in (each.predecessors if contact == "start" else each.successors)]
    if len(linked) < 2:
        return linked
    x, y = lane_pose(here, lane.id, here.length if direction > 0 else 0.0, 0.0)[:2]
    ends = {each: lane_pose(other, each, 0.0 if contact == "start" else other.length, 0.0) for each in linked}
    return sorted(linked, key=lambda each: round(hypot(ends[each].x - x, ends[each].y - y), 6))


def _end_section(road: Road, contact: str) -> LaneSection:
    return road.sections[0 if contact == "start" else -1]


_JOINT_TOLERANCE = 1e-3
"""Lanes of two sections touch with a gap of no more, such as one that has closed and one that opens beside it. [m]"""


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
