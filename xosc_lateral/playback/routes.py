"""Routes: which way an entity takes at junctions."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec import Struct

from xosc_lateral.playback.angles import is_forward
from xosc_lateral.playback.placement import NOWHERE, Placement
from xosc_lateral.road import LaneLink, RoadNetwork, RouteStep


class RouteGuide(Struct, frozen=True):
    """A way over roads. It decides at junctions only; between them, the lane is followed.

    Parameters
    ----------
    network : RoadNetwork
    steps : tuple of RouteStep
    """

    network: RoadNetwork
    steps: tuple[RouteStep, ...]

    def choose(self, road: int, options: Sequence[LaneLink]) -> LaneLink | None:
        """The link that leads along the route, be it by another connecting road; None: the route does not say."""
        roads = [step.road for step in self.steps]
        for index in (index for index, other in enumerate(roads) if other == road):
            found = self._towards(roads[index + 1 :], options)
            if found is not None:
                return found
        return None

    def _towards(self, ahead: Sequence[int], options: Sequence[LaneLink]) -> LaneLink | None:
        for link in options:
            if ahead and link.road == ahead[0]:
                return link
        for link in reversed(options):
            onward = self.network.next_lanes(link.road, link.lane, link.direction)
            if len(ahead) > 1 and any(following.road == ahead[1] for following in onward):
                return link
        return None

    def at(self, path_s: float) -> tuple[int, float, int]:
        """Road, s and direction after `path_s` metres of the route; its end beyond it. [m]"""
        left = max(path_s, 0.0)
        for step in self.steps:
            length = abs(step.s_end - step.s_start)
            if left <= length or step is self.steps[-1]:
                return step.road, step.s_start + step.direction * min(left, length), step.direction
            left -= length
        raise AssertionError("a route has steps")


def guide(network: RoadNetwork, stops: Sequence[Placement]) -> RouteGuide | None:
    """The shortest way over the stops; None: there is none."""
    if len(stops) < 2 or any(stop.road == NOWHERE for stop in stops):
        return None
    first, *via, last = [(stop.road, stop.lane, stop.s) for stop in stops]
    ways = [1 if is_forward(stop.relative_heading) else -1 for stop in stops]
    steps = network.route(first, last, via=via, ways=ways)
    return None if steps is None else RouteGuide(network, steps)
