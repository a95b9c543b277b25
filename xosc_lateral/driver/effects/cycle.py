"""A cycle: movement with a period that no column explains.

References
----------
.. [1] A. Demir, A. Mehrotra, J. Roychowdhury, "Phase noise in oscillators: a unifying theory", IEEE Trans. Circuits
       and Systems I 47, 2000: a phase in Brownian motion.
"""

from __future__ import annotations

from typing import ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.hidden import HiddenEffect

FloatArray = NDArray[np.float64]


class CycleState(msgspec.Struct):
    """Generator, first phase [turns], sum of the normal kicks so far [-], when the drive began [s]."""

    rng: np.random.Generator
    phase: float
    kicks: float = 0.0
    begun_at: float | None = None


class Cycle(HiddenEffect, frozen=True, kw_only=True):
    """A sine of constant amplitude whose phase starts anywhere and drifts.

    Parameters
    ----------
    amplitude : float
        [m]
    amplitude_error : float
        Standard error. [m]
    period_s : float
        [s]
    coherence_s : float
        Time after which the phase has drifted by one radian (standard deviation). [s]
    """

    positive: ClassVar[tuple[str, ...]] = ("amplitude", "period_s", "coherence_s")
    amplitude: float
    amplitude_error: float = 0.0
    period_s: float
    coherence_s: float = 1e6

    State: ClassVar[type[msgspec.Struct]] = CycleState

    def begin(self, rng: np.random.Generator, step: float) -> CycleState:
        """Any phase; terms have shape (n,). `step` in [s]."""
        return CycleState(rng, float(rng.random()))

    def advance(self, state: CycleState, time: FloatArray, step: float) -> EffectTerms:
        """A sine [m], shape (n,), whose phase drifts as Brownian motion does."""
        if state.begun_at is None:
            state.begun_at = float(time[0])
        kicks = np.cumsum(np.concatenate([[state.kicks], state.rng.normal(size=len(time))]))[1:]
        state.kicks = float(kicks[-1])
        drift = kicks * np.sqrt(step / self.coherence_s)
        phase = 2.0 * np.pi * (state.phase + (time - state.begun_at) / self.period_s) + drift
        return EffectTerms(location=self.amplitude * np.sin(phase))
