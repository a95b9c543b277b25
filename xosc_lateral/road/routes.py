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

from xosc_lateral.road.lanes import DRIVING
from xosc_lateral.road.links import End, Links
from xosc_lateral.road.positions import RoadPath, RouteStep


def path_between(
    links: Links, start: tuple[int, float], end: tuple[int, float], *, direction: int = 1, limit: float = inf
) -> RoadPath | None:
    """Shortest way along reference lines (see `RoadNetwork.path_between`). Distances in [m]."""
    best: RoadPath | None = None
    (road, s), (target, target_s) = start, end
    if road == target:
        best = RoadPath((target_s - s) * direction, 1 if target_s >= s else -1, ())
    for way in (1, -1):
        room = links.roads[road].length - s if way > 0 else s
        reach = min(limit, abs(best.ds) if best is not None else inf)
        found = _search(links, road, way, room, target, target_s, reach)
        if found is not None and (best is None or found[0] < abs(best.ds)):
            best = RoadPath(found[0] * way * direction, way, found[1])
    return best if best is not None and abs(best.ds) <= limit else None


def _search(
    links: Links, road: int, way: int, room: float, target: int, target_s: float, limit: float
) -> tuple[float, tuple[End, ...]] | None:
    """Dijkstra over road ends: length to `target_s` on `target` when leaving `road` in direction `way`, and the way."""
    queue: list[tuple[float, End, tuple[End, ...]]] = [(room, end, (end,)) for end in links.next_roads(road, way)]
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
            arrival = length + (target_s if entry > 0 else links.roads[index].length - target_s)
            if best is None or arrival < best[0]:
                best = arrival, path
        for following in links.next_roads(index, entry):
            if following not in done:
                heappush(queue, (length + links.roads[index].length, following, (*path, following)))
    return best


def route(
    links: Links,
    start: tuple[int, int, float],
    end: tuple[int, int, float],
    *,
    via: Sequence[tuple[int, int, float]] = (),
) -> tuple[RouteStep, ...] | None:
    """Shortest drivable way (see `RoadNetwork.route`). Distances in [m]."""
    steps: list[RouteStep] = []
    stops = [start, *via, end]
    way = links.roads[start[0]].directions.get(start[1], 1)
    for leg_start, leg_end in pairwise(stops):
        leg = _leg(links, leg_start, leg_end, way)
        if leg is None:
            return None
        if steps and steps[-1].road == leg[0].road and steps[-1].direction == leg[0].direction:
            leg = (leg[0]._replace(s_start=steps.pop().s_start), *leg[1:])
        steps += leg
        way = steps[-1].direction
    return tuple(steps)


def _leg(
    links: Links, start: tuple[int, int, float], end: tuple[int, int, float], way: int
) -> tuple[RouteStep, ...] | None:
    (road, _, s), (target, _, target_s) = start, end
    if road == target and (target_s - s) * way >= 0.0:
        return (RouteStep(road, way, s, target_s),)
    room = links.roads[road].length - s if way > 0 else s
    queue: list[tuple[float, int, End, tuple[End, ...]]] = []
    count = 0
    for following in _drivable(links, road, way):
        heappush(queue, (room, count, following, (following,)))
        count += 1
    done: set[End] = set()
    while queue:
        length, _, here, path = heappop(queue)
        if here in done:
            continue
        done.add(here)
        if here[0] == target:
            return _steps(links, (road, way, s), path, target_s)
        for following in _drivable(links, *here):
            if following not in done:
                count += 1
                heappush(queue, (length + links.roads[here[0]].length, count, following, (*path, following)))
    return None


def _drivable(links: Links, road: int, way: int) -> Iterator[End]:
    """Road ends reached by a driving lane in its travel direction (lanes may be changed on the road)."""
    section = links.roads[road].sections[-1 if way > 0 else 0]
    reached: dict[End, None] = {}
    for lane in section.lanes:
        if lane.type in DRIVING and lane.direction == way:
            for link in links.next_lanes(road, lane.id, way):
                reached[(link.road, link.direction)] = None
    yield from reached


def _steps(links: Links, start: tuple[int, int, float], path: Sequence[End], target_s: float) -> tuple[RouteStep, ...]:
    road, way, s = start
    steps = [RouteStep(road, way, s, links.roads[road].length if way > 0 else 0.0)]
    for index, entry in path:
        length = links.roads[index].length
        steps.append(RouteStep(index, entry, *((0.0, length) if entry > 0 else (length, 0.0))))
    steps[-1] = steps[-1]._replace(s_end=target_s)
    return tuple(steps)
