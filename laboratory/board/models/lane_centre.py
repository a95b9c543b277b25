"""The middle of the lane: what a maneuver-based scenario does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import Run

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LaneCentre:
    """No offset at all."""

    title: ClassVar[str] = "lane centre"
    source: ClassVar[str] = "ASAM OpenSCENARIO XML 1.3: LanePosition with offset 0, no lateral action"
    departures: ClassVar[str] = ""

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Nothing to fit."""
        return cls()

    def sample(
        self, segments: Sequence[Segment], starts: FloatArray | None, rng: np.random.Generator
    ) -> list[FloatArray]:
        """See `LateralModel.sample`; `starts` are not kept."""
        return [np.zeros(segment.lane_width[segment.inside].size) for segment in segments]

    @property
    def settings(self) -> Mapping[str, float]:
        """None. [-]"""
        return {}
