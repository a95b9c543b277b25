"""esmini's SloppyDriver: a target on one side, drawn anew every second or two and steered to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from laboratory.board.models.batch import SegmentBatch
from laboratory.board.models.calibration import Bounds, calibrate
from laboratory.board.models.simulated import SimulatedModel, driver_means_of
from xosc_lateral.drivers.drives.drive import Run

FloatArray = NDArray[np.float64]

LARGEST_TARGET = 5.0
"""Of sloppiness 1, on average. [m]"""
BETWEEN_TARGETS = 1.5
"""On average; each time and each target vary by half. [s]"""
LATERAL_GAIN, HEADING_GAIN = -0.02, -0.05
"""Turn per metre driven. [rad/m per m of error], [1/m]"""
INNER_STEPS = 4
"""Of 0.05 s: esmini's own step is the player's, 0.01 to 0.05 s in practice."""
SETTLING = 60.0
"""From activation to what is used: the controller starts on its line. [s]"""


@dataclass(frozen=True, eq=False, kw_only=True)
class SloppyDriver(SimulatedModel):
    """A drift that the controller adds to where a vehicle is; always to the same side of it.

    Parameters
    ----------
    sloppiness : float
        The controller's one number, 0 to 1. [-]
    """

    sloppiness: float

    title: ClassVar[str] = "SloppyDriver (esmini)"
    source: ClassVar[str] = (
        "esmini, EnvironmentSimulator/Modules/Controllers/ControllerSloppyDriver.cpp (github.com/esmini)"
    )
    departures: ClassVar[str] = (
        "lateral part only; windows are cut from the midst of a drive and moved to the start, as an initial offset "
        "in the scenario would; the vehicle's habit is added in free runs"
    )

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Numbers of the smallest distance (`calibrate`)."""
        driver_means = driver_means_of(runs)
        return calibrate(
            lambda values: cls(driver_means=driver_means, **values), {"sloppiness": Bounds(0.02, 1.0)}, runs
        )

    def simulate(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """See `SimulatedModel.simulate`."""
        drift = self.drift(batch.with_burn_in(round(SETTLING / batch.step)), rng)[:, -batch.shape[1] :]
        return drift - drift[:, :1] + batch.start[:, None]

    def drift(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """What the controller itself adds, from activation on, shape (n, m). [m]"""
        from laboratory.board.models.kernels import steer_to_targets

        n, m = batch.shape
        size = LARGEST_TARGET * self.sloppiness * min(self.sloppiness, 1.0)
        # A target lasts at least half of the mean time: so many are enough.
        most = int(np.ceil(m * batch.step / (0.5 * BETWEEN_TARGETS))) + 1
        targets = size * rng.uniform(0.5, 1.5, (n, most))
        lasting = BETWEEN_TARGETS * rng.uniform(0.5, 1.5, (n, most))
        lasting[:, 0] = BETWEEN_TARGETS  # the first one, to where the vehicle is
        targets[:, 0] = 0.0
        dt = batch.step / INNER_STEPS
        return steer_to_targets(batch.speed, targets, lasting, dt, INNER_STEPS, LATERAL_GAIN, HEADING_GAIN)

    @property
    def settings(self) -> Mapping[str, float]:
        """The fitted number. [-]"""
        return {"sloppiness": self.sloppiness}
