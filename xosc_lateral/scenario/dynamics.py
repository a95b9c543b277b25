"""How values change: transition dynamics and dynamic constraints."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.enums import DynamicsDimension, DynamicsShape, FollowingMode


class TransitionDynamics(Struct, frozen=True):
    """Shape, dimension and value of a transition; `value` in s, m, or 1/s of the quantity (peak rate)."""

    shape: DynamicsShape
    dimension: DynamicsDimension
    value: float
    following_mode: FollowingMode = FollowingMode.POSITION


class DynamicConstraints(Struct, frozen=True):
    """Limits of one action; None where the file has none (the performance holds then). [m/s], [m/s2], [m/s3]"""

    max_acceleration: float | None = None
    max_deceleration: float | None = None
    max_speed: float | None = None
    max_acceleration_rate: float | None = None
    max_deceleration_rate: float | None = None
