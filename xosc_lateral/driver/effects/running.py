"""Terms of hidden effects piece by piece, in constant memory: for drives without an end."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import EffectTerms

FloatArray = NDArray[np.float64]


class RunningTerms(Protocol):
    """One hidden effect on one drive; pieces together are what `terms` gives for the whole."""

    def take(self, time: FloatArray) -> EffectTerms:
        """Terms for the next rows of an even grid, which go on where those of the last call ended. [s]"""
        ...
