"""Routes and trajectories to follow."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.enums import FollowingMode
from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position, Route, Timing, Trajectory


class AssignRouteAction(Struct, frozen=True):
    """Take this route at junctions."""

    route: Route
    place: Place


class AcquirePositionAction(Struct, frozen=True):
    """Take the route from here to there."""

    position: Position
    place: Place


class FollowTrajectoryAction(Struct, frozen=True):
    """Follow a path; `timing` None: with the entity's own speed. `initial_distance_offset` [m]"""

    trajectory: Trajectory
    timing: Timing | None
    following_mode: FollowingMode
    place: Place
    initial_distance_offset: float = 0.0
