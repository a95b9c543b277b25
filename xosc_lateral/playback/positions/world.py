"""WorldPosition."""

from __future__ import annotations

from math import nan

from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import free, locate
from xosc_lateral.road import Pose
from xosc_lateral.scenario.position import WorldPosition


def pose_of(position: WorldPosition) -> Pose:
    """Heading 0 where none is given; z, pitch and roll, where none are given, are NaN: the road's."""
    return free(
        position.x,
        position.y,
        position.h or 0.0,
        nan if position.z is None else position.z,
        nan if position.p is None else position.p,
        nan if position.r is None else position.r,
    )


def resolve(position: WorldPosition, simulation: Simulation) -> Placement:
    """Under the pose."""
    return locate(simulation.network, pose_of(position))
