"""TraveledDistanceCondition: way since the scenario's start."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.scenario.conditions.entity import TraveledDistanceCondition


def prepare(content: TraveledDistanceCondition, simulation: Simulation) -> EntityCheck:
    """Teleports don't count. [m]"""
    simulation.derives_motion = True
    return lambda state: state.odometer >= content.value


CHECKS: EntityChecks = {TraveledDistanceCondition: prepare}
