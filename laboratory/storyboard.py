"""Building blocks of a maneuver-based scenario, on top of scenariogeneration: vehicles, starts, events, triggers.

Speeds and distances are numbers or names of declared parameters (``"$ego_speed"``). [m/s], [m], [s]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from xosc_lateral.files.templates.template import FIXED_DATE, ROAD, Motorway, document

Value = float | str


def lane_id(motorway: Motorway, index: int) -> int:
    """OpenDRIVE id of a driving lane; 0 is the slow lane beside the hard shoulder."""
    number = motorway.lanes - index
    return number if motorway.left_hand else -number


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
    """

    what: str
    motorway: Motorway
    actors: tuple[Actor, ...]
    steps: tuple[PlannedEvent, ...] = field(default=())
    duration: float = 50.0

    def to_xml(self, road_file: str) -> str:
        """The scenario as an OpenSCENARIO document, the same bytes each time."""
        from scenariogeneration import xosc

        # the library writes elements after the version of the last scenario made: begin with this one
        xosc.VersionBase().setVersion(minor=2)
        entities = xosc.Entities()
        for actor in self.actors:
            entities.add_scenario_object(actor.name, actor.vehicle.definition(is_ego=actor is self.actors[0]))
        scenario = xosc.Scenario(
            self.what,
            "xosc-lateral",
            xosc.ParameterDeclarations(),
            entities,
            self._storyboard(),
            xosc.RoadNetwork(road_file),
            xosc.Catalog(),
            osc_minor_version=2,
            creation_date=FIXED_DATE,
        )
        return document(scenario.get_element())

    def _storyboard(self) -> Any:
        from scenariogeneration import xosc

        init = xosc.Init()
        for actor in self.actors:
            place = xosc.LanePosition(actor.s, 0, lane_id(self.motorway, actor.lane), ROAD)
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
