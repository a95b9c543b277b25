"""ParameterCondition: a parameter's present value."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import ValueCheck, ValueChecks
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.scenario.conditions.value import ParameterCondition


def prepare(content: ParameterCondition, simulation: Simulation) -> ValueCheck:
    """Compare in the parameter's own type; false for a parameter that is not declared globally."""

    def check() -> bool:
        if content.parameter_ref not in simulation.parameters:
            simulation.note(
                f"parameter '{content.parameter_ref}' is not declared: the condition stays false", content.place
            )
            return False
        return simulation.parameters.compare(content.parameter_ref, content.rule, content.value)

    return check


CHECKS: ValueChecks = {ParameterCondition: prepare}
