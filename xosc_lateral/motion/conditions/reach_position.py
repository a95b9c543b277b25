"""ReachPositionCondition: within a tolerance of a position."""

from __future__ import annotations

from xosc_lateral.motion.conditions.base import EntityCheck
from xosc_lateral.motion.distances import apart
from xosc_lateral.motion.positions.resolve import spot_at
from xosc_lateral.motion.run import Run
from xosc_lateral.motion.state import EntityState
from xosc_lateral.scenario.conditions import ReachPositionCondition


def prepare(content: ReachPositionCondition, run: Run) -> EntityCheck:
    """Straight distance in the plane. [m]"""
    spot = spot_at(content.position, run)

    def check(state: EntityState) -> bool:
        target = spot()
        return apart(state, target.x, target.y) < content.tolerance

    return check
