"""Hot loops of the field's models. Imported where they are used: numba takes its time."""

from __future__ import annotations

from math import sin

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.lazy import njit

FloatArray = NDArray[np.float64]


@njit
def steer_to_targets(
    speed: FloatArray,
    targets: FloatArray,
    lasting: FloatArray,
    step: float,
    inner: int,
    lateral_gain: float,
    heading_gain: float,
) -> FloatArray:
    """SloppyDriver's control loop for many vehicles, shape (n, m).

    Parameters
    ----------
    speed : array, shape (n, m)
        [m/s]
    targets, lasting : array, shape (n, k)
        Targets one after another and how long each takes to come up. [m], [s]
    step : float
        Of the loop. [s]
    inner : int
        Loop steps for each row.
    lateral_gain, heading_gain : float
        Turn per metre driven and metre of error, and per radian. [rad/m2], [1/m]
    """
    n, m = speed.shape
    rows = np.empty((n, m))
    for i in range(n):
        offset = heading = old = since = 0.0
        number = 0
        for k in range(m):
            rows[i, k] = offset
            for _ in range(inner):
                if since >= lasting[i, number] and number + 1 < targets.shape[1]:
                    old = targets[i, number]
                    number += 1
                    since = 0.0
                wanted = old + (targets[i, number] - old) * since / lasting[i, number]
                error = offset + wanted
                heading += (lateral_gain * error + heading_gain * heading) * step * speed[i, k]
                offset += speed[i, k] * step * sin(heading)
                since += step
    return rows
