"""Building blocks of a maneuver-based scenario, on top of scenariogeneration: vehicles, starts, events, triggers.

Speeds and distances are numbers or names of declared parameters (``"$ego_speed"``). [m/s], [m], [s]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from xosc_lateral.templates.motorway import FIXED_DATE, ROAD, Motorway, document
from xosc_lateral.templates.parameter import Number, Parameter, Settings
from xosc_lateral.templates.surroundings import environment_action

Value = float | str


class Vehicle(Enum):
    """What drives: model name (of CARLA's library, so that its ScenarioRunner finds it), category, size."""

    CAR = ("vehicle.tesla.model3", "car", 4.8, 1.9, 1.5, 1.45, 2.9, 65.0, 4.5, 1800.0)
    VAN = ("vehicle.mercedes.sprinter", "van", 5.9, 2.0, 2.6, 1.7, 3.7, 50.0, 3.0, 3200.0)
    TRUCK = ("vehicle.carlamotors.european_hgv", "truck", 7.9, 2.5, 3.5, 2.6, 5.2, 28.0, 1.5, 18000.0)

    @property
    def front(self) -> float:
        """From the reference point to the front. [m]"""
        return float(self.value[5] + 0.5 * self.value[2])

    @property
    def rear(self) -> float:
        """From the reference point back to the rear. [m]"""
        return float(0.5 * self.value[2] - self.value[5])

    def definition(self, *, is_ego: bool) -> Any:
        """Inline `Vehicle` element; the reference point is the middle of the rear axle."""
        from scenariogeneration import xosc

        model, category, length, width, height, centre, wheelbase, max_speed, max_acceleration, mass = self.value
        vehicle = xosc.Vehicle(
            model,
            getattr(xosc.VehicleCategory, category),
            xosc.BoundingBox(width, length, height, centre, 0.0, 0.5 * height),
            xosc.Axle(0.5, 0.7, 0.85 * width, wheelbase, 0.35),
            xosc.Axle(0.0, 0.7, 0.85 * width, 0.0, 0.35),
            max_speed,
            max_acceleration,
            9.0,
            mass,
        )
        # CARLA's ScenarioRunner hands the vehicle of type ego_vehicle to the system under test
        vehicle.add_property("type", "ego_vehicle" if is_ego else "simulation")
        return vehicle


@dataclass(frozen=True, slots=True)
class Actor:
    """A vehicle and where it starts.

    Parameters
    ----------
    name : str
    vehicle : Vehicle
    lane : int
        Driving lane, 0 is the slow one.
    s : float
        [m]
    speed : float or str
        [m/s]
    """

    name: str
    vehicle: Vehicle
    lane: int
    s: float
    speed: Value


@dataclass(frozen=True, slots=True)
class PlannedEvent:
    """One event of one vehicle.

    Parameters
    ----------
    actor : str
    name : str
        Unique in the scenario.
    action, trigger : object
        Of scenariogeneration.
    """

    actor: str
    name: str
    action: Any
    trigger: Any


@dataclass(frozen=True, slots=True)
class Plot:
    """A whole scenario before it becomes XML.

    Parameters
    ----------
    what : str
        Description for the file header.
    motorway : Motorway
    actors : tuple of Actor
        The first one is the ego vehicle.
    steps : tuple of PlannedEvent
    duration : float
        The scenario ends then. [s]
    declared : tuple of str
        Settings that become declared parameters of the scenario, as they are used by name in it.
    """

    what: str
    motorway: Motorway
    actors: tuple[Actor, ...]
    steps: tuple[PlannedEvent, ...] = field(default=())
    duration: float = 50.0
    declared: tuple[str, ...] = ()

    def to_xml(self, road_file: str, settings: Settings, parameters: Sequence[Parameter]) -> str:
        """The scenario as an OpenSCENARIO document, the same bytes each time."""
        from scenariogeneration import xosc

        minor = int(settings.text("version").split(".")[1])
        # the library writes elements after the version of the last scenario made: begin with this one
        xosc.VersionBase().setVersion(minor=minor)
        by_name = {parameter.name: parameter for parameter in parameters}
        declarations = xosc.ParameterDeclarations()
        for name in self.declared:
            assert isinstance(by_name[name], Number), "only numbers are declared"
            value = f"{settings.number(name):g}"
            declarations.add_parameter(xosc.Parameter(name, xosc.ParameterType.double, value))
        entities = xosc.Entities()
        for actor in self.actors:
            entities.add_scenario_object(actor.name, actor.vehicle.definition(is_ego=actor is self.actors[0]))
        scenario = xosc.Scenario(
            self.what,
            "xosc-lateral",
            declarations,
            entities,
            self._storyboard(environment_action(settings)),
            xosc.RoadNetwork(road_file),
            xosc.Catalog(),
            osc_minor_version=minor,
            creation_date=FIXED_DATE,
        )
        return document(scenario.get_element())

    def _storyboard(self, environment: Any) -> Any:
        from scenariogeneration import xosc

        init = xosc.Init()
        init.add_global_action(environment)
        for actor in self.actors:
            place = xosc.LanePosition(actor.s, 0, self.motorway.lane(actor.lane), ROAD)
            init.add_init_action(actor.name, xosc.TeleportAction(place))
            init.add_init_action(actor.name, speed_action(actor.speed))
        board = xosc.StoryBoard(init, at_time(self.duration, point="stop"))
        act = xosc.Act("Act", at_time(0.0))
        for name, steps in self._steps_by_actor().items():
            maneuver = xosc.Maneuver(f"{name}Maneuver")
            for step in steps:
                event = xosc.Event(step.name, xosc.Priority.parallel)
                event.add_action(f"{step.name}Action", step.action)
                event.add_trigger(step.trigger)
                maneuver.add_event(event)
            group = xosc.ManeuverGroup(f"{name}Group")
            group.add_actor(name)
            group.add_maneuver(maneuver)
            act.add_maneuver_group(group)
        if self.steps:
            story = xosc.Story("Story")
            story.add_act(act)
            board.add_story(story)
        return board

    def _steps_by_actor(self) -> Mapping[str, list[PlannedEvent]]:
        ordered: dict[str, list[PlannedEvent]] = {}
        for step in self.steps:
            ordered.setdefault(step.actor, []).append(step)
        return ordered


def speed_action(speed: Value, *, rate: Value | None = None) -> Any:
    """To that speed: at once, or with a constant acceleration of `rate` [m/s2]."""
    from scenariogeneration import xosc

    if rate is None:
        dynamics = xosc.TransitionDynamics(xosc.DynamicsShapes.step, xosc.DynamicsDimension.time, 0)
    else:
        dynamics = xosc.TransitionDynamics(xosc.DynamicsShapes.linear, xosc.DynamicsDimension.rate, rate)
    return xosc.AbsoluteSpeedAction(speed, dynamics)


def lane_change(lane: int, duration: Value) -> Any:
    """To that OpenDRIVE lane in so many seconds."""
    from scenariogeneration import xosc

    dynamics = xosc.TransitionDynamics(xosc.DynamicsShapes.sinusoidal, xosc.DynamicsDimension.time, duration)
    return xosc.AbsoluteLaneChangeAction(lane, dynamics)


def at_time(time: Value, *, point: str = "start") -> Any:
    """Once that much time has passed."""
    from scenariogeneration import xosc

    return xosc.ValueTrigger(
        f"{point.capitalize()}At{str(time).removeprefix('$')}s",
        0,
        xosc.ConditionEdge.none,
        xosc.SimulationTimeCondition(time, xosc.Rule.greaterOrEqual),
        triggeringpoint=point,
    )


def after(event: str, delay: Value = 0, *, state: str = "endTransition") -> Any:
    """Once another event has ended (or, with ``startTransition``, begun) and a delay has passed."""
    from scenariogeneration import xosc

    condition = xosc.StoryboardElementStateCondition(
        xosc.StoryboardElementType.event, event, getattr(xosc.StoryboardElementState, state)
    )
    return xosc.ValueTrigger(f"After{event}", delay, xosc.ConditionEdge.none, condition)


def headway(follower: str, leader: str, rule: str, value: Value, *, not_before: float = 0.0) -> Any:
    """Once the time headway of `follower` to `leader`, along the road, is ``lessThan`` or ``greaterThan`` a value [s].

    `not_before` holds the trigger back [s]: some players also measure a headway to a vehicle that is still behind.
    """
    from scenariogeneration import xosc

    condition = xosc.TimeHeadwayCondition(
        leader,
        value,
        getattr(xosc.Rule, rule),
        freespace=False,
        distance_type=xosc.RelativeDistanceType.longitudinal,
        coordinate_system=xosc.CoordinateSystem.road,
    )
    return _held_back(_entity_trigger(f"{follower}HeadwayTo{leader}", condition, follower), not_before)


def closer_than(follower: str, leader: str, distance: Value) -> Any:
    """Once the reference points are closer than that along the road. [m]"""
    from scenariogeneration import xosc

    condition = xosc.RelativeDistanceCondition(
        distance,
        xosc.Rule.lessThan,
        xosc.RelativeDistanceType.longitudinal,
        leader,
        freespace=False,
        coordinate_system=xosc.CoordinateSystem.road,
    )
    return _entity_trigger(f"{follower}CloseTo{leader}", condition, follower)


def _entity_trigger(name: str, condition: Any, triggering: str) -> Any:
    from scenariogeneration import xosc

    return xosc.EntityTrigger(name, 0, xosc.ConditionEdge.none, condition, triggering)


def _held_back(trigger: Any, not_before: float) -> Any:
    from scenariogeneration import xosc

    if not_before <= 0.0:
        return trigger
    group = xosc.ConditionGroup()
    group.add_condition(at_time(round(not_before, 3)))
    group.add_condition(trigger)
    return group
