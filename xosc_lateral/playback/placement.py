"""Where something is put: road coordinates, and a pose in the world where one was given."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.road import Pose

NOWHERE = -1
"""Road of what is on none."""


class Placement(Struct, frozen=True):
    """A place and an orientation, in road coordinates and, where it was not given in them, in world coordinates too.

    Parameters
    ----------
    road : int
        Index of the road; -1 where there is none.
    lane : int
    s : float
        [m]
    offset_t : float
        From the lane's centre along the road's t-axis. [m]
    relative_heading : float
        Relative to the road's s-direction (slope of the lane included). [rad]
    pose : Pose or None
        World pose; None: it follows from the road coordinates. NaN in z, pitch, roll: those of the road.
    """

    road: int
    lane: int
    s: float
    offset_t: float
    relative_heading: float
    pose: Pose | None = None
