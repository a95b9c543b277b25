"""Distances and routes over the road network.

References
----------
.. [1] E. W. Dijkstra, "A note on two problems in connexion with graphs", Numerische Mathematik 1, 1959.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from heapq import heappop, heappush
from itertools import count, pairwise
from math import inf
from typing import NamedTuple

from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.links import End, Links
from xosc_lateral.world.road.positions import LaneLink, RoadPath, RouteStep


class Routes(Links):
    """Shortest ways over linked roads and lanes."""

    def path_between(
        self, start: tuple[int, float], end: tuple[int, float], *, direction: int = 1, limit: float = inf
    ) -> RoadPath | None:
        """Shortest way along the reference lines of linked roads between two (road, s). [m]

        Its length is positive when it leaves `start` in `direction` (+1 along s, -1 against s), negative when it leaves
        the other way. None: no path within `limit` metres.
        """
        best: RoadPath | None = None
        (road, s), (target, target_s) = start, end
        if road == target:
            best = RoadPath((target_s - s) * direction, 1 if target_s >= s else -1, ())
        for way in (1, -1):
            room = self.roads[road].length - s if way > 0 else s
            reach = min(limit, abs(best.ds) if best is not None else inf)
            steps = self._search(road, way, room, target, target_s, reach)
            if steps is not None and (best is None or steps[0] < abs(best.ds)):
                best = RoadPath(steps[0] * way * direction, way, steps[1])
        return best if best is not None and abs(best.ds) <= limit else None

    def _search(
        self, road: int, way: int, room: float, target: int, target_s: float, limit: float
    ) -> tuple[float, tuple[End, ...]] | None:
        """Dijkstra over road ends: length to `target_s` on `target`, leaving `road` in direction `way`, and the way."""
        queue: list[tuple[float, End, tuple[End, ...]]] = [(room, end, (end,)) for end in self.next_roads(road, way)]
        done: set[End] = set()
        queue.sort()
        best: tuple[float, tuple[End, ...]] | None = None
        while queue:
            length, end, path = heappop(queue)
            if length > limit or (best is not None and length >= best[0]):
                break
            if end in done:
                continue
            done.add(end)
            index, entry = end
            if index == target:
                arrival = length + (target_s if entry > 0 else self.roads[index].length - target_s)
                if best is None or arrival < best[0]:
                    best = arrival, path
            for following in self.next_roads(index, entry):
                if following not in done:
                    heappush(queue, (length + self.roads[index].length, following, (*path, following)))
        return best

    def route(
        self,
        start: tuple[int, int, float],
        end: tuple[int, int, float],
        *,
        via: Sequence[tuple[int, int, float]] = (),
        ways: Sequence[int] | None = None,
    ) -> tuple[RouteStep, ...] | None:
        """Shortest drivable way over roads and junctions between two (road, lane, s). [m]

        Every stop is left in the direction `ways` (+1 along s, -1 against s), or in its lane's travel direction; where
        the lane itself leads on, no lanes are changed. Of several ways over the same roads (those inside junctions
        aside), it is the one onto the lane of the next stop. None: there is none.
        """
        steps: list[RouteStep] = []
        stops = [start, *via, end]
        if ways is None:
            ways = [self.roads[road].directions.get(lane, 1) for road, lane, _ in stops]
        for way, (leg_start, leg_end) in zip(ways, pairwise(stops), strict=False):  # the last stop is not left
            leg = self._leg(leg_start, leg_end, way)
            if leg is None:
                return None
            if steps and steps[-1].road == leg[0].road and steps[-1].direction == leg[0].direction:
                before = steps.pop()
                links, missed = (*before.links, *leg[0].links), before.missed or leg[0].missed
                leg = (leg[0]._replace(s_start=before.s_start, links=links, missed=missed), *leg[1:])
            steps += leg
        return tuple(steps)

    def _leg(
        self, start: tuple[int, int, float], end: tuple[int, int, float], way: int
    ) -> tuple[RouteStep, ...] | None:
        """The shortest way that the lane itself leads along, as who drives there changes no lanes; else any way."""
        (road, lane, s), (target, wanted, target_s) = start, end
        goal = target, self.roads[target].section_number(target_s), target_s
        for own_lane in (lane, None):
            begin = _Stretch(road, self.roads[road].section_number(s), own_lane, way)
            found = self._shortest_way(begin, s, goal)
            if found is not None and own_lane is not None and found[-1].lane != wanted:
                found = self._shortest_way(begin, s, goal, wanted, self._outside_junctions(found)) or found
            if found is not None:
                return self._steps_of(found, s, target_s, 0 if found[-1].lane == wanted else wanted)
        return None

    def _outside_junctions(self, way: _Way) -> list[int]:
        return [each.road for each in way if each.is_entry and self.roads[each.road].junction is None]

    def _shortest_way(
        self,
        begin: _Stretch,
        s: float,
        goal: tuple[int, int, float],
        wanted: int | None = None,
        only: Sequence[int] | None = None,
    ) -> _Way | None:
        """Lane sections from a place to one of another place, on a lane and those it leads into; without one, on any.

        Onto the lane `wanted`, and over the roads `only` in their order, those inside junctions aside.
        """
        target, number, target_s = goal
        here = self.roads[begin.road].sections[begin.section]
        if begin[:2] == (target, number) and (target_s - s) * begin.way >= 0.0 and wanted in (None, begin.lane):
            return (begin,)
        queue: list[tuple[float, int, int, _Way]] = []
        done: set[tuple[tuple[object, ...], int]] = set()
        numbers = count()
        length, passed = here.end - s if begin.way > 0 else s - here.start, 0
        way: _Way = (begin,)
        while True:
            for onto in self._drivable(way[-1]):
                outside = onto.is_entry and self.roads[onto.road].junction is None
                if not outside or only is None or only[passed : passed + 1] == [onto.road]:
                    heappush(queue, (length, next(numbers), passed + outside, (*way, onto)))
            while True:
                if not queue:
                    return None
                length, _, passed, way = heappop(queue)
                if (way[-1][:4], passed) not in done:
                    break
            here_on = way[-1]
            done.add((here_on[:4], passed))
            if here_on[:2] == (target, number) and wanted in (None, here_on.lane):
                return way
            section = self.roads[here_on.road].sections[here_on.section]
            length += section.end - section.start

    def _drivable(self, here: _Stretch) -> Iterator[_Stretch]:
        """What a lane leads to, ended ones included; without a lane, what any driving lane of its way does."""
        road, number, lane, way = here[:4]
        section = self.roads[road].sections[number]
        leaves = not self._is_inside(road, number + way)
        if lane is not None:
            links = self.onward(road, number, lane, way)
            if not links and lane in section.by_id:
                t = section.by_id[lane].state_at(section.end if way > 0 else section.start).centre_t
                beyond = self.beyond_end(road, number, lane, way, t, DRIVING)
                links = () if beyond is None else (beyond,)
            for link in links:
                onto = self.entered(road, number, way, link)
                yield _Stretch(link.road, onto, link.lane, link.direction, link, leaves)
            return
        if not leaves:
            yield _Stretch(road, number + way, None, way)
            return
        lanes = [each.id for each in section.lanes if each.type in DRIVING and each.direction == way]
        for link in dict.fromkeys(link for each in lanes for link in self.onward(road, number, each, way)):
            yield _Stretch(link.road, self.entered(road, number, way, link), None, link.direction, None, True)

    def _steps_of(self, way: _Way, s: float, target_s: float, missed: int) -> tuple[RouteStep, ...]:
        """Road by road."""
        steps: list[RouteStep] = []
        for on in way:
            length = self.roads[on.road].length
            links = () if on.link is None else (on.link,)
            if on.is_entry or not steps:
                steps.append(RouteStep(on.road, on.way, *((0.0, length) if on.way > 0 else (length, 0.0)), links))
            else:
                steps[-1] = steps[-1]._replace(links=(*steps[-1].links, *links))
        steps[0] = steps[0]._replace(s_start=s)
        steps[-1] = steps[-1]._replace(s_end=target_s, missed=missed)
        return tuple(steps)


class _Stretch(NamedTuple):
    """A lane through a section (its number), or any; which way along s, how it is entered, and if with its road."""

    road: int
    section: int
    lane: int | None
    way: int
    link: LaneLink | None = None
    is_entry: bool = False


_Way = tuple[_Stretch, ...]
