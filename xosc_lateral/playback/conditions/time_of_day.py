"""TimeOfDayCondition: against the environment's clock."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import ValueCheck, ValueChecks
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.values import holds
from xosc_lateral.scenario.conditions.value import TimeOfDayCondition


def prepare(content: TimeOfDayCondition, simulation: Simulation) -> ValueCheck:
    """False while no environment has said what time it is."""

    def check() -> bool:
        now = simulation.clock()
        if now is None:
            simulation.note("no environment has set the time of day: the condition stays false", content.place)
            return False
        then = content.date_time
        if (now.tzinfo is None) != (then.tzinfo is None):
            now, then = now.replace(tzinfo=None), then.replace(tzinfo=None)
        return holds((now - then).total_seconds(), content.rule, 0.0)

    return check


CHECKS: ValueChecks = {TimeOfDayCondition: prepare}
