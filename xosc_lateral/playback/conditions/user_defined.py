"""UserDefinedValueCondition: a value from outside, which playback never learns."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import ValueCheck, ValueChecks
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.scenario.conditions.value import UserDefinedValueCondition


def prepare(content: UserDefinedValueCondition, simulation: Simulation) -> ValueCheck:
    """Always false, which is said."""
    simulation.note(f"value '{content.name}' comes from outside the scenario: the condition stays false", content.place)
    return lambda: False


CHECKS: ValueChecks = {UserDefinedValueCondition: prepare}
