"""RelativeObjectPosition: from an entity, along its own axes."""

from __future__ import annotations

from math import cos, nan, sin

from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.positions.orientation import heading_of, is_absolute, tilted_or_road
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import free, locate
from xosc_lateral.scenario.position import RelativeObjectPosition


def resolve(position: RelativeObjectPosition, simulation: Simulation) -> Placement:
    """Relative headings count from the entity's; its pitch and roll tilt the way there."""
    pose = simulation.entity(position.entity_ref, position.place).pose
    heading = heading_of(position.orientation)
    if not is_absolute(position.orientation, simulation):
        heading += pose.heading
    c, s = cos(pose.heading), sin(pose.heading)
    ahead, left, up = position.dx, position.dy, position.dz or 0.0
    flat_ahead = ahead * cos(pose.pitch) + (left * sin(pose.roll) + up * cos(pose.roll)) * sin(pose.pitch)
    flat_left = left * cos(pose.roll) - up * sin(pose.roll)
    rise = (left * sin(pose.roll) + up * cos(pose.roll)) * cos(pose.pitch) - ahead * sin(pose.pitch)
    x = pose.x + flat_ahead * c - flat_left * s
    y = pose.y + flat_ahead * s + flat_left * c
    z = nan if position.dz is None else pose.z + rise
    return locate(simulation.network, free(x, y, heading, z, *tilted_or_road(position.orientation, pose, simulation)))
