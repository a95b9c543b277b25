"""Where lanes lead: links, junctions, moving along, distances and routes over the road network."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from heapq import heappop, heappush
from itertools import pairwise
from math import inf, nextafter

from xosc_lateral.road.lanes import DRIVING, Lane, LaneSection
from xosc_lateral.road.places import find_lane, normal_angle
from xosc_lateral.road.positions import Advance, LaneLink, RouteStep
from xosc_lateral.road.road import Connection, Junction, Road, RoadLink

Chooser = Callable[[Sequence[LaneLink]], LaneLink]
"""Picks one of several ways on; gets at least one."""

End = tuple[int, int]
"""A road as entered: its index, and +1 (at its start, to go along s) or -1 (at its end)."""


class Topology:
    """Links between lanes and roads; look-ups are kept, since a player asks the same ones again and again."""

    def __init__(self, roads: Sequence[Road], junctions: Sequence[Junction]) -> None:
        """Index roads and junctions by id."""
        self._roads = roads
        self._index = {road.id: i for i, road in enumerate(roads)}
        self._junctions = {junction.id: junction for junction in junctions}
        self._links: dict[tuple[int, int, int], tuple[LaneLink, ...]] = {}
        self._ends: dict[End, tuple[End, ...]] = {}

    # ---- lanes -------------------------------------------------------------------------------------------------------
    def next_lanes(self, road: int, lane: int, direction: int) -> tuple[LaneLink, ...]:
        """Lanes that follow when leaving the road at its end (+1) or start (-1)."""
        key = (road, lane, direction)
        if key not in self._links:
            self._links[key] = tuple(dict.fromkeys(self._find_links(*key)))
        return self._links[key]

    def _find_links(self, road: int, lane: int, direction: int) -> Iterator[LaneLink]:
        here = self._roads[road]
        link = here.successor if direction > 0 else here.predecessor
        found = here.sections[-1 if direction > 0 else 0].by_id.get(lane)
        if link is None or found is None or lane == 0:
            return
        if link.element_type == "junction":
            yield from self._through_junction(here, found, link)
            return
        other = self._index.get(link.element_id)
        if other is None:
            return
        contact = link.contact or self._contact_of(road, direction, other)
        for target in self._linked_ids(found, direction, self._roads[other], contact, here):
            yield self._enter(other, target, contact)

    def _through_junction(self, here: Road, lane: Lane, link: RoadLink) -> Iterator[LaneLink]:
        junction = self._junctions.get(link.element_id)
        for connection in junction.connections if junction else ():
            other = self._index.get(connection.connecting_road)
            if connection.incoming_road != here.id or other is None:
                continue
            contact = connection.contact or "start"
            for target in self._connected_ids(connection, lane, self._roads[other], contact):
                if target in _end_section(self._roads[other], contact).by_id:
                    yield self._enter(other, target, contact)

    def _connected_ids(self, connection: Connection, lane: Lane, other: Road, contact: str) -> list[int]:
        """Lanes of the connecting road; without any laneLink, those that name the lane as their own link."""
        if connection.lanes:
            return [to for source, to in connection.lanes if source == lane.id]
        lanes = _end_section(other, contact).lanes
        return [o.id for o in lanes if lane.id in (o.predecessors if contact == "start" else o.successors)]

    def _linked_ids(self, lane: Lane, direction: int, other: Road, contact: str, here: Road) -> list[int]:
        """Lanes of the linked road: as the lane says, else as the other side says."""
        there = _end_section(other, contact)
        ids = lane.successors if direction > 0 else lane.predecessors
        if ids:
            return [i for i in ids if i in there.by_id and i != 0]
        return [o.id for o in there.lanes if lane.id in (o.predecessors if contact == "start" else o.successors)]

    def _contact_of(self, road: int, direction: int, other: int) -> str:
        """Contact point that a file leaves out: the end of the other road that is nearer."""
        here, there = self._roads[road], self._roads[other]
        x, y, _ = here.reference_at(here.length if direction > 0 else 0.0)
        gaps = []
        for s in (0.0, there.length):
            u, v, _ = there.reference_at(s)
            gaps.append((u - x) ** 2 + (v - y) ** 2)
        return "start" if gaps[0] <= gaps[1] else "end"

    def _enter(self, road: int, lane: int, contact: str) -> LaneLink:
        return LaneLink(road, lane, *((0.0, 1) if contact == "start" else (self._roads[road].length, -1)))

    # ---- moving ------------------------------------------------------------------------------------------------------
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
        """Move along s, following lane links (see `RoadNetwork.advance`)."""
        way = self._roads[road].directions.get(lane, 1) if direction is None else direction
        if distance < 0.0:
            way, distance = -way, -distance
        here = self._roads[road]
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
            link = options[0] if len(options) == 1 else (choose or self.straightest)(options)
            road, lane, s, way = link
            here = self._roads[road]
            section = here.sections[0 if way > 0 else -1]

    def straightest(self, options: Sequence[LaneLink]) -> LaneLink:
        """The link whose road turns least; of equals the first."""
        return min(options, key=lambda link: abs(self._turn(link.road)))

    def _turn(self, road: int) -> float:
        here = self._roads[road]
        return normal_angle(here.reference_at(here.length)[2] - here.reference_at(0.0)[2])

    # ---- roads -------------------------------------------------------------------------------------------------------
    def next_roads(self, road: int, direction: int) -> tuple[End, ...]:
        """Roads that can be entered when leaving this one at its end (+1) or start (-1), driven there either way."""
        key = (road, direction)
        if key not in self._ends:
            self._ends[key] = tuple(dict.fromkeys(self._find_roads(road, direction)))
        return self._ends[key]

    def _find_roads(self, road: int, direction: int) -> Iterator[End]:
        here = self._roads[road]
        link = here.successor if direction > 0 else here.predecessor
        if link is None:
            return
        if link.element_type != "junction":
            other = self._index.get(link.element_id)
            if other is not None:
                yield other, 1 if (link.contact or self._contact_of(road, direction, other)) == "start" else -1
            return
        junction = self._junctions.get(link.element_id)
        for connection in junction.connections if junction else ():
            other = self._index.get(connection.connecting_road)
            if connection.incoming_road == here.id and other is not None:
                yield other, 1 if connection.contact != "end" else -1
        # Files list a connection from the road that drives into it only; on the way back it is found by its own links.
        for other, there in enumerate(self._roads):
            if there.junction != link.element_id:
                continue
            for back, entry in ((there.predecessor, 1), (there.successor, -1)):
                touches = "end" if direction > 0 else "start"
                if back and back.element_id == here.id and back.element_type == "road" and back.contact == touches:
                    yield other, entry

    def path_distance(
        self, start: tuple[int, float], end: tuple[int, float], *, direction: int = 1, limit: float = inf
    ) -> float | None:
        """Shortest signed distance along reference lines (see `RoadNetwork.path_distance`)."""
        best: float | None = None
        (road, s), (target, target_s) = start, end
        if road == target:
            best = (target_s - s) * direction
        for way in (1, -1):
            room = self._roads[road].length - s if way > 0 else s
            reach = min(limit, abs(best) if best is not None else inf)
            found = self._search(road, way, room, target, target_s, reach)
            if found is not None and (best is None or found < abs(best)):
                best = found * way * direction
        return best if best is not None and abs(best) <= limit else None

    def _search(self, road: int, way: int, room: float, target: int, target_s: float, limit: float) -> float | None:
        """Dijkstra over road ends: length to `target_s` on `target` when leaving `road` in direction `way`."""
        queue = [(room, end) for end in self.next_roads(road, way)]
        done: set[End] = set()
        queue.sort()
        best: float | None = None
        while queue:
            length, end = heappop(queue)
            if length > limit or (best is not None and length >= best):
                break
            if end in done:
                continue
            done.add(end)
            index, entry = end
            if index == target:
                arrival = length + (target_s if entry > 0 else self._roads[index].length - target_s)
                best = arrival if best is None else min(best, arrival)
            for following in self.next_roads(index, entry):
                if following not in done:
                    heappush(queue, (length + self._roads[index].length, following))
        return best

    # ---- routes ------------------------------------------------------------------------------------------------------
    def route(
        self, start: tuple[int, int, float], end: tuple[int, int, float], *, via: Sequence[tuple[int, int, float]] = ()
    ) -> tuple[RouteStep, ...] | None:
        """Shortest drivable way (see `RoadNetwork.route`)."""
        steps: list[RouteStep] = []
        stops = [start, *via, end]
        way = self._roads[start[0]].directions.get(start[1], 1)
        for leg_start, leg_end in pairwise(stops):
            leg = self._leg(leg_start, leg_end, way)
            if leg is None:
                return None
            if steps and steps[-1].road == leg[0].road and steps[-1].direction == leg[0].direction:
                leg = (leg[0]._replace(s_start=steps.pop().s_start), *leg[1:])
            steps += leg
            way = steps[-1].direction
        return tuple(steps)

    def _leg(
        self, start: tuple[int, int, float], end: tuple[int, int, float], way: int
    ) -> tuple[RouteStep, ...] | None:
        (road, _, s), (target, _, target_s) = start, end
        if road == target and (target_s - s) * way >= 0.0:
            return (RouteStep(road, way, s, target_s),)
        room = self._roads[road].length - s if way > 0 else s
        queue: list[tuple[float, int, End, tuple[End, ...]]] = []
        count = 0
        for following in self._drivable(road, way):
            heappush(queue, (room, count, following, (following,)))
            count += 1
        done: set[End] = set()
        while queue:
            length, _, here, path = heappop(queue)
            if here in done:
                continue
            done.add(here)
            if here[0] == target:
                return self._steps((road, way, s), path, target_s)
            for following in self._drivable(*here):
                if following not in done:
                    count += 1
                    heappush(queue, (length + self._roads[here[0]].length, count, following, (*path, following)))
        return None

    def _drivable(self, road: int, way: int) -> Iterator[End]:
        """Road ends reached by a driving lane in its travel direction (lanes may be changed on the road)."""
        section = self._roads[road].sections[-1 if way > 0 else 0]
        reached: dict[End, None] = {}
        for lane in section.lanes:
            if lane.type in DRIVING and lane.direction == way:
                for link in self.next_lanes(road, lane.id, way):
                    reached[(link.road, link.direction)] = None
        yield from reached

    def _steps(self, start: tuple[int, int, float], path: Sequence[End], target_s: float) -> tuple[RouteStep, ...]:
        road, way, s = start
        steps = [RouteStep(road, way, s, self._roads[road].length if way > 0 else 0.0)]
        for index, entry in path:
            length = self._roads[index].length
            steps.append(RouteStep(index, entry, *((0.0, length) if entry > 0 else (length, 0.0))))
        steps[-1] = steps[-1]._replace(s_end=target_s)
        return tuple(steps)


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
    return lane if abs(centre - other) < 0.5 * max(width, other_width) else None


def _end_section(road: Road, contact: str) -> LaneSection:
    return road.sections[0 if contact == "start" else -1]


def _just_before(s: float) -> float:
    """The last place of the section that ends at s."""
    return nextafter(s, -inf)
