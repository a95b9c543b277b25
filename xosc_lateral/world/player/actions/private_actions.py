"""Private actions that are done at once, or only take time: teleport, routes, controllers, trailers, lights."""

from __future__ import annotations

from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.player.actions.base import AtOnce, Domain, Maker, RunningPrivateAction, at_once
from xosc_lateral.world.player.actions.global_actions import recorded
from xosc_lateral.world.player.positions.resolve import resolve, route_guide
from xosc_lateral.world.player.state import guide
from xosc_lateral.world.player.trailers import align_trailers, connect, disconnect
from xosc_lateral.world.scenario.controllers import Domains
from xosc_lateral.world.scenario.enums import RouteStrategy
from xosc_lateral.world.scenario.private_actions import (
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


def teleport(content: TeleportAction, action: AtOnce) -> None:
    """To a place, with all trailers. A towed vehicle stays behind its tractor."""
    state = action.actor
    place = resolve(content.position, action.simulation, route=state.route)
    if state.tow is not None:
        action.note(f"'{state.name}' is towed by '{state.tow.name}': it is not teleported")
        return
    state.put(place)
    state.teleported = True
    state.longitudinal_taken = state.speed_taken = True
    state.activity |= Activity.TELEPORTED
    align_trailers(state)


def assign_route(content: AssignRouteAction, action: AtOnce) -> None:
    """The route holds until another one is assigned."""
    others = {waypoint.strategy for waypoint in content.route.waypoints} - {RouteStrategy.SHORTEST}
    if others:
        action.note(f"routeStrategy {', '.join(sorted(others))}: the shortest way is taken")
    action.actor.route = route_guide(content.route, action.simulation)
    if action.actor.route is None:
        action.note(f"no way leads along route '{content.route.name}': it is not followed")


def acquire_position(content: AcquirePositionAction, action: AtOnce) -> None:
    """The shortest way from here to there becomes the route; nothing stops the entity there."""
    state = action.actor
    state.locate()
    state.route = guide(state.network, [state.place, resolve(content.position, action.simulation)])
    if state.route is None:
        action.note("no way leads to the position: it is not acquired")


def controller(
    content: ActivateControllerAction | AssignControllerAction | OverrideControllerValueAction, action: AtOnce
) -> None:
    """Who drives which domain from now on is written down; the default driver drives all the same."""
    state, controllers = action.actor, action.actor.controllers
    controllers.follow(content)
    state.steered = int(Activity.STEERED) if Domains.LATERAL in controllers.domains else 0
    state.activity = state.activity & ~int(Activity.STEERED) | state.steered
    if words := controllers.words():
        since = f"from {action.simulation.time:.2f} s on"
        action.note(f"'{state.name}' is driven by controller {words} {since}: the default driver drives instead")
    action.end()


def connect_trailer(content: ConnectTrailerAction, action: AtOnce) -> None:
    """Hitch a trailer; one that hangs on already is left behind."""
    trailer = action.simulation.entity(content.trailer_ref, content.place)
    if trailer is not action.actor.trailer:
        disconnect(action.actor)
        connect(action.actor, trailer)


def disconnect_trailer(content: DisconnectTrailerAction, action: AtOnce) -> None:
    """Leave the trailer where it is."""
    if action.actor.trailer is None:
        action.note(f"'{action.actor.name}' has no trailer")
    disconnect(action.actor)


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


RUNNING: dict[type, Maker] = {
    TeleportAction: at_once(teleport, Domain.BOTH),
    # as in the reference player: an action on speed or distance ends when it begins
    AcquirePositionAction: at_once(acquire_position, Domain.LONGITUDINAL),
    AssignRouteAction: at_once(assign_route),
    ActivateControllerAction: at_once(controller),
    AssignControllerAction: at_once(controller),
    OverrideControllerValueAction: at_once(controller),
    ConnectTrailerAction: at_once(connect_trailer),
    DisconnectTrailerAction: at_once(disconnect_trailer),
    AnimationAction: RunningForTime,
    LightStateAction: RunningForTime,
    VisibilityAction: at_once(recorded),
}
