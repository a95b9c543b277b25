"""`lcSigma` as a SUMO that is really run has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from laboratory.board.models.lc_sigma import LcSigma
from laboratory.board.models.sumo_process import simulate_sumo
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import Run

FloatArray = NDArray[np.float64]

NEAREST = 20
"""A window begins at one of so many moments whose offset is nearest to the start."""


@dataclass(frozen=True, eq=False)
class SumoRun:
    """Stretches of a SUMO simulation's tracks: vehicles alone on their lanes, steps of 0.2 s.

    Parameters
    ----------
    sigma : float
        `lcSigma`. [-]
    seed : int
        SUMO's own.
    """

    sigma: float
    seed: int = 1
    _tracks: list[FloatArray] = field(default_factory=list, repr=False)

    title: ClassVar[str] = "lcSigma (SUMO run)"
    source: ClassVar[str] = "Eclipse SUMO, package eclipse-sumo on PyPI, run with --step-length 0.2"
    departures: ClassVar[str] = "lcSigma is fitted by its formula; stretches are moved to their start by centimetres"

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """The formula's best `lcSigma`."""
        return cls(LcSigma.fit(runs).sigma)

    @cached_property
    def tracks(self) -> FloatArray:
        """Offsets of the simulated vehicles, shape (vehicles, steps), positive left. [m]"""
        return simulate_sumo(self.sigma, self.seed)

    def sample(
        self, segments: Sequence[Segment], starts: FloatArray | None, rng: np.random.Generator
    ) -> list[FloatArray]:
        """See `LateralModel.sample`."""
        tracks, found = self.tracks, []
        for number, segment in enumerate(segments):
            length = segment.lane_width[segment.inside].size
            first = tracks[:, : max(tracks.shape[1] - length, 1)]
            if starts is None:
                place = int(rng.integers(first.size))
            else:
                gaps = np.abs(first - starts[number]).ravel()
                place = int(rng.choice(np.argpartition(gaps, NEAREST)[:NEAREST]))
            vehicle, row = np.unravel_index(place, first.shape)
            path = _repeated(tracks[vehicle, row:], length)
            found.append(path if starts is None else path - path[0] + starts[number])
        return found

    @property
    def settings(self) -> Mapping[str, float]:
        """The fitted number. [-]"""
        return {"sigma": self.sigma}


def _repeated(path: FloatArray, length: int) -> FloatArray:
    """A path as long as wanted: what is beyond its end goes back the way it came."""
    while len(path) < length:
        path = np.concatenate([path, path[-2::-1]])
    return path[:length]
