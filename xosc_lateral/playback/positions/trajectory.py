"""TrajectoryPosition: somewhere on, or beside, a trajectory."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, sin

from xosc_lateral.playback.paths.registry import path_of
from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.positions.orientation import heading_of, is_absolute
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import free, locate
from xosc_lateral.road import Pose
from xosc_lateral.scenario.position import Position, TrajectoryPosition


def resolve(
    position: TrajectoryPosition, simulation: Simulation, pose_of: Callable[[Position, Simulation], Pose]
) -> Placement:
    """Relative headings count from the trajectory's."""
    point = path_of(position.trajectory, simulation, pose_of).at(position.s)
    heading = heading_of(position.orientation)
    if not is_absolute(position.orientation, simulation):
        heading += point.heading
    x = point.x - position.t * sin(point.heading)
    y = point.y + position.t * cos(point.heading)
    return locate(simulation.network, free(x, y, heading, point.z))
