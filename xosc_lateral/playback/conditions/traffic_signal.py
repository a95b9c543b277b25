"""TrafficSignalCondition and TrafficSignalControllerCondition."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import ValueCheck
from xosc_lateral.playback.run import Run
from xosc_lateral.scenario.conditions import TrafficSignalCondition, TrafficSignalControllerCondition


def prepare_signal(content: TrafficSignalCondition, run: Run) -> ValueCheck:
    """Whether the signal shows that state (of its controller's phase, or set by an action)."""
    return lambda: run.signals.state(content.name, run.time) == content.state


def prepare_controller(content: TrafficSignalControllerCondition, run: Run) -> ValueCheck:
    """Whether the controller is in that phase."""
    return lambda: run.signals.phase(content.controller_ref, run.time) == content.phase
