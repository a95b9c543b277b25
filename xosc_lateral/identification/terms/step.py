"""A step of the mean: a camera calibrated anew. Looked for together with a slow drift, which it competes with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Effect, Step
from xosc_lateral.identification.low_frequency import find_low_frequency
from xosc_lateral.identification.regression import Coarse, Fitted
from xosc_lateral.identification.seeds import LoopSeed
from xosc_lateral.identification.terms.base import Description, Outcome, Removal, Stage, Term, centred
from xosc_lateral.identification.terms.cycle import latent_path
from xosc_lateral.identification.terms.drift import DriftTerm

if TYPE_CHECKING:
    from xosc_lateral.identification.search import Search
from xosc_lateral.identification.timeline import on_fine_grid

FloatArray = NDArray[np.float64]

SAME_S = 90
"""Steps of two fits that are so close are the same one. [s]"""


@dataclass(frozen=True, eq=False)
class StepTerm(Term):
    """The mean jumps once.

    Parameters
    ----------
    at : int
        Row of the 1 Hz grid.
    """

    component: ClassVar[str] = "low_frequency"
    kind: ClassVar[str] = "step"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.LOW_FREQUENCY,)
    weight: ClassVar[float] = 3.0
    seen_held_out: ClassVar[bool] = False
    at: int

    def mean_columns(self, coarse: Coarse) -> FloatArray:
        """0 before, 1 after, shape (n, 1). [-]"""
        return (np.arange(len(coarse)) >= self.at).astype(np.float64)[:, None]

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """Step or drift, whichever explains more, beyond what an ordinary drift continues to."""
        if any(isinstance(term, StepTerm | DriftTerm) for term in fitted.terms):
            return None
        found = find_low_frequency(fitted.coarse, fitted, search.rng(LoopSeed.LOW_FREQUENCY))
        if found is None:
            return None
        term: Term = cls(found.at) if found.is_step else DriftTerm()
        return Outcome(term, (), found.p_value)

    def matches(self, other: Self) -> bool:
        """About the same moment."""
        return isinstance(other, StepTerm) and abs(self.at - other.at) <= SAME_S

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Height, moment, and the share of the drive before it: the mean stays."""
        coarse, part = fitted.coarse, fitted.mean_part(self)
        before = coarse.valid & (np.arange(len(coarse)) < self.at)
        return (
            Step(
                size=float(fitted.sizes[part][0]),
                size_error=float(np.sqrt(fitted.covariance[part, part][0, 0])),
                at_s=float(coarse.time[self.at]),
                share_before=float(before.sum() / coarse.valid.sum()),
            ),
        )

    def remove(self, fitted: Fitted, effects: tuple[Effect, ...], removal: Removal) -> None:
        """As fitted."""
        removal.location += on_fine_grid(centred(latent_path(self, fitted), fitted.coarse), fitted.coarse.timeline)

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Height and moment."""
        effect = effects[0]
        assert isinstance(effect, Step)
        statistic = f"mean by effect: {key}"
        return Description("step", f"at {effect.at_s:.0f} s", effect.size, effect.size_error, statistic, statistic)
