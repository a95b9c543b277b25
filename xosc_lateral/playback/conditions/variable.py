"""VariableCondition: a variable's present value."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import ValueCheck
from xosc_lateral.playback.run import Run
from xosc_lateral.scenario.conditions import VariableCondition


def prepare(content: VariableCondition, run: Run) -> ValueCheck:
    """Compare in the variable's own type; false for a variable that is not declared."""

    def check() -> bool:
        if content.variable_ref not in run.variables:
            run.note(f"variable '{content.variable_ref}' is not declared: the condition stays false", content.place)
            return False
        return run.variables.compare(content.variable_ref, content.rule, content.value)

    return check
