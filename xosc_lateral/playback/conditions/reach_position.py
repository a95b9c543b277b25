"""ReachPositionCondition: within a tolerance of a position."""

from __future__ import annotations

from xosc_lateral.playback.angles import difference
from xosc_lateral.playback.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.playback.distances import apart
from xosc_lateral.playback.positions.resolve import pose_of, spot_at
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.scenario.conditions.entity import ReachPositionCondition

ANGULAR_TOLERANCE = 0.05
"""How far heading, pitch and roll may be from an orientation that is given; the reference player's value. [rad]"""


def prepare(content: ReachPositionCondition, simulation: Simulation) -> EntityCheck:
    """Straight distance in the plane [m]; an orientation that the position gives has to be met, too."""
    spot = spot_at(content.position, simulation)
    oriented = getattr(content.position, "orientation", None) is not None

    def check(state: EntityState) -> bool:
        target = spot()
        if not apart(state, target.x, target.y) < content.tolerance:
            return False
        if not oriented:
            return True
        wanted, pose = pose_of(content.position, simulation), state.pose
        return all(
            abs(difference(getattr(pose, angle), getattr(wanted, angle))) < ANGULAR_TOLERANCE
            for angle in ("heading", "pitch", "roll")
        )

    return check


CHECKS: EntityChecks = {ReachPositionCondition: prepare}
