"""Routes and trajectories to follow."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.enums import FollowingMode
from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position, Route, Timing, Trajectory


@dataclass(frozen=True, slots=True)
class AssignRouteAction:
    """Take this route at junctions."""

    route: Route
    place: Place


@dataclass(frozen=True, slots=True)
class AcquirePositionAction:
    """Take the route from here to there."""

    position: Position
    place: Place


@dataclass(frozen=True, slots=True)
class FollowTrajectoryAction:
    """Follow a path; `timing` None: with the entity's own speed. `initial_distance_offset` [m]"""

    trajectory: Trajectory
    timing: Timing | None
    following_mode: FollowingMode
    place: Place
    initial_distance_offset: float = 0.0
