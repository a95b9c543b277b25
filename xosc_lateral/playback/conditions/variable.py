"""VariableCondition: a variable's present value."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import ValueCheck, ValueChecks
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.scenario.conditions.value import VariableCondition


def prepare(content: VariableCondition, simulation: Simulation) -> ValueCheck:
    """Compare in the variable's own type; false for a variable that is not declared."""

    def check() -> bool:
        if content.variable_ref not in simulation.variables:
            simulation.note(
                f"variable '{content.variable_ref}' is not declared: the condition stays false", content.place
            )
            return False
        return simulation.variables.compare(content.variable_ref, content.rule, content.value)

    return check


CHECKS: ValueChecks = {VariableCondition: prepare}
