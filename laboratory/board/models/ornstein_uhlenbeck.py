"""The Ornstein-Uhlenbeck process: the simplest noise that comes back.

References
----------
.. [1] D. T. Gillespie, "Exact numerical simulation of the Ornstein-Uhlenbeck process and its integral", Physical
       Review E 54, 1996.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from examples.driver_simulator.motorway import first_order
from laboratory.board.models.batch import SegmentBatch
from laboratory.board.models.calibration import Bounds, calibrate
from laboratory.board.models.simulated import SimulatedModel, driver_means_of
from xosc_lateral.drivers.drives.drive import Run

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class OrnsteinUhlenbeck(SimulatedModel):
    """``dx = (mean - x) dt / time_constant + noise``, in exact steps.

    Parameters
    ----------
    mean : float
        [m]
    time_constant : float
        [s]
    spread : float
        Stationary standard deviation. [m]
    """

    mean: float
    time_constant: float
    spread: float

    title: ClassVar[str] = "Ornstein-Uhlenbeck"
    source: ClassVar[str] = "G. E. Uhlenbeck, L. S. Ornstein, Physical Review 36, 1930, doi:10.1103/PhysRev.36.823"
    departures: ClassVar[str] = ""

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Numbers of the smallest distance (`calibrate`)."""
        driver_means, mean = driver_means_of(runs), float(np.concatenate([run.offset for run in runs]).mean())
        bounds = {"time_constant": Bounds(0.5, 100.0), "spread": Bounds(0.003, 1.0)}
        return calibrate(lambda values: cls(driver_means=driver_means, mean=mean, **values), bounds, runs)

    def simulate(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """See `SimulatedModel.simulate`."""
        keep = float(np.exp(-batch.step / self.time_constant))
        kicks = self.spread * np.sqrt(1.0 - keep**2) * rng.standard_normal(batch.shape)
        return recursion(batch.start - self.mean, keep, kicks) + self.mean

    @property
    def settings(self) -> Mapping[str, float]:
        """Fitted numbers; [m], [s]."""
        return {"mean_m": self.mean, "time_constant_s": self.time_constant, "spread_m": self.spread}


def recursion(start: FloatArray, keep: float, kicks: FloatArray) -> FloatArray:
    """``x[k] = keep x[k-1] + kicks[k]`` along each row, with ``x[0] = start``.

    Shapes (n,) and (n, m); result (n, m).
    """
    kicks[:, 0] = start
    return first_order(kicks, keep)
