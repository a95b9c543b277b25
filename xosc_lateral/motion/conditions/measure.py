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
    """Defaults of the standard (entity frame, euclidian); `alongRoute` of version 1.0 means along the road."""
    if content.along_route and content.coordinate_system is None and content.distance_type is None:
        return CoordinateSystem.ROAD, RelativeDistanceType.LONGITUDINAL
    return (
        content.coordinate_system or CoordinateSystem.ENTITY,
        content.distance_type or RelativeDistanceType.EUCLIDIAN,
    )
