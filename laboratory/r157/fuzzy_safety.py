"""The Fuzzy Safety Model, performance model 2 of UN R157."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from laboratory.r157.braking import BRAKING_JERK, FULL_BRAKING
from laboratory.r157.cut_in import Encounter, crosses_in_time

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

FSM_REACTION, FSM_COMFORT, FSM_HARD, FSM_LEADER = 0.75, 4.0, 6.0, 7.0
"""Reaction time [s]; comfortable and maximum deceleration of the ego and maximum of the other vehicle [m/s2]."""

FSM_DISTANCE = 2.0
"""Margin at standstill and margin of the safe distance, each. [m]"""


class FuzzySafetyModel:
    """Performance model 2: proactive and critical fuzzy surrogate metrics decide how hard the driver brakes.

    References
    ----------
    .. [1] K. Mattas et al., "Fuzzy Surrogate Safety Metrics for real-time assessment of rear-end collision risk",
       Accident Analysis & Prevention 148, 2020, 105794; JRC-FSM, utility/fuzzy_functs.py and models.py.
    """

    name: ClassVar[str] = "FSM"

    def begin(self, n: int) -> None:
        """See `SafetyModel.begin`."""
        self._left, self._brake = np.full(n, FSM_REACTION), np.zeros(n)
        self._noticed = np.zeros(n, dtype=bool)

    @property
    def noticed(self) -> BoolArray:
        """See `SafetyModel.noticed`."""
        return self._noticed

    def decelerate(self, seen: Encounter, speed: FloatArray, target: FloatArray, step: float) -> FloatArray:
        """See `SafetyModel.decelerate`."""
        critical = critical_metric(seen.gap, speed, target, -self._brake)
        proactive = proactive_metric(seen.gap, speed, target)
        unsafe = crosses_in_time(seen) & (critical + proactive > 0.0)
        self._noticed |= unsafe
        waits = unsafe & (self._left > 1e-9)
        acts = unsafe & ~waits & (speed > 0.0)
        self._left = np.where(waits, self._left - step, self._left)
        wanted = np.where(critical > 0.0, critical * (FSM_HARD - FSM_COMFORT) + FSM_COMFORT, proactive * FSM_COMFORT)
        ramp = np.minimum(np.minimum(self._brake + BRAKING_JERK * step, FULL_BRAKING), wanted)
        self._brake = np.where(acts, ramp, 0.0)
        return self._brake


def proactive_metric(gap: FloatArray, ego: FloatArray, target: FloatArray) -> FloatArray:
    """PFS: 0 where the ego could stop comfortably behind a vehicle that brakes hard, 1 where even its hardest fails.

    Shape (n,) each; [m], [m/s], [m/s]. [-]
    """
    room = gap - FSM_DISTANCE
    common = ego * FSM_REACTION - target**2 / (2.0 * FSM_LEADER)
    safe = common + ego**2 / (2.0 * FSM_COMFORT) + FSM_DISTANCE
    unsafe = common + ego**2 / (2.0 * FSM_HARD)
    return np.asarray(np.clip((room - safe) / (unsafe - safe), 0.0, 1.0))


def critical_metric(gap: FloatArray, ego: FloatArray, target: FloatArray, acceleration: FloatArray) -> FloatArray:
    """CFS: 0 where comfortable braking in time avoids a vehicle that keeps its speed, 1 where the hardest does not.

    Shape (n,) each; [m], [m/s], [m/s], [m/s2]. [-]
    """
    own = np.maximum(acceleration, -FSM_COMFORT)
    later = ego + FSM_REACTION * own - target
    way = (ego + own * FSM_REACTION / 2.0 - target) * FSM_REACTION
    safe, unsafe = way + later**2 / (2.0 * FSM_COMFORT), way + later**2 / (2.0 * FSM_HARD)
    with np.errstate(divide="ignore", invalid="ignore"):
        fuzzy = np.where(safe > unsafe, np.clip((gap - safe) / (unsafe - safe), 0.0, 1.0), (gap < safe) * 1.0)
        braked = (gap < (ego - target) ** 2 / np.abs(2.0 * acceleration)) * 1.0
    return np.asarray(np.where(ego <= target, 0.0, np.where(later < 0.0, braked, fuzzy)))
