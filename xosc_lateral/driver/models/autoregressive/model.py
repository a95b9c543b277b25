"""Our model: drivers that differ, coarse movement with a memory, fine noise, both of a volatility that varies.

Two levels as in the paper's, x = kappa + phi, each repaired where it falls short:

- kappa is the driver's own mean plus an autoregression of order 16 at one step a second, brought to 5 Hz by a low-pass:
  memory beyond one step, and a smooth path instead of a staircase.
- phi is uniform white noise shaped by a kernel, as in the paper, with a spectrum that complements that of kappa.
- A factor on either, the volatility, differs between drivers and varies while driving; both are correlated.
- A driver is drawn for a whole drive. A drive that must start at an offset is one of those that pass through it: the
  driver is drawn given the offset, and the movement is conditioned on it, exactly for Gaussian movement.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from xosc_lateral.driver.models.autoregressive.parameters import AutoregressiveParameters
from xosc_lateral.driver.models.autoregressive.stream import AutoregressiveState, AutoregressiveStream, begin
from xosc_lateral.driver.models.base import Start


class AutoregressiveModel(AutoregressiveParameters, frozen=True, eq=False, dict=True):
    """See `AutoregressiveParameters`."""

    State: ClassVar[type] = AutoregressiveState

    def stream(
        self, seed: np.random.SeedSequence, start: Start | None = None, *, drivers: int | None = None
    ) -> AutoregressiveStream:
        """Begin a drive, with a driver of its own; see `CoreModel.stream`."""
        return begin(self, seed, start, drivers)

    def resume(self, state: AutoregressiveState) -> AutoregressiveStream:
        """Go on from a state."""
        return AutoregressiveStream(self, state)
