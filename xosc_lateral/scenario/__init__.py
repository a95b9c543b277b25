"""The storyboard as data: frozen elements under the standard's names, parameters, expressions."""

from xosc_lateral.scenario.entity import Controller, Entity
from xosc_lateral.scenario.place import Place, Unsupported
from xosc_lateral.scenario.scenario import (
    FileHeader,
    Parameter,
    Scenario,
    TrafficSignalController,
    TrafficSignalPhase,
)
from xosc_lateral.scenario.storyboard import (
    Act,
    Action,
    Actors,
    Event,
    Init,
    Maneuver,
    ManeuverGroup,
    Private,
    Story,
    Storyboard,
)
from xosc_lateral.scenario.trigger import Condition, ConditionGroup, Trigger, TriggeringEntities
from xosc_lateral.scenario.vehicle import Axle, Axles, BoundingBox, Performance

__all__ = [
    "Act",
    "Action",
    "Actors",
    "Axle",
    "Axles",
    "BoundingBox",
    "Condition",
    "ConditionGroup",
    "Controller",
    "Entity",
    "Event",
    "FileHeader",
    "Init",
    "Maneuver",
    "ManeuverGroup",
    "Parameter",
    "Performance",
    "Place",
    "Private",
    "Scenario",
    "Story",
    "Storyboard",
    "TrafficSignalController",
    "TrafficSignalPhase",
    "Trigger",
    "TriggeringEntities",
    "Unsupported",
]
