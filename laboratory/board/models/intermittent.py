"""Intermittent control: nothing is done until the evidence for an error suffices, then one bell-shaped correction.

After Markkula, Boer, Romano and Merat, 2018; see `source`.
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

ADJUSTMENT = 0.4
"""Duration of one steering adjustment, as in the paper. [s]"""
LEAK = 0.5
"""Of the accumulator: forgets in 2 s. [1/s]"""


@dataclass(frozen=True, eq=False, kw_only=True)
class Intermittent(SimulatedModel):
    """Evidence of a lateral error builds up; at its threshold the driver steers once, by what the error asks for.

    The lateral acceleration that would bring the vehicle to its place of preference within the look-ahead time is
    ``-2 (x + v T) / T²``. The error is what of it the steering so far, adjustments under way included, does not give.

    Parameters
    ----------
    look_ahead : float
        [s]
    threshold : float
        Error that alone makes a driver act after 1.4 s: after a second, were nothing forgotten. [m/s2]
    accumulator_noise : float
        Standard deviation in one second, threshold 1. [-]
    motor_noise : float
        Standard deviation of an adjustment relative to its size. [-]
    unrest : float
        Standard deviation in one second of the random change of lateral speed by road and wind. [m/s]
    """

    look_ahead: float
    threshold: float
    accumulator_noise: float
    motor_noise: float
    unrest: float

    title: ClassVar[str] = "intermittent control (Markkula et al.)"
    source: ClassVar[str] = (
        "G. Markkula, E. Boer, R. Romano, N. Merat, Sustained sensorimotor control as intermittent decisions about "
        "prediction errors, Biological Cybernetics 112, 2018, doi:10.1007/s00422-017-0743-9, arXiv:1703.03030"
    )
    departures: ClassVar[str] = (
        "steers lateral acceleration, not a wheel (no vehicle dynamics); instead of the predicted course of the error, "
        "adjustments under way count as done; the accumulator's leak is fixed"
    )

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Numbers of the smallest distance (`calibrate`)."""
        driver_means = driver_means_of(runs)
        bounds = {
            "look_ahead": Bounds(2.0, 20.0),
            "threshold": Bounds(0.003, 0.5),
            "accumulator_noise": Bounds(0.02, 1.5),
            "motor_noise": Bounds(0.02, 1.0),
            "unrest": Bounds(0.0001, 0.1),
        }
        return calibrate(lambda values: cls(driver_means=driver_means, **values), bounds, runs)

    def simulate(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """See `SimulatedModel.simulate`."""
        return self.drive(batch, rng)[0]

    def drive(self, batch: SegmentBatch, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        """Offsets and the driver's lateral acceleration, shape (n, m) each. [m], [m/s2]"""
        n, m = batch.shape
        step, parts = batch.step, round(ADJUSTMENT / batch.step)
        shares = _bell(parts)
        settle = round(20.0 / step)
        preferred = batch.start
        offset, speed, steer, evidence = preferred.copy(), np.zeros(n), np.zeros(n), np.zeros(n)
        planned = np.zeros((n, parts))
        evidence_noise = self.accumulator_noise * np.sqrt(step) * rng.standard_normal((settle + m, n))
        motor = 1.0 + self.motor_noise * rng.standard_normal((settle + m, n))
        unrest = self.unrest * np.sqrt(step) * rng.standard_normal((settle + m, n))
        rows, steering = np.empty((n, m)), np.empty((n, m))
        for k in range(settle + m):
            if k >= settle:
                rows[:, k - settle], steering[:, k - settle] = offset, steer
            away = offset - preferred
            wanted = -2.0 * (away + speed * self.look_ahead) / self.look_ahead**2
            error = wanted - steer - planned.sum(axis=1)
            evidence = evidence + (error / self.threshold - LEAK * evidence) * step + evidence_noise[k]
            act = np.abs(evidence) >= 1.0
            planned[act] += (motor[k, act] * error[act])[:, None] * shares
            evidence = np.where(act, 0.0, evidence)
            steer = steer + planned[:, 0]
            planned = np.concatenate([planned[:, 1:], np.zeros((n, 1))], axis=1)
            speed = speed + steer * step + unrest[k]
            offset = offset + speed * step
        # The window begins amid a drive: what the driver prefers is where the window's start puts it.
        return rows - rows[:, :1] + batch.start[:, None], steering

    @property
    def settings(self) -> Mapping[str, float]:
        """Fitted numbers; [m], [s], [-] as in their names."""
        return {
            "look_ahead_s": self.look_ahead,
            "threshold_m_s2": self.threshold,
            "accumulator_noise": self.accumulator_noise,
            "motor_noise": self.motor_noise,
            "unrest_m_s": self.unrest,
        }


def _bell(parts: int) -> FloatArray:
    """Shares of an adjustment in each of its steps, shape (parts,). [-]"""
    # A bell-shaped rate, as shares of the adjustment in each step (raised cosine).
    edges = np.linspace(0.0, 1.0, parts + 1)
    shares = np.diff(edges - np.sin(2.0 * np.pi * edges) / (2.0 * np.pi))
    return np.asarray(shares)
