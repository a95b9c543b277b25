"""Dynamic constraints of one action, capped by what the entity can do."""

from __future__ import annotations

from math import inf

from msgspec import Struct

from xosc_lateral.scenario import Performance
from xosc_lateral.scenario.dynamics import DynamicConstraints


class Limits(Struct, frozen=True):
    """[m/s], [m/s2], [m/s3]; infinite: none."""

    speed: float
    acceleration: float
    deceleration: float
    acceleration_rate: float
    deceleration_rate: float


def limits_of(constraints: DynamicConstraints | None, performance: Performance) -> Limits:
    """Constraints that are not given are the entity's own; without any constraints, there are none at all."""
    if constraints is None:
        return Limits(performance.max_speed, inf, inf, inf, inf)
    return Limits(
        _capped(constraints.max_speed, performance.max_speed),
        _capped(constraints.max_acceleration, performance.max_acceleration),
        _capped(constraints.max_deceleration, performance.max_deceleration),
        _capped(constraints.max_acceleration_rate, performance.max_acceleration_rate),
        _capped(constraints.max_deceleration_rate, performance.max_deceleration_rate),
    )


def _capped(value: float | None, own: float) -> float:
    return own if value is None else min(value, own)
