"""SUMO's lateral imperfection, `lcSigma`, as its formula says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from laboratory.board.models.batch import SegmentBatch
from laboratory.board.models.calibration import Bounds, calibrate
from laboratory.board.models.ornstein_uhlenbeck import recursion
from laboratory.board.models.simulated import SimulatedModel, driver_means_of
from xosc_lateral.drivers.drives.drive import Run

FloatArray = NDArray[np.float64]

LONGEST_TIME = 100.0
"""Time constant of lcSigma 0; that of sigma is (1 - sigma) times it. [s]"""


@dataclass(frozen=True, eq=False, kw_only=True)
class LcSigma(SimulatedModel):
    """Per action step ``exp(-dt/T) x + sigma sqrt(2 dt/T) noise`` with T = 100 s (1 - sigma), at the speed limit.

    Parameters
    ----------
    sigma : float
        The vehicle type's `lcSigma`, 0 to 1. [-]
    """

    sigma: float

    title: ClassVar[str] = "lcSigma (SUMO's formula)"
    source: ClassVar[str] = (
        "Eclipse SUMO, src/microsim/lcmodels/MSLCM_LC2013.cpp (prepareStep) and src/microsim/MSDriverState.cpp "
        "(OUProcess::step), github.com/eclipse-sumo/sumo"
    )
    departures: ClassVar[str] = (
        "action steps of 0.2 s (SUMO's usual 1 s is another process); vehicles drive at the speed limit; SUMO holds "
        "them inside their lane, the formula does not"
    )

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Numbers of the smallest distance (`calibrate`)."""
        driver_means = driver_means_of(runs)
        return calibrate(lambda values: cls(driver_means=driver_means, **values), {"sigma": Bounds(0.01, 0.99)}, runs)

    def simulate(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """See `SimulatedModel.simulate`."""
        scale = LONGEST_TIME * (1.0 - self.sigma)
        kicks = self.sigma * np.sqrt(2.0 * batch.step / scale) * rng.standard_normal(batch.shape)
        return recursion(batch.start, float(np.exp(-batch.step / scale)), kicks)

    @property
    def settings(self) -> Mapping[str, float]:
        """The fitted number. [-]"""
        return {"sigma": self.sigma}
