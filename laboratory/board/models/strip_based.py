"""Strips: the lane divided lengthwise, and decisions to move one strip over (SiMTraM; Vissim moves alike).

After Mathew, Munigety and Bajpai, 2015; see `source`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from laboratory.board.models.batch import SegmentBatch
from laboratory.board.models.calibration import Bounds, calibrate
from laboratory.board.models.simulated import SimulatedModel, driver_means_of
from xosc_lateral.drivers.drives.drive import HALF_WIDTH, Run

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class StripBased(SimulatedModel):
    """Every so often the driver compares the strips left, right and here, and moves over at one lateral speed.

    Utility: minus `discipline` times the distance from the lane's middle in strips, plus Gumbel noise (a logit choice).
    Strips that the vehicle's body would leave the lane on are not open to it.

    Parameters
    ----------
    strip_width : float
        [m]
    interval : float
        Between two decisions, on average. [s]
    discipline : float
        Loss of utility per strip from the middle. [-]
    lateral_speed : float
        [m/s]
    """

    strip_width: float
    interval: float
    discipline: float
    lateral_speed: float

    title: ClassVar[str] = "strips (Mathew et al.; Vissim)"
    source: ClassVar[str] = (
        "T. V. Mathew, C. R. Munigety, A. Bajpai, Strip-Based Approach for the Simulation of Mixed Traffic Conditions, "
        "J. Computing in Civil Engineering 29(5), 2015, doi:10.1061/(ASCE)CP.1943-5487.0000378"
    )
    departures: ClassVar[str] = (
        "only the movement inside a lane of a vehicle that nobody obstructs: the gain in speed that utilities hold in "
        "the paper is equal for all strips; Vissim's own rules are not published"
    )

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Numbers of the smallest distance (`calibrate`)."""
        driver_means = driver_means_of(runs)
        bounds = {
            "strip_width": Bounds(0.03, 1.0),
            "interval": Bounds(0.4, 20.0),
            "discipline": Bounds(0.01, 3.0),
            "lateral_speed": Bounds(0.02, 1.0),
        }
        return calibrate(lambda values: cls(driver_means=driver_means, **values), bounds, runs)

    def simulate(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """See `SimulatedModel.simulate`."""
        n, m = batch.shape
        offset, target = batch.start.copy(), batch.start.copy()
        decide = rng.random((n, m)) < batch.step / self.interval
        error = rng.gumbel(size=(3, n, m))
        reach, moves = self.lateral_speed * batch.step, self.strip_width * np.array([0.0, -1.0, 1.0])
        rows = np.empty((n, m))
        for k in range(m):
            rows[:, k] = offset
            place = target + moves[:, None]
            room = np.maximum(0.5 * batch.lane_width[:, k] - HALF_WIDTH, 0.0)
            utility = error[:, :, k] - self.discipline * np.abs(place) / self.strip_width
            utility[1:][np.abs(place[1:]) > room] = -np.inf
            wanted = np.take_along_axis(place, utility.argmax(axis=0)[None], axis=0)[0]
            ready = decide[:, k] & (offset == target)
            target = np.where(ready, wanted, target)
            offset = offset + np.clip(target - offset, -reach, reach)
        return rows

    @property
    def settings(self) -> Mapping[str, float]:
        """Fitted numbers; [m], [s], [-] as in their names."""
        return {
            "strip_width_m": self.strip_width,
            "interval_s": self.interval,
            "discipline": self.discipline,
            "lateral_speed_m_s": self.lateral_speed,
        }
