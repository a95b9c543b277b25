"""TrajectoryPosition: somewhere on, or beside, a trajectory."""

from __future__ import annotations

from math import cos, sin

from xosc_lateral.motion.paths.registry import path_of
from xosc_lateral.motion.positions.orientation import heading_of, is_absolute
from xosc_lateral.motion.run import Run
from xosc_lateral.motion.state import Placement, free, locate
from xosc_lateral.scenario.position import TrajectoryPosition


def resolve(position: TrajectoryPosition, run: Run) -> Placement:
    """Relative headings count from the trajectory's."""
    point = path_of(position.trajectory, run).at(position.s)
    heading = heading_of(position.orientation)
    if not is_absolute(position.orientation, run):
        heading += point.heading
    x = point.x - position.t * sin(point.heading)
    y = point.y + position.t * cos(point.heading)
    return locate(run.network, free(x, y, heading, point.z))
