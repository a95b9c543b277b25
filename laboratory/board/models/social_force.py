"""Social forces: a spring to the lane's middle, friction, and a push away from whoever drives alongside.

After Delpiano, Herrera, Laval and Coeymans, 2020; see `source`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from laboratory.board.models.batch import ALONGSIDE, SegmentBatch
from laboratory.board.models.calibration import Bounds, calibrate
from laboratory.board.models.potential_field import move
from laboratory.board.models.simulated import SimulatedModel, driver_means_of
from xosc_lateral.drivers.drives.drive import Run

FloatArray = NDArray[np.float64]

PUBLISHED_SHIFT = 0.05
"""Least mean deviation with a vehicle vis-à-vis, from three recordings (Delpiano et al. 2015). [m]"""


@dataclass(frozen=True, eq=False, kw_only=True)
class SocialForce(SimulatedModel):
    """``a = -stiffness x - friction v - push beside + noise``.

    Parameters
    ----------
    stiffness : float
        Of the spring to the lane's middle. [1/s2]
    friction : float
        [1/s]
    noise : float
        Standard deviation of the random change of lateral speed in one second. [m/s]
    shift : float
        How far a vehicle alongside moves the place of rest; the push is stiffness times it. [m]
    """

    stiffness: float
    friction: float
    noise: float
    shift: float = PUBLISHED_SHIFT

    title: ClassVar[str] = "social force (Delpiano et al.)"
    source: ClassVar[str] = (
        "R. Delpiano, J. C. Herrera, J. Laval, J. E. Coeymans, A two-dimensional car-following model for "
        "two-dimensional traffic flow problems, Transportation Research C 114, 2020; R. Delpiano, Understanding the "
        "Lateral Dimension of Traffic, Transportation Research Record 2675, 2021; the shift beside a vehicle: "
        "Characteristics of lateral vehicle interaction, Transportmetrica A 11, 2015, doi:10.1080/23249935.2015.1059377"
    )
    departures: ClassVar[str] = (
        "lateral part only; the push has one size, since tables hold no lateral gap; white noise added; the full texts "
        "could not be opened from here (the abstract of 2015 could)"
    )

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """The shift from the runs where neighbours are known, the rest by the smallest distance (`calibrate`)."""
        driver_means, shift = driver_means_of(runs), shift_beside(runs)
        bounds = {"stiffness": Bounds(0.001, 3.0), "friction": Bounds(0.02, 5.0), "noise": Bounds(0.0003, 0.5)}
        return calibrate(lambda values: cls(driver_means=driver_means, shift=shift, **values), bounds, runs)

    def force(self, offset: FloatArray, lane_width: FloatArray, beside: FloatArray) -> FloatArray:
        """Acceleration at rest. [m/s2] Shape (n,) each."""
        return np.asarray(-self.stiffness * (offset + self.shift * beside))

    def simulate(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """See `SimulatedModel.simulate`."""
        return move(batch, rng, self.force, self.friction, self.noise)

    @property
    def settings(self) -> Mapping[str, float]:
        """Fitted numbers; [m], [1/s2], [-] as in their names."""
        return {
            "stiffness_per_s2": self.stiffness,
            "friction_per_s": self.friction,
            "noise_m_s": self.noise,
            "shift_m": self.shift,
        }


def shift_beside(runs: Sequence[Run]) -> float:
    """How far drivers move away from a vehicle alongside, within drivers; the published one where none is known. [m]"""
    away, weight = 0.0, 0.0
    for name in sorted({run.drive for run in runs}):
        own = [run for run in runs if run.drive == name]
        offset = np.concatenate([run.offset for run in own])
        beside = np.concatenate([_beside(run) for run in own])
        centred = beside - beside.mean()
        away -= float(centred @ offset)
        weight += float(centred @ centred)
    return away / weight if weight > 0.0 else PUBLISHED_SHIFT


def _beside(run: Run) -> FloatArray:
    def near(name: str) -> FloatArray:
        values = run.context.get(name)
        return np.zeros(len(run)) if values is None else (np.nan_to_num(values, nan=np.inf) < ALONGSIDE).astype(float)

    return near("left_distance") - near("right_distance")
