"""A stochastic differential equation whose noise can't grow beyond a bound.

After Qi, Ying and Zhang, 2022; see `source`.
"""

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


@dataclass(frozen=True, eq=False, kw_only=True)
class BoundedNoise(SimulatedModel):
    """``dx/dt = (mean - x) / relaxation + bound sin(sqrt(2 / memory) W(t))``, W a Wiener process.

    Parameters
    ----------
    mean : float
        [m]
    relaxation : float
        [s]
    bound : float
        Of the noise: a lateral speed. [m/s]
    memory : float
        Time constant of the noise. [s]
    """

    mean: float
    relaxation: float
    bound: float
    memory: float

    title: ClassVar[str] = "bounded noise (Qi et al.)"
    source: ClassVar[str] = (
        "H. Qi, Y. Ying, J. Zhang, Stochastic lateral noise and movement by Brownian differential models, IEEE "
        "Intelligent Vehicles Symposium 2022, doi:10.1109/IV51971.2022.9827388; sine-Wiener noise: A. d'Onofrio (ed.), "
        "Bounded Noises in Physics, Biology, and Engineering, Birkhäuser 2013, doi:10.1007/978-1-4614-7385-5"
    )
    departures: ClassVar[str] = (
        "only the abstract could be opened from here (a transformed Brownian motion inside a differential equation of "
        "the lateral movement); the transformation is taken to be the sine"
    )

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Numbers of the smallest distance (`calibrate`)."""
        driver_means, mean = driver_means_of(runs), float(np.concatenate([run.offset for run in runs]).mean())
        bounds = {"relaxation": Bounds(0.5, 100.0), "bound": Bounds(0.01, 1.0), "memory": Bounds(0.1, 20.0)}
        return calibrate(lambda values: cls(driver_means=driver_means, mean=mean, **values), bounds, runs)

    def noise(self, n: int, m: int, step: float, rng: np.random.Generator) -> FloatArray:
        """Stationary sine-Wiener noise, shape (n, m). [m/s]"""
        phase = rng.uniform(0.0, 2.0 * np.pi, (n, 1))
        steps = np.sqrt(2.0 * step / self.memory) * rng.standard_normal((n, m))
        return np.asarray(self.bound * np.sin(phase + np.cumsum(steps, axis=1)))

    def simulate(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """See `SimulatedModel.simulate`."""
        n, m = batch.shape
        keep = float(np.exp(-batch.step / self.relaxation))
        kicks = self.relaxation * (1.0 - keep) * self.noise(n, m, batch.step, rng)
        kicks = np.concatenate([kicks[:, :1], kicks[:, :-1]], axis=1)
        return recursion(batch.start - self.mean, keep, kicks) + self.mean

    @property
    def settings(self) -> Mapping[str, float]:
        """Fitted numbers; [m], [s], [-] as in their names."""
        return {
            "mean_m": self.mean,
            "relaxation_s": self.relaxation,
            "bound_m_s": self.bound,
            "memory_s": self.memory,
        }
