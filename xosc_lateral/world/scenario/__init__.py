"""The storyboard as data: frozen elements under the standard's names, parameters, expressions."""

from xosc_lateral.world.scenario.entity import BoundingBox, Entity, Performance
from xosc_lateral.world.scenario.place import Place, Unsupported
from xosc_lateral.world.scenario.scenario import (
    Act,
    Action,
    Condition,
    Event,
    FileHeader,
    Init,
    Maneuver,
    ManeuverGroup,
    Parameter,
    Private,
    Scenario,
    Story,
    Storyboard,
    TrafficSignalController,
    Trigger,
)

__all__ = [
    "Act",
    "Action",
    "BoundingBox",
    "Condition",
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
    "Trigger",
    "Unsupported",
]
