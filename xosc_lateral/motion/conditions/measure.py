"""In which way a condition measures its distance."""

from __future__ import annotations

from typing import Protocol

from xosc_lateral.scenario.enums import CoordinateSystem, RelativeDistanceType


class Measured(Protocol):
    """A condition that measures a distance."""

    @property
    def coordinate_system(self) -> CoordinateSystem | None:
        """In which it is measured; None: not said."""

    @property
    def distance_type(self) -> RelativeDistanceType | None:
        """What of it; None: not said."""

    @property
    def along_route(self) -> bool | None:
        """Version 1.0: along the road; None: not said."""


def measure_of(content: Measured) -> tuple[CoordinateSystem, RelativeDistanceType]:
    """Defaults of the standard: entity frame, euclidian. `alongRoute` of version 1.0 names the road, but not which
    component of the distance; a euclidian one is the same in every frame (so the reference player has it, too).
    """
    system = content.coordinate_system or (CoordinateSystem.ROAD if content.along_route else CoordinateSystem.ENTITY)
    return system, content.distance_type or RelativeDistanceType.EUCLIDIAN
