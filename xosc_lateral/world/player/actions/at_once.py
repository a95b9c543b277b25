"""Actions that are done at once, or only take time: global ones, places, routes, controllers, trailers, lights."""

from __future__ import annotations

from xosc_lateral.world.motion.nominal import Activity, FollowedRoute
from xosc_lateral.world.player.actions.base import AtOnce, Domain, Maker, RunningPrivateAction, at_once
from xosc_lateral.world.player.drive import align_trailers, connect, disconnect
from xosc_lateral.world.player.positions.resolve import resolve, route_guide
from xosc_lateral.world.player.state import RouteGuide, guide
from xosc_lateral.world.scenario import global_actions, private_actions
from xosc_lateral.world.scenario.controllers import Domains
from xosc_lateral.world.scenario.enums import RouteStrategy
from xosc_lateral.world.scenario.place import Unsupported

SetAction = global_actions.ParameterSetAction | global_actions.VariableSetAction
ModifyAction = global_actions.ParameterModifyAction | global_actions.VariableModifyAction


def environment(content: global_actions.EnvironmentAction, action: AtOnce) -> None:
    """Only the time of day matters to playback; the rest is recorded with the start of the action."""
    clock = content.environment.time_of_day
    if clock is not None:
        action.simulation.time_of_day = (clock.date_time, clock.animation, action.simulation.time)


def set_value(content: SetAction, action: AtOnce) -> None:
    """Conditions see the new value from now on; what was read from the file before does not change."""
    values, name = action.simulation.values_of(content)
    if name in values:
        values.set(name, content.value)
    else:
        action.note(f"{values.kind} '{name}' is not declared: nothing is set")


def modify_value(content: ModifyAction, action: AtOnce) -> None:
    """Add to a value, or multiply it."""
    values, name = action.simulation.values_of(content)
    if name not in values:
        action.note(f"{values.kind} '{name}' is not declared: nothing is modified")
    elif not values.modify(name, content.operation, content.value):
        action.note(f"{values.kind} '{name}' is not a number: nothing is modified")


def signal_state(content: global_actions.TrafficSignalStateAction, action: AtOnce) -> None:
    """A signal shows a state from now on."""
    action.simulation.signals.set_state(content.name, content.state, action.simulation.time)


def signal_phase(content: global_actions.TrafficSignalControllerAction, action: AtOnce) -> None:
    """A signal controller goes to a phase."""
    controller, phase = content.controller_ref, content.phase
    if not action.simulation.signals.go_to_phase(controller, phase, action.simulation.time):
        action.note(f"no signal controller '{controller}' with a phase '{phase}'")


def add_entity(content: global_actions.AddEntityAction, action: AtOnce) -> None:
    """The entity appears at the position, with the speed that it had when it was taken out (at first: none)."""
    state = action.simulation.entity(content.entity_ref, content.place)
    if state.active:
        action.note(f"'{state.name}' exists already: it is not added")
        return
    state.active = True
    state.put(resolve(content.position, action.simulation))
    state.teleported = True
    state.activity = Activity.ACTIVE | Activity.TELEPORTED


def delete_entity(content: global_actions.DeleteEntityAction, action: AtOnce) -> None:
    """The entity is gone, and with it what it was doing; trailers are left behind."""
    state = action.simulation.entity(content.entity_ref, content.place)
    state.active = False
    state.activity = 0
    disconnect(state)
    if state.tow is not None:
        disconnect(state.tow)
    for running in state.actions:
        if running.is_running:
            running.end()


def traffic(content: global_actions.TrafficAction, action: AtOnce) -> None:
    """Traffic of a tool's own making: no file says where its cars are."""
    action.note(f"{content.kind}: its vehicles are made by the simulator and are not played")


def unsupported(content: Unsupported, action: AtOnce) -> None:
    """Named, and over at once."""
    action.note(content.reason or f"{content.kind} is not played")


def recorded(content: object, action: AtOnce) -> None:
    """The start is recorded like that of every action; nothing moves."""


# ---- Private actions that are done at once, or only take time: te ----
def teleport(content: private_actions.TeleportAction, action: AtOnce) -> None:
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


def assign_route(content: private_actions.AssignRouteAction, action: AtOnce) -> None:
    """The route holds until another one is assigned."""
    others = {waypoint.strategy for waypoint in content.route.waypoints} - {RouteStrategy.SHORTEST}
    if others:
        action.note(f"routeStrategy {', '.join(sorted(others))}: the shortest way is taken")
    _follow(action, route_guide(content.route, action.simulation), f"route '{content.route.name}'")


