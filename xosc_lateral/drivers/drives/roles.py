"""What columns of a drive are."""

from __future__ import annotations

from enum import StrEnum


class Role(StrEnum):
    """What a column is."""

    ROAD = "road"
    WEATHER = "weather"
    TRAFFIC = "traffic"
    TIME = "time"
    OWN = "own"
    DRIVER = "driver"
    UNKNOWN = "unknown"

    @property
    def is_exogenous(self) -> bool:
        """Whether the car cannot bring it about: never a consequence of its movement."""
        return self in (Role.ROAD, Role.WEATHER, Role.TRAFFIC)
