"""RelativeWorldPosition: from an entity, along the world's axes."""

from __future__ import annotations

from math import nan

from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.positions.orientation import heading_of, is_absolute, tilted_or_road
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import free, locate
from xosc_lateral.scenario.position import RelativeWorldPosition


def resolve(position: RelativeWorldPosition, simulation: Simulation) -> Placement:
    """Relative headings count from the entity's."""
    pose = simulation.entity(position.entity_ref, position.place).pose
    heading = heading_of(position.orientation)
    if not is_absolute(position.orientation, simulation):
        heading += pose.heading
    dx, dy = simulation.network.header_offset.turned_back(position.dx, position.dy)
    z = nan if position.dz is None else pose.z + position.dz
    tilt = tilted_or_road(position.orientation, pose, simulation)
    return locate(simulation.network, free(pose.x + dx, pose.y + dy, heading, z, *tilt))
