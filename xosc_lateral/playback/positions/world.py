"""WorldPosition."""

from __future__ import annotations

from math import nan

from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import free, locate
from xosc_lateral.scenario.position import WorldPosition


def resolve(position: WorldPosition, simulation: Simulation) -> Placement:
    """Heading 0 where none is given; z, pitch and roll those of the road where none are given."""
    pose = free(
        position.x,
        position.y,
        position.h or 0.0,
        nan if position.z is None else position.z,
        nan if position.p is None else position.p,
        nan if position.r is None else position.r,
    )
    return locate(simulation.network, pose)
