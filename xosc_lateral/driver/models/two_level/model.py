"""The paper's model to the letter: smoothed Markov chain + shaped uniform noise, x = kappa + phi.

Reference: N. Neis, J. Beyerer, "Modelling of lateral movement within the lane", arXiv:2405.17080, section III.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from xosc_lateral.driver.models.base import Start
from xosc_lateral.driver.models.two_level.parameters import TwoLevelParameters
from xosc_lateral.driver.models.two_level.stream import TwoLevelState, TwoLevelStream, begin


class TwoLevelModel(TwoLevelParameters, frozen=True, eq=False, dict=True):
    """See `TwoLevelParameters`."""

    State: ClassVar[type] = TwoLevelState

    def stream(
        self, seed: np.random.SeedSequence, start: Start | None = None, *, drivers: int | None = None
    ) -> TwoLevelStream:
        """Begin a drive; without `start` in a bin drawn from the stationary distribution. See `CoreModel.stream`."""
        return begin(self, seed, start, drivers)

    def resume(self, state: TwoLevelState) -> TwoLevelStream:
        """Go on from a state."""
        return TwoLevelStream(self, state)
