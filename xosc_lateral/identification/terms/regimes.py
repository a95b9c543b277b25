"""Loud and quiet stretches that no column tells apart: distraction, say.

References
----------
.. [1] J. D. Hamilton, "A new approach to the economic analysis of nonstationary time series and the business cycle",
       Econometrica 57, 1989.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Effect, Regimes
from xosc_lateral.identification.log_scale import squared_innovations
from xosc_lateral.identification.markov_switching import RegimeFit, fit_regimes
from xosc_lateral.identification.regression import Coarse, Fitted
from xosc_lateral.identification.significance import upper_tail
from xosc_lateral.identification.squares import SLOW_S, fine_squares, log_sizes, slow_squares
from xosc_lateral.identification.terms.base import Description, Outcome, Removal, Term
from xosc_lateral.identification.terms.column import columns_on_size
from xosc_lateral.identification.terms.spread import known_log_scale

if TYPE_CHECKING:
    from xosc_lateral.identification.search import Search
from xosc_lateral.identification.timeline import on_fine_grid

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MEMORIES_S = (6.0, 15.0, 40.0)
"""Lengths of regimes that are looked for. [s]"""

SHORTEST_S = 20
"""Loudness that comes and goes faster is how people steer, by a correction now and then, and no regime. Clusters of up
to 6 s are taken for regimes on 4 of 10 such movements with 8 s here, on 1 of 10 with 20 s. [s]"""

SHUFFLES = 400
"""Random orders of the seconds that are the null."""


@dataclass(frozen=True, eq=False)
class RegimesTerm(Term):
    """Two-state Markov chain in the log scale.

    Parameters
    ----------
    fit : RegimeFit
    """

    component: ClassVar[str] = "regimes"
    kind: ClassVar[str] = "regime"
    seen_held_out: ClassVar[bool] = False
    fit: RegimeFit = field(repr=False)

    def known_scale(self, coarse: Coarse) -> FloatArray | None:
        """As far as the regimes can be told, about its mean."""
        scale = self.fit.on * np.log(self.fit.factor)
        return np.asarray(scale - scale[coarse.valid].mean())

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """Weighted autocovariance of the squared innovations; null: the same seconds in random order."""
        coarse = fitted.coarse
        if not coarse.lasts or any(isinstance(term, cls) for term in fitted.terms):
            return None
        # what a column does to the size in another shape than the one that was found is no regime either
        known = [known_log_scale(fitted), search.cross_basis(columns_on_size(fitted))]
        p_value = _probability(fitted, np.concatenate(known, axis=1), search.rng(3))
        return Outcome(cls(fit_regimes(fitted.rows, coarse.valid)), (), p_value)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Regimes are told by the innovations; what they do to the movement itself may be more."""
        on = self.fit.on[:, None]
        # the fit holds the regimes' scale already; squares of its innovations say what is left of them
        fine = float(log_sizes(fine_squares(fitted), on)[0][0])
        moved = float(log_sizes(slow_squares(fitted), on)[0][0])
        factor = self.fit.factor * max(1.0, float(np.exp(moved)))
        loud = float(np.sum(self.fit.on[fitted.coarse.valid]))
        error = factor / np.sqrt(2.0 * max(loud / SLOW_S, 1.0))
        lengths = {"on_s": self.fit.on_s, "off_s": self.fit.off_s}
        return (Regimes(factor=factor, factor_error=error, fine_factor=float(np.exp(fine)), **lengths),)

    def remove(self, fitted: Fitted, effects: tuple[Effect, ...], removal: Removal) -> None:
        """By the probability that the loud regime is on."""
        effect = effects[0]
        assert isinstance(effect, Regimes)
        on = on_fine_grid(self.fit.on, fitted.coarse.timeline)
        removal.spread += on * np.log(effect.factor)
        removal.fine += on * np.log(effect.fine_factor)

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Factor and mean lengths."""
        effect = effects[0]
        assert isinstance(effect, Regimes)
        shape = f"on for {effect.on_s:.0f} s, off for {effect.off_s:.0f} s on average"
        statistic = "quantiles of local spread"
        return Description("on/off regimes", shape, effect.factor, effect.factor_error, statistic, statistic)


def _probability(fitted: Fitted, known: FloatArray, rng: np.random.Generator) -> float:
    coarse = fitted.coarse
    squares = squared_innovations(fitted.rows, coarse.valid)
    if known.shape[1]:
        basis = np.linalg.qr((known - known[coarse.valid].mean(axis=0)) * coarse.valid[:, None])[0]
        squares = squares - basis @ (basis.T @ squares)
    rows, shuffled, null = np.flatnonzero(coarse.valid), np.zeros(len(squares)), []
    for _ in range(SHUFFLES):
        shuffled[rows] = rng.permutation(squares[rows])
        null.append(_scores(shuffled, coarse.valid).max())
    observed = float(_scores(squares, coarse.valid).max())
    return upper_tail(observed * abs(observed), np.asarray(null) * np.abs(null))


def _scores(squares: FloatArray, valid: BoolArray) -> FloatArray:
    longest = int(3 * max(MEMORIES_S))
    size = len(squares) + longest
    transform = np.fft.rfft(squares, size)
    lags = np.arange(SHORTEST_S, longest + 1)
    covariance = np.fft.irfft(np.abs(transform) ** 2, size)[lags] / np.sqrt(valid.sum())
    weights = np.exp(-lags[None, :] / np.asarray(MEMORIES_S)[:, None])
    return np.asarray(weights @ covariance / np.sqrt((weights**2).sum(axis=1)))
