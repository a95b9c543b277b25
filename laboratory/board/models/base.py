"""What every model on the board can do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import Run

FloatArray = NDArray[np.float64]


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
