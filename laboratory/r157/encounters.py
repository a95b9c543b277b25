"""Encounters with a vehicle that cuts in, many at once, what the ego sees of them, and what became of them.

References
----------
.. [1] UN Regulation No. 157, Automated Lane Keeping Systems, Annex 4: a vehicle that cuts in.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laboratory.r157.cut_in import Encounter

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Traffic:
    """One vehicle that cuts in (or does not), n times, at m moments.

    Parameters
    ----------
    position : array, shape (n, m)
        Of its centre along the road. [m]
    speed : array, shape (n, m)
        [m/s]
    towards : array, shape (n, m)
        From its first lane's centre, positive towards the ego lane. [m]
    distance : array, shape (n, m)
        Of its centre from the ego lane's centre, to its own side. [m]
    lane_width, width, length : float
        [m]
    step : float
        [s]
    """

    position: FloatArray
    speed: FloatArray
    towards: FloatArray
    distance: FloatArray
    lane_width: float
    width: float
    length: float
    step: float

    @property
    def lateral_speed(self) -> FloatArray:
        """Positive towards the ego lane. [m/s] Shape (n,)."""
        return np.gradient(self.towards, self.step, axis=1)


@dataclass(frozen=True)
class Ego:
    """The vehicle under test: where its centre is at the first moment, its speed, its size. [m], [m/s]"""

    position: float
    speed: float
    length: float = 4.5
    width: float = 1.9


@dataclass(frozen=True, eq=False)
class EncounterOutcome:
    """What became of n encounters.

    Parameters
    ----------
    prevented : array of bool, shape (n,)
        No collision.
    smallest_gap : array, shape (n,)
        While both overlap laterally; NaN if they never do; at most 0 after a collision. [m]
    noticed : array, shape (n,)
        When the model first sees a danger; NaN: never. [s]
    braking : array, shape (n,)
        When it begins to brake by more than coasting; NaN: never. [s]
    """

    prevented: BoolArray
    smallest_gap: FloatArray
    noticed: FloatArray
    braking: FloatArray


def see(
    traffic: Traffic, k: int, place: FloatArray, speed: FloatArray, ego: Ego, lateral_speed: FloatArray
) -> Encounter:
    """What the ego sees at moment k, shape (n,). [m], [m/s]"""
    return Encounter(
        towards=traffic.towards[:, k],
        lateral_speed=lateral_speed,
        clearance=np.abs(traffic.distance[:, k]) - 0.5 * (traffic.width + ego.width),
        gap=traffic.position[:, k] - place - 0.5 * (traffic.length + ego.length),
        closing=speed - traffic.speed[:, k],
        lane_width=traffic.lane_width,
        width=traffic.width,
        length=traffic.length,
        ego_length=ego.length,
    )
