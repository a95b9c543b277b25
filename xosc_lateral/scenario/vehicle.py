"""What a scenario object is built like: its box, the limits of its motion, its axles."""

from __future__ import annotations

from msgspec import Struct


class BoundingBox(Struct, frozen=True):
    """Box around the entity; its centre in the entity's frame (x ahead of the reference point, y left, z up). [m]"""

    center_x: float
    center_y: float
    center_z: float
    length: float
    width: float
    height: float


class Performance(Struct, frozen=True):
    """Limits of a vehicle; infinite where the file has none. [m/s], [m/s2], [m/s3]"""

    max_speed: float = float("inf")
    max_acceleration: float = float("inf")
    max_deceleration: float = float("inf")
    max_acceleration_rate: float = float("inf")
    max_deceleration_rate: float = float("inf")


class Axle(Struct, frozen=True):
    """An axle; `position_x` ahead of the reference point. [m], [rad]"""

    max_steering: float
    position_x: float
    position_z: float
    track_width: float
    wheel_diameter: float


class Axles(Struct, frozen=True):
    """Front (a trailer may have none), rear and further axles."""

    front: Axle | None
    rear: Axle | None
    additional: tuple[Axle, ...] = ()

    @property
    def wheelbase(self) -> float | None:
        """Distance from the rear to the front axle. [m]"""
        return None if self.front is None or self.rear is None else self.front.position_x - self.rear.position_x
