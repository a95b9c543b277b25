"""RelativeObjectPosition: from an entity, along its own axes."""

from __future__ import annotations

from math import cos, sin

from xosc_lateral.motion.positions.orientation import heading_of, is_absolute, tilted
from xosc_lateral.motion.run import Run
from xosc_lateral.motion.state import Placement, free, locate
from xosc_lateral.scenario.position import RelativeObjectPosition


def resolve(position: RelativeObjectPosition, run: Run) -> Placement:
    """Relative headings count from the entity's; its pitch and roll tilt the way there."""
    pose = run.entity(position.entity_ref, position.place).pose
    heading = heading_of(position.orientation)
    if not is_absolute(position.orientation, run):
        heading += pose.heading
    c, s = cos(pose.heading), sin(pose.heading)
    ahead, left, up = position.dx, position.dy, position.dz
    flat_ahead = ahead * cos(pose.pitch) + (left * sin(pose.roll) + up * cos(pose.roll)) * sin(pose.pitch)
    flat_left = left * cos(pose.roll) - up * sin(pose.roll)
    rise = (left * sin(pose.roll) + up * cos(pose.roll)) * cos(pose.pitch) - ahead * sin(pose.pitch)
    x = pose.x + flat_ahead * c - flat_left * s
    y = pose.y + flat_ahead * s + flat_left * c
    pitch, roll = tilted(position.orientation, pose.pitch, pose.roll, run)
    return locate(run.network, free(x, y, heading, pose.z + rise, pitch, roll))
