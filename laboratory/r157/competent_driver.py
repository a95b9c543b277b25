"""The competent and careful driver, performance model 1 of UN R157."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from laboratory.r157.braking import BRAKING_JERK, COASTING, FULL_BRAKING
from laboratory.r157.cut_in import Encounter, leaves_wandering_zone

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

RISK_EVALUATION, DELAY, CRITICAL_TTC = 0.4, 0.75, 2.0
"""Performance model 1: risk evaluation, delay until braking begins, TTC that makes a cut-in a danger. [s]"""


class CompetentDriver:
    """Performance model 1: wandering zone left, 0.4 s, TTC below 2 s, 0.75 s, full braking.

    The automatic emergency braking that the regulation adds after full wrap is left out: it would act on the same gap.

    References
    ----------
    .. [1] UN Regulation No. 157, guidance on performance models, model 1; numbers also in JRC-FSM, utility/vehicle.py,
       and in esmini, ControllerECE_ALKS_RefDriver.cpp.
    """

    name: ClassVar[str] = "competent driver"

    def begin(self, n: int) -> None:
        """See `SafetyModel.begin`."""
        self._since, self._waited, self._brake = np.zeros(n), np.zeros(n), np.zeros(n)
        self._danger = np.zeros(n, dtype=bool)

    @property
    def noticed(self) -> BoolArray:
        """See `SafetyModel.noticed`."""
        return self._danger

    def decelerate(self, seen: Encounter, speed: FloatArray, target: FloatArray, step: float) -> FloatArray:
        """See `SafetyModel.decelerate`."""
        moving = leaves_wandering_zone(seen) | (seen.clearance <= 0.0)
        self._since = np.where(moving, self._since + step, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            urgent = (seen.gap > 0.0) & (seen.closing > 0.0) & (seen.gap / seen.closing < CRITICAL_TTC)
        self._danger |= (self._since >= RISK_EVALUATION - 1e-9) & urgent
        self._waited = np.where(self._danger, self._waited + step, 0.0)
        acts = self._danger & (self._waited > DELAY + 1e-9) & (speed > 0.0)
        ramp = np.minimum(np.maximum(self._brake, COASTING) + BRAKING_JERK * step, FULL_BRAKING)
        self._brake = np.where(acts, ramp, np.where(self._danger, COASTING, 0.0))
        return self._brake
