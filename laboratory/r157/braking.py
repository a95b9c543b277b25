"""A driver who brakes, driven through many encounters at once."""

from __future__ import annotations

from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from laboratory.r157.cut_in import Encounter
from laboratory.r157.encounters import Ego, EncounterOutcome, Traffic, see

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

GRAVITY = 9.81
"""[m/s2]"""

FULL_BRAKING = 0.774 * GRAVITY
"""Performance models 1 and 2. [m/s2]"""

BRAKING_JERK = 12.65
"""Full braking after 0.6 s; the JRC's number. [m/s3]"""


class SafetyModel(Protocol):
    """A driver who brakes: told what it sees, it gives its deceleration."""

    name: ClassVar[str]

    def begin(self, n: int) -> None:
        """Before the first of n encounters' moments."""
        ...

    def decelerate(self, seen: Encounter, speed: FloatArray, target: FloatArray, step: float) -> FloatArray:
        """Deceleration of the next step, shape (n,). [m/s2]"""
        ...

    @property
    def noticed(self) -> BoolArray:
        """Whether a danger has been seen so far, shape (n,). [-]"""
        ...


def evaluate_braking(model: SafetyModel, traffic: Traffic, ego: Ego) -> EncounterOutcome:
    """Drive the ego through n encounters at once (semi-implicit Euler at the traffic's step)."""
    n, m = traffic.position.shape
    model.begin(n)
    place, speed = np.full(n, ego.position), np.full(n, ego.speed)
    smallest, noticed, braking = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan)
    collided, lateral = np.zeros(n, dtype=bool), traffic.lateral_speed
    for k in range(m):
        seen = see(traffic, k, place, speed, ego, lateral[:, k])
        overlaps = (seen.clearance < 0.0) & (traffic.position[:, k] > place - traffic.length)
        smallest = np.where(overlaps & ~collided, np.fmin(smallest, seen.gap), smallest)
        collided |= overlaps & (seen.gap <= 0.0) & (seen.gap > -(traffic.length + ego.length))
        brake = model.decelerate(seen, speed, traffic.speed[:, k], traffic.step)
        time = k * traffic.step
        noticed = np.where(np.isnan(noticed) & model.noticed, time, noticed)
        braking = np.where(np.isnan(braking) & (brake > COASTING), time, braking)
        speed = np.maximum(speed - brake * traffic.step, 0.0)
        place = place + speed * traffic.step
    return EncounterOutcome(~collided, smallest, noticed, braking)


COASTING = 0.4
"""Deceleration with the foot off the accelerator, while the driver's foot moves (JRC). [m/s2]"""
