"""Distances and routes over the road network.

References
----------
.. [1] E. W. Dijkstra, "A note on two problems in connexion with graphs", Numerische Mathematik 1, 1959.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from heapq import heappop, heappush
from itertools import count, pairwise
from math import inf
from typing import NamedTuple, TypeVar

from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.links import Links
from xosc_lateral.world.road.positions import LaneLink, RoadPath, RouteStep

_Node = TypeVar("_Node")


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
            if room > reach:
                continue
            path = _shortest_path(
                self.next_roads(road, way),
                room,
                lambda end: self.next_roads(*end),
                lambda end: self.roads[end[0]].length,
                lambda end: (
                    None if end[0] != target else target_s if end[1] > 0 else self.roads[target].length - target_s
                ),
                reach,
            )
            if path is not None and (best is None or path[0] < abs(best.ds)):
                best = RoadPath(path[0] * way * direction, way, path[1])
        return best if best is not None and abs(best.ds) <= limit else None

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
            path = self._shortest_way(begin, s, goal)
            if path is not None and own_lane is not None and path[-1].lane != wanted:
                path = self._shortest_way(begin, s, goal, wanted, self._outside_junctions(path)) or path
            if path is not None:
                return self._steps_of(path, s, target_s, 0 if path[-1].lane == wanted else wanted)
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

        def edge(on: _Stretch, way: int) -> float:
            section = self.roads[on.road].sections[on.section]
            return section.end if way > 0 else section.start

        def onward(on: _Stretch) -> Iterator[_Stretch]:
            for onto in self._drivable(on):
                outside = onto.is_entry and self.roads[onto.road].junction is None
                if not outside or only is None or only[on.passed : on.passed + 1] == [onto.road]:
                    yield onto._replace(passed=on.passed + outside)

        def arrival(on: _Stretch) -> float | None:
            there = on[:2] == (target, number) and wanted in (None, on.lane)
            return abs(target_s - edge(on, -on.way)) if there else None

        if arrival(begin) is not None and (target_s - s) * begin.way >= 0.0:
            return (begin,)
        room = abs(edge(begin, begin.way) - s)
        path = _shortest_path(onward(begin), room, onward, lambda on: abs(edge(on, 1) - edge(on, -1)), arrival)
        return None if path is None else (begin, *path[1])

    def _drivable(self, on: _Stretch) -> Iterator[_Stretch]:
        """What a lane leads to, ended ones included; without a lane, what any driving lane of its way does."""
        road, number, lane, way = on[:4]
        section = self.roads[road].sections[number]
        leaves = not self._is_inside(road, number + way)
        if lane is None and not leaves:
            yield _Stretch(road, number + way, None, way)
            return
        lanes = [each.id for each in section.lanes if each.type in DRIVING and each.direction == way]
        for each in lanes if lane is None else (lane,):
            links = self.onward(road, number, each, way)
            if not links and lane in section.by_id:
                t = section.by_id[each].state_at(section.end if way > 0 else section.start).centre_t
                beyond = self.beyond_end(road, number, each, way, t, DRIVING)
                links = () if beyond is None else (beyond,)
            for link in links:
                onto = self.entered(road, number, way, link)
                tracked = (None, None) if lane is None else (link.lane, link)
                yield _Stretch(link.road, onto, tracked[0], link.direction, tracked[1], leaves)

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
    passed: int = 0  # roads entered so far outside of junctions


_Way = tuple[_Stretch, ...]


def _shortest_path(
    first: Iterable[_Node],
    room: float,
    onward: Callable[[_Node], Iterable[_Node]],
    length: Callable[[_Node], float],
    arrival: Callable[[_Node], float | None],
    limit: float = inf,
) -> tuple[float, tuple[_Node, ...]] | None:
    """Shortest way from one of the nodes `first`, which are `room` away, and its length [m]; None: none within `limit`.

    `arrival`: how far into a node the goal is; None: it is not there.
    """
    queue: list[tuple[float, int, _Node, tuple[_Node, ...]]]
    queue = [(room, number, node, (node,)) for number, node in enumerate(first)]
    numbers, done = count(len(queue)), set[_Node]()
    best: tuple[float, tuple[_Node, ...]] | None = None
    while queue:
        so_far, _, node, path = heappop(queue)
        if so_far > limit or (best is not None and so_far >= best[0]):
            break
        if node in done:
            continue
        done.add(node)
        rest = arrival(node)
        if rest is not None and (best is None or so_far + rest < best[0]):
            best = so_far + rest, path
        for onto in onward(node):
            if onto not in done:
                heappush(queue, (so_far + length(node), next(numbers), onto, (*path, onto)))
    return best
