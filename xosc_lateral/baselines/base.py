"""What every model on the board can do, and the batch of equal-length windows that most of them are simulated on."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]

BURN_IN = 60.0
"""Before a free run, a model moves so long in what the run begins with. [s]"""

MEAN_SPEED = 30.0
"""Where a segment has no speed. [m/s]"""

ALONGSIDE = 5.0
"""A vehicle in the next lane counts as alongside within this longitudinal distance: a car's length. [m]"""


class LateralModel(Protocol):
    """A model of how vehicles move inside their lane."""

    title: ClassVar[str]
    """As the board calls it."""
    source: ClassVar[str]
    """Where it was published."""
    departures: ClassVar[str]
    """What is not as published, and why; empty: nothing."""

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Fit to measured runs as well as the model can be."""
        ...

    def sample(
        self, segments: Sequence[Segment], starts: FloatArray | None, rng: np.random.Generator
    ) -> list[FloatArray]:
        """Offsets of each segment's own driver.

        Parameters
        ----------
        segments : sequence of Segment
            At steps of 0.2 s.
        starts : array, shape (len(segments),), or None
            Offset at each first row [m]; None: a free run that begins as chance has it.
        rng : numpy.random.Generator

        Returns
        -------
        list of array
            One value per row inside the segment, positive to the LEFT of travel. [m]
        """
        ...

    @property
    def settings(self) -> Mapping[str, float]:
        """The fitted numbers, units in the names or in the class's docstring."""
        ...


@dataclass(frozen=True, eq=False)
class SegmentBatch:
    """Segments as arrays of one length: shorter ones are continued by their last row, and cut again afterwards.

    Parameters
    ----------
    start : array, shape (n,)
        Offset that the first row has. [m]
    lane_width, speed, curvature : array, shape (n, m)
        [m], [m/s], [1/m] positive left.
    beside : array, shape (n, m)
        -1: a vehicle alongside on the right only, +1: on the left only, 0: on none or both. [-]
    step : float
        [s]
    """

    start: FloatArray
    lane_width: FloatArray
    speed: FloatArray
    curvature: FloatArray
    beside: FloatArray
    step: float = STEP

    @property
    def shape(self) -> tuple[int, int]:
        """Windows and rows."""
        return self.lane_width.shape[0], self.lane_width.shape[1]

    def with_burn_in(self, rows: int) -> SegmentBatch:
        """The same with so many rows of its first row before it."""

        def longer(values: FloatArray) -> FloatArray:
            return np.concatenate([np.repeat(values[:, :1], rows, axis=1), values], axis=1)

        return SegmentBatch(
            self.start, longer(self.lane_width), longer(self.speed), longer(self.curvature), longer(self.beside)
        )


def batch_of(segments: Sequence[Segment], starts: FloatArray) -> SegmentBatch:
    """Arrays of the longest segment's length. `starts` of shape (n,). [m]"""
    length = max(segment.lane_width[segment.inside].size for segment in segments)

    def column(name: str, fill: float) -> FloatArray:
        return np.array([_padded(segment, name, fill, length) for segment in segments])

    left = column("left_distance", np.inf) < ALONGSIDE
    right = column("right_distance", np.inf) < ALONGSIDE
    return SegmentBatch(
        np.asarray(starts, dtype=np.float64),
        column("lane_width", np.nan),
        column("speed", MEAN_SPEED),
        column("curvature", 0.0),
        left.astype(np.float64) - right.astype(np.float64),
    )


def _padded(segment: Segment, name: str, fill: float, length: int) -> FloatArray:
    if name in ("lane_width", "speed"):
        values = getattr(segment, name)[segment.inside]
    elif name in segment.context:
        values = segment.context[name][segment.inside]
    else:
        return np.full(length, fill)
    values = np.where(np.isnan(values), fill, values)
    return np.concatenate([values, np.full(length - len(values), values[-1])])


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
