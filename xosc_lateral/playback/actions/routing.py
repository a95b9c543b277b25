"""AssignRouteAction and AcquirePositionAction: which way to take at junctions."""

from __future__ import annotations

from xosc_lateral.playback.actions.base import Domain, RunningAction
from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.positions.resolve import resolve, route_guide
from xosc_lateral.playback.routes import guide
from xosc_lateral.scenario.actions.routing import AcquirePositionAction, AssignRouteAction
from xosc_lateral.scenario.enums import RouteStrategy


class RunningAssignRoute(RunningAction):
    """The route holds until another one is assigned; the action itself is over at once."""

    content: AssignRouteAction

    def start(self) -> None:
        """Look for the way over the waypoints: the shortest one."""
        others = {waypoint.strategy for waypoint in self.content.route.waypoints} - {RouteStrategy.SHORTEST}
        if others:
            self.note(f"routeStrategy {', '.join(sorted(others))}: the shortest way is taken")
        route = route_guide(self.content.route, self.simulation)
        if route is None:
            self.note(f"no way leads along route '{self.content.route.name}': it is not followed")
        self.state.route = route


class RunningAcquirePosition(RunningAction):
    """The shortest way from here to there becomes the route; nothing stops the entity there."""

    domains = Domain.LONGITUDINAL
    """As in the reference player: an action on speed or distance ends when it begins."""
    content: AcquirePositionAction

    def start(self) -> None:
        """Look for the way."""
        state = self.state
        state.locate()
        here = Placement(state.road, state.lane, state.s, state.offset_t, state.relative_heading)
        route = guide(self.simulation.network, [here, resolve(self.content.position, self.simulation)])
        if route is None:
            self.note("no way leads to the position: it is not acquired")
        state.route = route


RUNNING: dict[type, type[RunningAction]] = {
    AcquirePositionAction: RunningAcquirePosition,
    AssignRouteAction: RunningAssignRoute,
}
