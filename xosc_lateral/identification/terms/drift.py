"""A slow drift of the mean over minutes: a driver changes, or a camera warms up. Tested beside a step (`step`).

References
----------
.. [1] U. K. Müller, M. W. Watson, "Testing models of low-frequency variability", Econometrica 76, 2008: half cosines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Drift, Effect
from xosc_lateral.identification.low_frequency import DRIFT_TERMS, half_cosines
from xosc_lateral.identification.regression import Coarse, Fitted
from xosc_lateral.identification.terms.base import Description, Outcome, Removal, Term, centred
from xosc_lateral.identification.terms.cycle import latent_path

if TYPE_CHECKING:
    from xosc_lateral.identification.search import Search
from xosc_lateral.identification.timeline import on_fine_grid

FloatArray = NDArray[np.float64]

CORRELATION_S = (60.0, 100.0, 170.0, 300.0, 500.0, 900.0, 1600.0, 3000.0)
"""Correlation times tried. [s]"""

SIZES = np.geomspace(0.01, 2.0, 60)
"""Standard deviations tried. [m]"""


@dataclass(frozen=True, eq=False)
class DriftTerm(Term):
    """Half cosines over every drive."""

    component: ClassVar[str] = "low_frequency"
    kind: ClassVar[str] = "drift"
    weight: ClassVar[float] = 3.0
    seen_held_out: ClassVar[bool] = False

    def mean_columns(self, coarse: Coarse) -> FloatArray:
        """Half cosines, within -1..1, shape (n, terms). [-]"""
        return half_cosines(coarse)

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """Nothing of its own: a step is looked for at the same time."""
        return None

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Ornstein-Uhlenbeck process by maximum likelihood over the half cosines' sizes."""
        coarse, part = fitted.coarse, fitted.mean_part(self)
        sizes, errors = fitted.sizes[part], np.diag(fitted.covariance)[part]
        duration = float(coarse.valid.sum()) / coarse.drives
        number = np.arange(len(sizes)) % DRIFT_TERMS + 1
        best = (-np.inf, 0.1, 300.0)
        for time in CORRELATION_S:
            # variance of the k-th half cosine's size: power density of the process at k / (2 T), two-sided, times 2 / T
            shape = 2.0 / duration * 2.0 * time / (1.0 + (np.pi * number / duration * time) ** 2)
            for size in SIZES:
                variance = size**2 * shape + errors
                likelihood = -0.5 * float(np.sum(sizes**2 / variance + np.log(variance)))
                best = max(best, (likelihood, float(size), time))
        return (Drift(size=best[1], size_error=best[1] / np.sqrt(2.0 * len(sizes)), correlation_s=best[2]),)

    def remove(self, fitted: Fitted, effects: tuple[Effect, ...], removal: Removal) -> None:
        """As fitted."""
        removal.location += on_fine_grid(centred(latent_path(self, fitted), fitted.coarse), fitted.coarse.timeline)

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Standard deviation and correlation time."""
        effect = effects[0]
        assert isinstance(effect, Drift)
        shape, statistic = f"correlated over {effect.correlation_s:.0f} s", "movement by band"
        return Description("slow drift", shape, effect.size, effect.size_error, statistic, statistic)
