"""Private actions that are done at once: teleport, routes, controllers, trailers, appearance."""

from __future__ import annotations

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.playback.actions.base import Domain, RunningAction
from xosc_lateral.playback.positions.resolve import resolve, route_guide
from xosc_lateral.playback.state import Placement, guide
from xosc_lateral.playback.trailers import align_trailers, connect, disconnect
from xosc_lateral.scenario.enums import RouteStrategy
from xosc_lateral.scenario.global_actions import SetMonitorAction, UserDefinedAction
from xosc_lateral.scenario.private_actions import (
    AcquirePositionAction,
    ActivateControllerAction,
    AnimationAction,
    AssignControllerAction,
    AssignRouteAction,
    ConnectTrailerAction,
    DisconnectTrailerAction,
    LightStateAction,
    OverrideControllerValueAction,
    TeleportAction,
    VisibilityAction,
)


class RunningTeleport(RunningAction):
    """Takes effect when it starts. A towed vehicle stays behind its tractor."""

    domains = Domain.BOTH
    content: TeleportAction

    def start(self) -> None:
        """Put the actor there, with its trailers."""
        state = self.state
        place = resolve(self.content.position, self.simulation, route=state.route)
        if state.tow is not None:
            self.note(f"'{state.name}' is towed by '{state.tow.name}': it is not teleported")
            return
        state.put(place)
        state.teleported = True
        state.longitudinal_taken = state.speed_taken = True
        state.activity |= Activity.TELEPORTED
        align_trailers(state)


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


class RunningController(RunningAction):
    """Assigning, activating or overriding a controller changes nothing here; it is over at once."""

    def start(self) -> None:
        """Say that the default driver drives."""
        name = ""
        if isinstance(self.content, AssignControllerAction) and self.content.controller is not None:
            name = f" '{self.content.controller.name}'"
        self.note(f"controller{name} of '{self.state.name}': the default driver drives instead")
        self.end()


class RunningConnectTrailer(RunningAction):
    """Hitch a trailer; one that hangs on already is left behind."""

    content: ConnectTrailerAction

    def start(self) -> None:
        """Hitch it."""
        trailer = self.simulation.entity(self.content.trailer_ref, self.content.place)
        if trailer is self.state.trailer:
            return
        disconnect(self.state)
        connect(self.state, trailer)


class RunningDisconnectTrailer(RunningAction):
    """Leave the trailer where it is."""

    def start(self) -> None:
        """Let it go."""
        if self.state.trailer is None:
            self.note(f"'{self.state.name}' has no trailer")
        disconnect(self.state)


class RunningAppearance(RunningAction):
    """Over at once; the start is recorded like that of every action."""


class RunningLightState(RunningAction):
    """Over when the light has changed. [s]"""

    content: LightStateAction

    def start(self) -> None:
        """Count from now."""
        self._left = self.content.transition_time

    def step(self, time: float, step: float) -> None:
        """Wait; a light that flashes does so until something else is asked of it."""
        if self._left <= 0.0 and self.content.mode != "flashing":
            self.end()
        self._left -= step


class RunningAnimation(RunningAction):
    """Over after its duration, never when it loops. [s]"""

    content: AnimationAction

    def start(self) -> None:
        """Count from now."""
        self._left = self.content.duration

    def step(self, time: float, step: float) -> None:
        """Wait."""
        if self._left <= 0.0 and not self.content.loop:
            self.end()
        self._left -= step


RUNNING: dict[type, type[RunningAction]] = {
    TeleportAction: RunningTeleport,
    AcquirePositionAction: RunningAcquirePosition,
    AssignRouteAction: RunningAssignRoute,
    ActivateControllerAction: RunningController,
    AssignControllerAction: RunningController,
    OverrideControllerValueAction: RunningController,
    ConnectTrailerAction: RunningConnectTrailer,
    DisconnectTrailerAction: RunningDisconnectTrailer,
    AnimationAction: RunningAnimation,
    LightStateAction: RunningLightState,
    SetMonitorAction: RunningAppearance,
    UserDefinedAction: RunningAppearance,
    VisibilityAction: RunningAppearance,
}
