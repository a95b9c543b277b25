"""TrafficSignalCondition and TrafficSignalControllerCondition."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import ValueCheck, ValueChecks
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.scenario.conditions.value import TrafficSignalCondition, TrafficSignalControllerCondition


def prepare_signal(content: TrafficSignalCondition, simulation: Simulation) -> ValueCheck:
    """Whether the signal shows that state (of its controller's phase, or set by an action)."""
    return lambda: simulation.signals.state(content.name, simulation.time) == content.state


def prepare_controller(content: TrafficSignalControllerCondition, simulation: Simulation) -> ValueCheck:
    """Whether the controller is in that phase."""
    return lambda: simulation.signals.phase(content.controller_ref, simulation.time) == content.phase


CHECKS: ValueChecks = {TrafficSignalCondition: prepare_signal, TrafficSignalControllerCondition: prepare_controller}
