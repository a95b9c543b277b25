"""Where lanes and roads lead: road links, lane links, junctions; and moving along them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from math import cos, hypot, inf, nextafter, sin
from typing import NamedTuple

from xosc_lateral.world.road.lanes import DRIVING, Lane, LaneSection
from xosc_lateral.world.road.positions import Advance, LaneLink
from xosc_lateral.world.road.road import Connection, Junction, Road, RoadLink, lane_at, normal_angle

End = tuple[int, int]
"""A road as entered: its index, and +1 (at its start, to go along s) or -1 (at its end)."""


Pairs = tuple[tuple[int, int], ...]
"""Lanes before a joint and those that they lead to."""

Chooser = Callable[[Sequence[LaneLink]], LaneLink]
"""Picks one of several ways on; gets at least one."""


class Links:
    """Links between lanes and roads; look-ups are kept, since a player asks the same ones again and again."""

    def __init__(self, roads: Sequence[Road], junctions: Sequence[Junction]) -> None:
        self.roads = roads
        self._index = {road.id: i for i, road in enumerate(roads)}
        self.junctions = {junction.id: junction for junction in junctions}
        self._links: dict[tuple[int, int, int, int], tuple[LaneLink, ...]] = {}
        self._ends: dict[End, tuple[End, ...]] = {}

    def next_lanes(self, road: int, lane: int, direction: int) -> tuple[LaneLink, ...]:
        """Lanes that follow a lane of the last (first) section when leaving the road at its end (+1) or start (-1)."""
        return self.onward(road, len(self.roads[road].sections) - 1 if direction > 0 else 0, lane, direction)

    # ---- where a lane leads ------------------------------------------------------------------------------------------
    # The one rule. A lane leads to the lanes that its link names, else to those whose links name it. Where no link says
    # anything, within a road, the lane of the same id goes on, if it touches and no other lane claims it: many files
    # leave links out between sections. A lane for vehicles leads to no other kind (a shoulder) while there are lanes
    # for vehicles beyond. Where all this gives nothing, the lane ends, and who is on it goes on in the nearest one
    # (`beyond_end`).

    def onward(self, road: int, section: int, lane: int, way: int) -> tuple[LaneLink, ...]:
        """Lanes that a lane of a section (its number) leads to, when left along (+1) or against (-1) s."""
        key = (road, section, lane, way)
        if key not in self._links:
            self._links[key] = tuple(dict.fromkeys(self._find_links(*key)))
        return self._links[key]

    def entered(self, road: int, section: int, way: int, link: LaneLink) -> int:
        """Number of the section that a link from a section leads into."""
        if self._is_inside(road, section + way):
            return section + way
        return 0 if link.direction > 0 else len(self.roads[link.road].sections) - 1

    def _is_inside(self, road: int, section: int) -> bool:
        return 0 <= section < len(self.roads[road].sections)

    def _find_links(self, road: int, section: int, lane: int, way: int) -> Iterator[LaneLink]:
        here = self.roads[road]
        left = here.sections[section]
        lane_here = left.by_id.get(lane)
        if lane_here is None:
            return
        if self._is_inside(road, section + way):
            s, beyond = left.end if way > 0 else left.start, here.sections[section + way]
            unsaid = _same_id(left, lane_here, way, beyond, s)
            joint = _Joint(here, beyond, s, way)
            for target in _lanes_beyond(here, lane_here, way, s, joint, _named_by(lane_here, way), unsaid):
                yield LaneLink(road, target, s, way)
            return
        is_listed = False
        for other, contact, pairs, is_back in self._joints(road, way) if lane else ():
            if is_back and is_listed:
                return
            named = _named_by(lane_here, way) if pairs is None else [to for source, to in pairs if source == lane]
            if pairs and not named:
                continue
            there, (s, entry) = self.roads[other], (0.0, 1) if contact == "start" else (self.roads[other].length, -1)
            joint = _Joint(there, there.sections[0 if entry > 0 else -1], s, entry)
            for target in _lanes_beyond(here, lane_here, way, here.length if way > 0 else 0.0, joint, named):
                is_listed = not is_back
                yield LaneLink(other, target, s, entry)

    def _joints(self, road: int, way: int) -> Iterator[tuple[int, str, Pairs | None, bool]]:
        """Roads beyond an end: index, where it is touched, lanes (None: as they say), whether by its own link only.

        A connection without lanes leads to those that name the lane as their own link.
        """
        here = self.roads[road]
        link = here.successor if way > 0 else here.predecessor
        if link is not None and link.element_type != "junction":
            other = self._index.get(link.element_id)
            if other is not None:
                yield other, link.contact or self._contact_of(road, way, other), None, False
            return
        junction = None if link is None else self.junctions.get(link.element_id)
        for connection in junction.connections if junction else ():
            other = self._index.get(connection.connecting_road)
            if connection.incoming_road == here.id and other is not None:
                yield other, connection.contact or "start", connection.lanes, False
        if link is None:
            return
        # Direct junctions have no connecting roads whose own links lead back: their connections hold both ways.
        yield from (
            (other, contact, tuple((target, source) for source, target in connection.lanes), False)
            for connection, other, contact in self._direct_connections(here, link, way)
        )
        # Files list a connection from the road that drives into it only; on the way back it is found by its own links.
        yield from ((other, contact, (), True) for other, contact in self._roads_back(here, link.element_id, way))

    def beyond_end(
        self, road: int, section: int, lane: int, way: int, t: float, lane_types: Collection[str]
    ) -> LaneLink | None:
        """Where a lane ends: the lane of these types beyond that is nearest to t, of two the one of its id. [m]

        Within a road it is one driven the same way; on another road, as in the reference player, any. None: the road
        itself ends there, or a junction begins, or nothing beyond is of these types.
        """
        here = self.roads[road]
        other, entry, direction = road, way, here.sections[section].by_id[lane].direction
        s = here.sections[section].end if way > 0 else _just_before(here.sections[section].start)
        if not self._is_inside(road, section + way):
            link = here.successor if way > 0 else here.predecessor
            if link is None or link.element_type != "road" or link.element_id not in self._index:
                return None
            other, direction = self._index[link.element_id], 0
            entry = 1 if link.contact != "end" else -1
            s = 0.0 if entry > 0 else self.roads[other].length
        beyond = lane_at(
            self.roads[other], other, s, t if entry == way else -t, lane_types, prefer=lane, direction=direction
        )
        return LaneLink(other, beyond.lane, s, entry) if beyond.lane else None

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

    def next_roads(self, road: int, direction: int) -> tuple[End, ...]:
        """Roads that can be entered when leaving this one at its end (+1) or start (-1), driven there either way."""
        key = (road, direction)
        if key not in self._ends:
            joints = self._joints(road, direction)
            self._ends[key] = tuple(
                dict.fromkeys((other, 1 if contact == "start" else -1) for other, contact, *_ in joints)
            )
        return self._ends[key]

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
        number, passed = self.roads[road].section_number(s), 0
        while True:
            section = self.roads[road].sections[number]
            room = section.end - s if way > 0 else s - section.start
            last = not self._is_inside(road, number + way)
            # a section does not hold its own end: whoever reaches it exactly is in the next one
            if distance < room or (distance == room and (last or way < 0)):
                return Advance(road, lane, s + way * distance, way, 0.0)
            distance -= max(room, 0.0)
            s = section.end if way > 0 else section.start
            options = self.onward(road, number, lane, way)
            passed += 1
            # A ring of roads without length would never end.
            if not options or passed > 100_000:
                return Advance(road, lane, s if last or way < 0 else _just_before(s), way, distance)
            link = options[0]
            if len(options) > 1:
                link = choose(options) if choose else self.straightest(options)
            number = self.entered(road, number, way, link)
            road, lane, s, way = link

    def straightest(self, options: Sequence[LaneLink]) -> LaneLink:
        """The link whose road turns least from entry to exit; of equals the first."""
        return min(options, key=self._turn)

    def most_turning(self, options: Sequence[LaneLink]) -> LaneLink:
        """The link whose road turns most; of equals the first."""
        return max(options, key=self._turn)

    def _turn(self, link: LaneLink) -> float:
        road = self.roads[link.road]
        return abs(normal_angle(road.reference_at(road.length)[2] - road.reference_at(0.0)[2]))


class _Joint(NamedTuple):
    """What is entered at the end of a lane: a section of a road, at s [m], to be driven along (+1) or against s."""

    road: Road
    section: LaneSection
    s: float
    entry: int


def _named_by(lane: Lane, way: int) -> tuple[int, ...]:
    return lane.successors if way > 0 else lane.predecessors


def _lanes_beyond(
    here: Road, lane: Lane, way: int, s: float, joint: _Joint, named: Sequence[int], unsaid: Sequence[int] = ()
) -> list[int]:
    """Those named that are there, else those that name this lane, else what holds where no link says anything."""
    there = joint.section.by_id
    targets = [there[target] for target in named if target and target in there]
    if not targets:
        targets = [each for each in joint.section.lanes if lane.id in _named_by(each, -joint.entry)]
        if len(targets) > 1:  # the one that it touches first
            x, y = _centre_of(here, lane, s)
            ends = {each.id: _centre_of(joint.road, each, joint.s) for each in targets}
            targets.sort(key=lambda each: round(hypot(ends[each.id][0] - x, ends[each.id][1] - y), 6))
    targets = targets or [there[target] for target in unsaid]
    return [each.id for each in targets if _stays_its_kind(lane, way, each, joint.section, joint.entry)]


def _stays_its_kind(lane: Lane, way: int, target: Lane, beyond: LaneSection, entry: int) -> bool:
    """Whether vehicles that follow a lane follow it into another: not off the lanes for them while there are any."""
    if lane.type not in DRIVING or target.type in DRIVING:
        return True
    return not any(each.type in DRIVING and each.direction * entry == lane.direction * way for each in beyond.lanes)


def _centre_of(road: Road, lane: Lane, s: float) -> tuple[float, float]:
    x, y, heading = road.reference_at(s)
    t = lane.state_at(s).centre_t
    return x - t * sin(heading), y + t * cos(heading)


_JOINT_TOLERANCE = 1e-3
"""Lanes of two sections touch with a gap of no more, such as one that has closed and one that opens beside it. [m]"""


def _same_id(left: LaneSection, lane: Lane, way: int, beyond: LaneSection, s: float) -> tuple[int, ...]:
    """The lane of the same id in the next section, if it touches and no other lane's link claims it."""
    same = beyond.by_id.get(lane.id)
    if same is None or any(lane.id in _named_by(other, way) for other in left.lanes) or _named_by(same, -way):
        return (lane.id,) if lane.id == 0 else ()
    (centre, _, width), (other_centre, _, other_width) = lane.state_at(s), same.state_at(s)
    return (lane.id,) if abs(centre - other_centre) <= 0.5 * max(width, other_width) + _JOINT_TOLERANCE else ()


def _just_before(s: float) -> float:
    """The last place of the section that ends at s."""
    return nextafter(s, -inf)
