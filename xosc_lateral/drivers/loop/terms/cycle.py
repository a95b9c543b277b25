"""A cycle of the mean that no column explains.

References
----------
.. [1] E. J. Hannan, "The estimation of frequency", J. Applied Probability 10, 1973.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.loop.dictionary import Search
from xosc_lateral.drivers.loop.model import Description, Fitted, Outcome, Stage, Term
from xosc_lateral.drivers.loop.residual import OSCILLATION
from xosc_lateral.drivers.loop.significance import MINIMUM_P
from xosc_lateral.drivers.loop.timeline import MIN_DRIFT_S, Coarse
from xosc_lateral.drivers.model.effects import Cycle, Effect

PERIODS_S = (4.0, 60.0)  # Periods that are tested. [s]
# Neighbouring frequencies taken together: a cycle keeps its phase for the whole drive, or for a part. [-]
WIDTHS = (1, 3, 7)
SURROUNDINGS = 60  # Frequencies to each side that say how high the spectrum is without a cycle. [-]


@dataclass(frozen=True, eq=False)
class CycleTerm(Term):
    """Sines and cosines of neighbouring frequencies."""

    component: ClassVar[str] = "cycle"
    kind: ClassVar[str] = "periodic"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.LOW_FREQUENCY,)
    weight: ClassVar[float] = 1.0
    seen_held_out: ClassVar[bool] = False
    frequency: float  # [1/s]
    width: int = 1  # Number of neighbouring frequencies: its phase drifts.

    def mean_columns(self, coarse: Coarse) -> FloatArray:
        """Cosines and sines for each drive, shape (n, 2 * width * drives)."""
        columns = np.zeros((len(coarse), coarse.drives, self.width, 2))
        for index in range(coarse.drives):
            rows = np.flatnonzero(coarse.drive == index)
            near = self.frequency + (np.arange(self.width) - self.width // 2) / len(rows)
            angle = 2.0 * np.pi * np.arange(len(rows))[:, None] * near
            columns[rows, index] = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        return columns.reshape(len(coarse), -1)

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """Highest spectral line of the whitened residual over its surroundings (F test), per long enough drive."""
        coarse = fitted.coarse
        if any(isinstance(term, cls) for term in fitted.terms):
            return None
        drives = [coarse.drive == index for index in range(coarse.drives)]
        lasting = [rows for rows in drives if coarse.valid[rows].sum() >= MIN_DRIFT_S]
        outcomes = [_line(fitted.innovations[rows], width) for rows in lasting for width in WIDTHS]
        if not outcomes:
            return None
        p_value, frequency, width = min(outcomes)
        return Outcome(cls(frequency, width), (), min(1.0, p_value * len(outcomes)))

    def matches(self, other: Self) -> bool:
        """About the same period."""
        return isinstance(other, CycleTerm) and bool(abs(np.log(self.frequency / other.frequency)) < 0.1)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Amplitude from the power of all its sines, noise taken out."""
        coarse, part = fitted.coarse, fitted.mean_part(self)
        sizes, errors = fitted.sizes[part], np.sqrt(np.maximum(np.diag(fitted.covariance)[part], 0.0))
        power = max(float(np.sum(sizes**2) - np.sum(errors**2)) / coarse.drives, 1e-8)
        seconds = float(coarse.valid.sum()) / coarse.drives
        coherence = 1e6 if self.width == 1 else seconds / (np.pi * self.width)
        amplitude, error = float(np.sqrt(power)), float(np.sqrt(np.mean(errors**2)))
        period = 1.0 / self.frequency
        return (Cycle(amplitude=amplitude, amplitude_error=error, period_s=period, coherence_s=float(coherence)),)

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Amplitude and period."""
        effect = effects[0]
        assert isinstance(effect, Cycle)
        shape = f"period {effect.period_s:.1f} s"
        return Description("weave", shape, effect.amplitude, effect.amplitude_error, OSCILLATION)


def _line(rows: FloatArray, width: int) -> tuple[float, float, int]:
    """p-value over all frequencies, the best frequency, the width."""
    from scipy.stats import f

    power = np.abs(np.fft.rfft(rows)) ** 2 / max(float(rows @ rows), 1e-12)
    frequency = np.fft.rfftfreq(len(rows))
    band = (frequency >= 1.0 / PERIODS_S[1]) & (frequency <= 1.0 / PERIODS_S[0])
    window, gap = np.ones(width), 2 * width + 11
    around = np.convolve(power, np.ones(2 * SURROUNDINGS + 1), "same") - np.convolve(power, np.ones(gap), "same")
    others = 2 * SURROUNDINGS + 1 - gap
    ratio = np.where(band, np.convolve(power, window, "same") / np.maximum(around / others, 1e-12), 0.0)
    at = int(np.argmax(ratio))
    single = float(f.sf(ratio[at] / width, 2 * width, 2 * others))
    return max(single * int(band.sum()), MINIMUM_P), float(frequency[at]), width
