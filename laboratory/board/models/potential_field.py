"""Potentials: a driver rolls down the sum of what the lane's edges and the vehicles beside it raise.

After Chakroborty, Agrawal and Vasishtha, 2004; see `source`.
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
from xosc_lateral.drivers.drives.drive import Run

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class PotentialField(SimulatedModel):
    """Lateral acceleration down an exponential potential about both edges of the lane and a vehicle alongside.

    Parameters
    ----------
    strength : float
        Acceleration that an edge gives to a vehicle right on it. [m/s2]
    reach : float
        Distance over which it falls to 1/e. [m]
    friction : float
        Of the lateral speed. [1/s]
    noise : float
        Standard deviation of the random change of lateral speed in one second. [m/s]
    """

    strength: float
    reach: float
    friction: float
    noise: float

    title: ClassVar[str] = "potential field (Chakroborty et al.)"
    source: ClassVar[str] = (
        "P. Chakroborty, S. Agrawal, K. Vasishtha, Microscopic Modeling of Driver Behavior in Uninterrupted Traffic "
        "Flow, J. Transportation Engineering 130(4), 2004, doi:10.1061/(ASCE)0733-947X(2004)130:4(438)"
    )
    departures: ClassVar[str] = (
        "lateral part only; the paper's potentials could not be opened from here, their shape is taken as exponential; "
        "white noise added, without which nothing moves on an empty road"
    )

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Numbers of the smallest distance (`calibrate`)."""
        driver_means = driver_means_of(runs)
        bounds = {
            "strength": Bounds(0.01, 10.0),
            "reach": Bounds(0.1, 3.0),
            "friction": Bounds(0.02, 5.0),
            "noise": Bounds(0.0003, 0.5),
        }
        return calibrate(lambda values: cls(driver_means=driver_means, **values), bounds, runs)

    def force(self, offset: FloatArray, lane_width: FloatArray, beside: FloatArray) -> FloatArray:
        """Acceleration that the potentials give at rest. [m/s2] Shape (n,) each."""
        half = 0.5 * lane_width
        edges = np.exp(-(half + offset) / self.reach) - np.exp(-(half - offset) / self.reach)
        # A neighbour in the middle of its own lane, a lane's width away on the side `beside`.
        neighbour = np.abs(beside) * np.exp(-np.maximum(lane_width - beside * offset, 0.0) / self.reach)
        return np.asarray(self.strength * (edges - beside * neighbour))

    def simulate(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """See `SimulatedModel.simulate`."""
        return move(batch, rng, self.force, self.friction, self.noise)

    @property
    def settings(self) -> Mapping[str, float]:
        """Fitted numbers; [m], [m/s2], [-] as in their names."""
        return {
            "strength_m_s2": self.strength,
            "reach_m": self.reach,
            "friction_per_s": self.friction,
            "noise_m_s": self.noise,
        }


def move(batch: SegmentBatch, rng: np.random.Generator, force: object, friction: float, noise: float) -> FloatArray:
    """Offsets under a force, linear friction and white noise: exact friction, then the step (semi-implicit Euler).

    Shape (n, m). [m]
    """
    assert callable(force)
    n, m = batch.shape
    keep = float(np.exp(-friction * batch.step))
    speed, kicks = _drawn(batch, rng, friction, noise)
    offset = batch.start.copy()
    push = (1.0 - keep) / friction
    rows = np.empty((n, m))
    for k in range(m):
        rows[:, k] = offset
        acceleration = force(offset, batch.lane_width[:, k], batch.beside[:, k])
        speed = keep * speed + push * acceleration + kicks[:, k]
        edge = 0.5 * batch.lane_width[:, k]
        offset = np.clip(offset + speed * batch.step, -edge, edge)
        speed = np.where(np.abs(offset) >= edge, 0.0, speed)
    return rows


def _drawn(
    batch: SegmentBatch, rng: np.random.Generator, friction: float, noise: float
) -> tuple[FloatArray, FloatArray]:
    """Lateral speeds at the start, shape (n,), and what noise adds in each step, shape (n, m). [m/s]"""
    n, m = batch.shape
    keep = float(np.exp(-friction * batch.step))
    kick = noise * float(np.sqrt((1.0 - keep**2) / (2.0 * friction)))
    # Lateral speed of the stationary motion where the force is weak: a window begins amid a drive.
    speed = noise / np.sqrt(2.0 * friction) * rng.standard_normal(n)
    kicks = kick * rng.standard_normal((n, m))
    return speed, kicks
