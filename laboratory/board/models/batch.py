"""Segments as arrays of one length: what step-by-step models are simulated on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import STEP

FloatArray = NDArray[np.float64]

MEAN_SPEED = 30.0
"""Where a segment has no speed. [m/s]"""

ALONGSIDE = 5.0
"""A vehicle in the next lane counts as alongside within this longitudinal distance: a car's length. [m]"""


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
    # Several windows of one segment are common (ensembles, calibration): each segment is read once.
    different = list(dict.fromkeys(segments))
    row_of = {segment: row for row, segment in enumerate(different)}
    rows = [row_of[segment] for segment in segments]
    length = max(segment.lane_width[segment.inside].size for segment in different)

    def column(name: str, fill: float) -> FloatArray:
        return np.array([_padded(segment, name, fill, length) for segment in different])[rows]

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
