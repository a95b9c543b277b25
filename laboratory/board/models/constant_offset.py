"""One lane offset per vehicle: CARLA's traffic manager."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from laboratory.board.models.batch import SegmentBatch
from laboratory.board.models.simulated import SimulatedModel, driver_means_of
from xosc_lateral.drivers.drives.drive import Run

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class ConstantOffset(SimulatedModel):
    """Every vehicle keeps the offset that it has; a free run keeps one of the fitted drivers' means."""

    title: ClassVar[str] = "constant offset (CARLA)"
    source: ClassVar[str] = "CARLA, Python API: TrafficManager.vehicle_lane_offset(actor, offset)"
    departures: ClassVar[str] = "CARLA sets the offset by hand; here it comes from the fitted drivers' means"

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Means of the drivers."""
        return cls(driver_means=driver_means_of(runs))

    def simulate(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """See `SimulatedModel.simulate`."""
        return np.repeat(batch.start[:, None], batch.shape[1], axis=1)

    @property
    def settings(self) -> Mapping[str, float]:
        """Spread of the drivers' means. [m]"""
        return {"spread_m": float(self.driver_means.std())}
