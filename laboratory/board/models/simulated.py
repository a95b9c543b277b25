"""What models have in common that move a batch of windows step by step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from laboratory.board.models.batch import SegmentBatch, batch_of
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import STEP, Run

FloatArray = NDArray[np.float64]

BURN_IN = 60.0
"""Before a free run, a model moves so long in what the run begins with. [s]"""


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulatedModel(ABC):
    """A model that moves a batch of windows step by step.

    Parameters
    ----------
    driver_means : array, shape (k,)
        Mean offsets of the drivers that were fitted: a free run's driver takes one of them where the model has a
        preferred place. [m]
    """

    driver_means: FloatArray = field(default_factory=lambda: np.zeros(1))

    @abstractmethod
    def simulate(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """Offsets, shape (n, m), from `batch.start` at the first row on. [m]"""

    def free_starts(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Where n free runs begin, a minute before they are looked at. [m] Shape (n,)."""
        return np.asarray(rng.choice(self.driver_means, n))

    def sample(
        self, segments: Sequence[Segment], starts: FloatArray | None, rng: np.random.Generator
    ) -> list[FloatArray]:
        """See `LateralModel.sample`."""
        if not segments:
            return []
        if starts is None:
            warm = round(BURN_IN / STEP)
            batch = batch_of(segments, self.free_starts(len(segments), rng)).with_burn_in(warm)
            rows = self.simulate(batch, rng)[:, warm:]
        else:
            rows = self.simulate(batch_of(segments, starts), rng)
        lengths = [segment.lane_width[segment.inside].size for segment in segments]
        return [row[:length] for row, length in zip(rows, lengths, strict=True)]


def driver_means_of(runs: Sequence[Run]) -> FloatArray:
    """Mean offset of each driver. [m] Shape (drivers,)."""
    names = sorted({run.drive for run in runs})
    return np.array([np.concatenate([run.offset for run in runs if run.drive == name]).mean() for name in names])