def acquire_position(content: private_actions.AcquirePositionAction, action: AtOnce) -> None:
    """The shortest way from here to there becomes the route; nothing stops the entity there."""
    state = action.actor
    state.locate()
    there = resolve(content.position, action.simulation)
    _follow(action, guide(state.network, [state.place, there]), "a way to the position")


def _follow(action: AtOnce, route: RouteGuide | None, what: str) -> None:
    """Take a route, and say where it needs lane changes: it decides at junctions, and makes none."""
    action.actor.route = route
    if route is None:
        action.note(f"no way leads along {what}: it is not followed")
        return
    simulation = action.simulation
    place = action.content.place
    simulation.routes.append(FollowedRoute(action.actor.name, simulation.time, route.steps, route.stops, place))
    for step in route.steps:
        if step.missed:
            where = f"lane {step.missed} of road '{route.network.road_ids[step.road]}'"
            action.note(f"{what} comes to {where} by lane changes only, which others have to make")


def controller(content: object, action: AtOnce) -> None:
    """Who drives which domain from now on is written down; the default driver drives all the same."""
    state, controllers = action.actor, action.actor.controllers
    controllers.follow(content)
    state.steered = int(Activity.STEERED) if Domains.LATERAL in controllers.domains else 0
    state.activity = state.activity & ~int(Activity.STEERED) | state.steered
    if words := controllers.words():
        since = f"from {action.simulation.time:.2f} s on"
        action.note(f"'{state.name}' is driven by controller {words} {since}: the default driver drives instead")
    action.end()


def connect_trailer(content: private_actions.ConnectTrailerAction, action: AtOnce) -> None:
    """Hitch a trailer; one that hangs on already is left behind."""
    trailer = action.simulation.entity(content.trailer_ref, content.place)
    if trailer is not action.actor.trailer:
        disconnect(action.actor)
        connect(action.actor, trailer)


def disconnect_trailer(content: private_actions.DisconnectTrailerAction, action: AtOnce) -> None:
    """Leave the trailer where it is."""
    if action.actor.trailer is None:
        action.note(f"'{action.actor.name}' has no trailer")
    disconnect(action.actor)


class RunningForTime(RunningPrivateAction):
    """Over after its time; what flashes or loops does so until something else is asked of it. [s]"""

    content: private_actions.LightStateAction | private_actions.AnimationAction

    def _begin(self) -> None:
        if isinstance(self.content, private_actions.LightStateAction):
            self._left, self._goes_on = self.content.transition_time, self.content.mode == "flashing"
        else:
            self._left, self._goes_on = self.content.duration, self.content.loop

    def _act(self, time: float, step: float) -> None:
        if self._left <= 0.0 and not self._goes_on:
            self.end()
        self._left -= step


RUNNING: dict[type, Maker] = {
    global_actions.EnvironmentAction: at_once(environment),
    global_actions.ParameterModifyAction: at_once(modify_value),
    global_actions.ParameterSetAction: at_once(set_value),
    global_actions.TrafficSignalControllerAction: at_once(signal_phase),
    global_actions.TrafficSignalStateAction: at_once(signal_state),
    global_actions.VariableModifyAction: at_once(modify_value),
    global_actions.VariableSetAction: at_once(set_value),
    global_actions.AddEntityAction: at_once(add_entity),
    global_actions.DeleteEntityAction: at_once(delete_entity),
    global_actions.SetMonitorAction: at_once(recorded),
    global_actions.TrafficAction: at_once(traffic),
    Unsupported: at_once(unsupported),
    global_actions.UserDefinedAction: at_once(recorded),
    private_actions.TeleportAction: at_once(teleport, Domain.BOTH),
    # as in the reference player: an action on speed or distance ends when it begins
    private_actions.AcquirePositionAction: at_once(acquire_position, Domain.LONGITUDINAL),
    private_actions.AssignRouteAction: at_once(assign_route),
    private_actions.ActivateControllerAction: at_once(controller),
    private_actions.AssignControllerAction: at_once(controller),
    private_actions.OverrideControllerValueAction: at_once(controller),
    private_actions.ConnectTrailerAction: at_once(connect_trailer),
    private_actions.DisconnectTrailerAction: at_once(disconnect_trailer),
    private_actions.AnimationAction: RunningForTime,
    private_actions.LightStateAction: RunningForTime,
    private_actions.VisibilityAction: at_once(recorded),
}
