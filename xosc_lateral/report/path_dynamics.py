"""Lateral acceleration and jerk of a path, smoothed just enough to be read."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.arrays import FloatArray
from xosc_lateral.motion.nominal import Activity, EntityMotion
from xosc_lateral.motion.trajectory import WorldTrajectory

STEP = 0.1
"""Rows that the derivatives are taken on. [s]"""

COMFORTABLE = 0.5
"""Lateral acceleration that real drivers seldom exceed while they keep their lane, beyond what the road asks. [m/s2]"""


class LateralDynamics(NamedTuple):
    """Lateral acceleration [m/s2] and jerk [m/s3] over time [s], left positive; NaN beside gaps in the motion."""

    time: FloatArray
    acceleration: FloatArray
    jerk: FloatArray


def lateral_dynamics(motion: EntityMotion, path: WorldTrajectory | EntityMotion) -> LateralDynamics:
    """Acceleration across the direction of travel, and its derivative.

    Parameters
    ----------
    motion : EntityMotion
        Says where the entity is absent or placed anew.
    path : WorldTrajectory
        Nominal or enriched, on the same rows.
    """
    every = max(1, round(STEP / (motion.time[1] - motion.time[0]))) if len(motion.time) > 1 else 1
    time, x, y = path.time[::every], path.x[::every], path.y[::every]
    if len(time) < 3:
        return LateralDynamics(time, np.full(len(time), np.nan), np.full(len(time), np.nan))
    across = _across(time, x, y, path.heading[::every])
    across[_near_breaks(motion, every)] = np.nan
    across[[0, -1]] = np.nan  # differences are one-sided there: half of what they should be
    return LateralDynamics(time, across, np.gradient(across, time))


def _across(time: FloatArray, x: FloatArray, y: FloatArray, heading: FloatArray) -> FloatArray:
    """Acceleration to the left of the heading, shape (n,). [m/s2]"""
    velocity = np.gradient(x, time) + 1j * np.gradient(y, time)
    acceleration = np.gradient(velocity, time)
    direction = np.exp(1j * heading)
    across = np.imag(acceleration * np.conj(direction))
    return np.asarray(across)


def _near_breaks(motion: EntityMotion, every: int) -> NDArray[np.bool_]:
    """Rows whose derivative would look across a gap in the motion."""
    broken = ((motion.activity & Activity.ACTIVE) == 0) | ((motion.activity & Activity.TELEPORTED) != 0)
    broken[0] = False  # placed at the start: nothing before it
    coarse = np.add.reduceat(broken, np.arange(0, len(broken), every)) > 0
    wide = coarse.copy()
    for shift in (1, 2):
        wide[shift:] |= coarse[:-shift]
        wide[:-shift] |= coarse[shift:]
    return wide
