"""The offset of an OpenDRIVE header: where the road network lies in the inertial frame."""

from __future__ import annotations

from math import cos, sin
from typing import TypeVar

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Place = TypeVar("Place", float, NDArray[np.float64])


class HeaderOffset(Struct, frozen=True):
    """From the coordinates that road and scenario are written in to the inertial frame.

    First moved, then turned about the inertial origin (OpenDRIVE 1.7, 8.2). Everything is worked out in the coordinates
    of the file, in which numbers are small; what leaves the program as a world position goes through here.

    Parameters
    ----------
    x, y, z : float
        [m]
    heading : float
        [rad]
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    heading: float = 0.0

    def __bool__(self) -> bool:
        """Whether it moves anything."""
        return (self.x, self.y, self.z, self.heading) != (0.0, 0.0, 0.0, 0.0)

    def apply(
        self, x: FloatArray, y: FloatArray, z: FloatArray, heading: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Inertial x, y, z [m] and heading from 0 to 2 pi [rad] of places in the coordinates of the file.

        Shape (n,) each.
        """
        c, s = cos(self.heading), sin(self.heading)
        x, y = x + self.x, y + self.y
        return c * x - s * y, s * x + c * y, z + self.z, (heading + self.heading) % (2.0 * np.pi)

    def undo(self, x: Place, y: Place) -> tuple[Place, Place]:
        """Coordinates of the file of an inertial place, or of several. [m]"""
        c, s = cos(self.heading), sin(self.heading)
        return c * x + s * y - self.x, c * y - s * x - self.y

    def turned_back(self, dx: float, dy: float) -> tuple[float, float]:
        """An inertial direction along the axes of the file. [m]"""
        c, s = cos(self.heading), sin(self.heading)
        return c * dx + s * dy, c * dy - s * dx
