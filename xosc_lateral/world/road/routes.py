"""Distances and routes over the road network.

References
----------
.. [1] E. W. Dijkstra, "A note on two problems in connexion with graphs", Numerische Mathematik 1, 1959.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from heapq import heappop, heappush
from itertools import pairwise
from math import inf

from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.links import End, Links, follow_section
from xosc_lateral.world.road.positions import RoadPath, RouteStep
from xosc_lateral.world.road.road import Road


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
        the lane itself leads on, no lanes are changed. None: there is none.
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
                leg = (leg[0]._replace(s_start=steps.pop().s_start), *leg[1:])
            steps += leg
        return tuple(steps)

    def _leg(
        self, start: tuple[int, int, float], end: tuple[int, int, float], way: int
    ) -> tuple[RouteStep, ...] | None:
        """The shortest way that the lane itself leads along, as who drives there changes no lanes; else any way."""
        (road, lane, s), (target, _, target_s) = start, end
        if road == target and (target_s - s) * way >= 0.0:
            return (RouteStep(road, way, s, target_s),)
        for own_lane in (lane, None):
            path = self._shortest_way((road, way), own_lane, target, s)
            if path is not None:
                steps = [RouteStep(road, way, s, self.roads[road].length if way > 0 else 0.0)]
                for index, entry in path:
                    length = self.roads[index].length
                    steps.append(RouteStep(index, entry, *((0.0, length) if entry > 0 else (length, 0.0))))
                steps[-1] = steps[-1]._replace(s_end=target_s)
                return tuple(steps)
        return None

    def _shortest_way(self, start: End, lane: int | None, target: int, s: float) -> tuple[End, ...] | None:
        """Roads from a place to another road, on a lane and those it leads into; None: lanes may be changed."""
        road, way = start
        room = self.roads[road].length - s if way > 0 else s
        queue: list[tuple[float, int, End, int | None, tuple[End, ...]]] = []
        count = 0
        for following, onto in self._drivable(start, lane, s):
            heappush(queue, (room, count, following, onto, (following,)))
            count += 1
        done: set[tuple[End, int | None]] = set()
        while queue:
            length, _, here, on, path = heappop(queue)
            if (here, on) in done:
                continue
            done.add((here, on))
            if here[0] == target:
                return path
            for following, onto in self._drivable(here, on):
                if (following, onto) not in done:
                    count += 1
                    heappush(queue, (length + self.roads[here[0]].length, count, following, onto, (*path, following)))
        return None

    def _drivable(self, here: End, lane: int | None, s: float | None = None) -> Iterator[tuple[End, int | None]]:
        """Road ends, and lanes there, that a lane leads to; without one those that any driving lane of its way does."""
        road, way = here
        section = self.roads[road].sections[-1 if way > 0 else 0]
        reached: dict[tuple[End, int | None], None] = {}
        if lane is None:
            leaving = [way_out.id for way_out in section.lanes if way_out.type in DRIVING and way_out.direction == way]
        else:
            leaving = [found for found in (_at_end(self.roads[road], way, lane, s),) if found is not None]
        for way_out in leaving:
            for link in self.next_lanes(road, way_out, way):
                reached[(link.road, link.direction), None if lane is None else link.lane] = None
        yield from reached


def _at_end(road: Road, way: int, lane: int, s: float | None) -> int | None:
    """What a lane has become where the road is left; None if it ends before."""
    sections = list(road.sections)[::way]
    if s is not None:
        sections = sections[sections.index(road.section_at(s)) :]
    for section, beyond in pairwise(sections):
        onward = follow_section(road, section, beyond, lane, way)
        if onward is None:
            return None
        lane = onward
    return lane
