"""AssignRouteAction and AcquirePositionAction: which way to take at junctions."""

from __future__ import annotations

from xosc_lateral.motion.actions.base import RunningAction
from xosc_lateral.motion.positions.resolve import resolve, route_guide
from xosc_lateral.motion.routes import guide
from xosc_lateral.motion.state import Placement
from xosc_lateral.scenario.actions import AcquirePositionAction, AssignRouteAction


class RunningAssignRoute(RunningAction):
    """The route holds until another one is assigned; the action itself is over at once."""

    content: AssignRouteAction

    def start(self) -> None:
        """Look for the way over the waypoints."""
        route = route_guide(self.content.route, self.run)
        if route is None:
            self.note(f"no way leads along route '{self.content.route.name}': it is not followed")
        self.state.route = route


class RunningAcquirePosition(RunningAction):
    """The shortest way from here to there becomes the route; nothing stops the entity there."""

    content: AcquirePositionAction

    def start(self) -> None:
        """Look for the way."""
        state = self.state
        state.locate()
        here = Placement(state.road, state.lane, state.s, state.offset_t, state.relative_heading)
        route = guide(self.run.network, [here, resolve(self.content.position, self.run)])
        if route is None:
            self.note("no way leads to the position: it is not acquired")
        state.route = route
