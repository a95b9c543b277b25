"""SimulationTimeCondition: time since the scenario's start."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import ValueCheck, ValueChecks
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.values import holds
from xosc_lateral.scenario.conditions.value import SimulationTimeCondition


def prepare(content: SimulationTimeCondition, simulation: Simulation) -> ValueCheck:
    """Compare the time at the start of the frame. [s]"""
    return lambda: holds(simulation.time, content.rule, content.value)


CHECKS: ValueChecks = {SimulationTimeCondition: prepare}
