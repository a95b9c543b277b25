"""How far a plan is from what was recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.reconstruction.plan import VehiclePlan

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class Residuals:
    """Recorded less planned, at the recorded rows.

    Parameters
    ----------
    time : array, shape (n,)
        [s]
    along, across : array, shape (n,)
        Ahead, and to the left, of the planned place. [m]
    in_lane : bool array, shape (n,)
        Outside of all transitions: what is across is the driver's.
    """

    time: FloatArray
    along: FloatArray
    across: FloatArray
    in_lane: NDArray[np.bool_]


def residuals_of(plan: VehiclePlan) -> Residuals:
    """Of the rows from which on the vehicle is there."""
    vehicle = plan.vehicle
    rows = vehicle.time >= plan.present[0] - 1e-9
    time = vehicle.time[rows]
    across = (vehicle.offset + vehicle.levels[0])[rows] - plan.lateral.at(time)
    in_lane = np.ones(len(time), dtype=np.bool_)
    for one in plan.lateral.transitions:
        in_lane &= (time < one.start) | (time > one.end)
    return Residuals(time, plan.way[rows] - plan.speed.way(time), across, in_lane)
