"""RelativeWorldPosition: from an entity, along the world's axes."""

from __future__ import annotations

from xosc_lateral.motion.positions.orientation import heading_of, is_absolute, tilted
from xosc_lateral.motion.run import Run
from xosc_lateral.motion.state import Placement, free, locate
from xosc_lateral.scenario.position import RelativeWorldPosition


def resolve(position: RelativeWorldPosition, run: Run) -> Placement:
    """Relative headings count from the entity's."""
    pose = run.entity(position.entity_ref, position.place).pose
    heading = heading_of(position.orientation)
    if not is_absolute(position.orientation, run):
        heading += pose.heading
    pitch, roll = tilted(position.orientation, pose.pitch, pose.roll, run)
    x, y, z = pose.x + position.dx, pose.y + position.dy, pose.z + position.dz
    return locate(run.network, free(x, y, heading, z, pitch, roll))
