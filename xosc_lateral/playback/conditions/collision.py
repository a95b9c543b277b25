"""CollisionCondition: bounding boxes touch."""

from __future__ import annotations

from xosc_lateral.playback.boxes import overlap
from xosc_lateral.playback.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.scenario.conditions.entity import CollisionCondition


def prepare(content: CollisionCondition, simulation: Simulation) -> EntityCheck:
    """With one entity, or with any other of a category. Who is named touches itself, as in the reference player."""
    others: tuple[EntityState, ...]
    is_named = content.entity_ref is not None
    if content.entity_ref is not None:
        others = (simulation.entity(content.entity_ref, content.place),)
    else:
        others = tuple(
            o for o in simulation.everybody() if content.by_type is None or o.entity.category is content.by_type
        )

    def check(state: EntityState) -> bool:
        return any((is_named or other is not state) and other.active and overlap(state, other) for other in others)

    return check


CHECKS: EntityChecks = {CollisionCondition: prepare}
