"""Private actions that are done at once: teleport, routes, controllers, trailers, appearance."""

from __future__ import annotations

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.playback.actions.base import Domain, RunningAction, RunningPrivateAction
from xosc_lateral.playback.positions.resolve import resolve, route_guide
from xosc_lateral.playback.state import guide
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


class RunningTeleport(RunningPrivateAction):
    """Takes effect when it starts. A towed vehicle stays behind its tractor."""

    domains = Domain.BOTH
    content: TeleportAction

    def _begin(self) -> None:
        state = self.actor
        place = resolve(self.content.position, self.simulation, route=state.route)
        if state.tow is not None:
            self._note(f"'{state.name}' is towed by '{state.tow.name}': it is not teleported")
            return
        state.put(place)
        state.teleported = True
        state.longitudinal_taken = state.speed_taken = True
        state.activity |= Activity.TELEPORTED
        align_trailers(state)


class RunningAssignRoute(RunningPrivateAction):
    """The route holds until another one is assigned; the action itself is over at once."""

    content: AssignRouteAction

    def _begin(self) -> None:
        others = {waypoint.strategy for waypoint in self.content.route.waypoints} - {RouteStrategy.SHORTEST}
        if others:
            self._note(f"routeStrategy {', '.join(sorted(others))}: the shortest way is taken")
        route = route_guide(self.content.route, self.simulation)
        if route is None:
            self._note(f"no way leads along route '{self.content.route.name}': it is not followed")
        self.actor.route = route


class RunningAcquirePosition(RunningPrivateAction):
    """The shortest way from here to there becomes the route; nothing stops the entity there."""

    domains = Domain.LONGITUDINAL
    """As in the reference player: an action on speed or distance ends when it begins."""
    content: AcquirePositionAction

    def _begin(self) -> None:
        state = self.actor
        state.locate()
        route = guide(self.simulation.network, [state.place, resolve(self.content.position, self.simulation)])
        if route is None:
            self._note("no way leads to the position: it is not acquired")
        state.route = route


class RunningController(RunningPrivateAction):
    """Assigning, activating or overriding a controller changes nothing here; it is over at once."""

    def _begin(self) -> None:
        name = ""
        if isinstance(self.content, AssignControllerAction) and self.content.controller is not None:
            name = f" '{self.content.controller.name}'"
        self._note(f"controller{name} of '{self.actor.name}': the default driver drives instead")
        self.end()


class RunningConnectTrailer(RunningPrivateAction):
    """Hitch a trailer; one that hangs on already is left behind."""

    content: ConnectTrailerAction

    def _begin(self) -> None:
        trailer = self.simulation.entity(self.content.trailer_ref, self.content.place)
        if trailer is self.actor.trailer:
            return
        disconnect(self.actor)
        connect(self.actor, trailer)


class RunningDisconnectTrailer(RunningPrivateAction):
    """Leave the trailer where it is."""

    def _begin(self) -> None:
        if self.actor.trailer is None:
            self._note(f"'{self.actor.name}' has no trailer")
        disconnect(self.actor)


class RunningAppearance(RunningAction):
    """Over at once; the start is recorded like that of every action."""


class RunningForTime(RunningPrivateAction):
    """Over after its time; what flashes or loops does so until something else is asked of it. [s]"""

    content: LightStateAction | AnimationAction

    def _begin(self) -> None:
        if isinstance(self.content, LightStateAction):
            self._left, self._goes_on = self.content.transition_time, self.content.mode == "flashing"
        else:
            self._left, self._goes_on = self.content.duration, self.content.loop

    def _act(self, time: float, step: float) -> None:
        if self._left <= 0.0 and not self._goes_on:
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
    AnimationAction: RunningForTime,
    LightStateAction: RunningForTime,
    SetMonitorAction: RunningAppearance,
    UserDefinedAction: RunningAppearance,
    VisibilityAction: RunningAppearance,
}
