"""The storyboard as data: frozen elements under the standard's names, parameters, expressions."""

from xosc_lateral.scenario.entity import Axle, Axles, BoundingBox, Controller, Entity, Performance
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
    Condition,
    ConditionGroup,
    Event,
    Init,
    Maneuver,
    ManeuverGroup,
    Private,
    Story,
    Storyboard,
    Trigger,
    TriggeringEntities,
)

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
