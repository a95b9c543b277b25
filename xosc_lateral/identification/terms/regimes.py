"""Loud and quiet stretches that no column tells apart: distraction, say.

A two-state Markov chain [1]_. The null is a movement that is loud or quiet for no longer than `CLUSTER_S`: its own
squares, in blocks of that length, in random order [2]_.

References
----------
.. [1] J. D. Hamilton, "A new approach to the economic analysis of nonstationary time series and the business cycle",
       Econometrica 57, 1989.
.. [2] E. Carlstein, "The use of subseries values for estimating the variance of a general statistic from a stationary
       sequence", Annals of Statistics 14, 1986: blocks that do not overlap. Dealt without replacement: a permutation
       test, of blocks that are taken for exchangeable.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Effect, Regimes
from xosc_lateral.identification.dictionary import in_another_order
from xosc_lateral.identification.innovations import squared_innovations
from xosc_lateral.identification.markov_switching import RegimeFit, fit_regimes
from xosc_lateral.identification.regression import Coarse, Fitted
from xosc_lateral.identification.significance import HEAVY_TAIL_SHARE, LoopSeed, upper_tail
from xosc_lateral.identification.squares import SLOW_S, fine_squares, log_sizes, slow_squares
from xosc_lateral.identification.terms.base import Description, Outcome, Removal, Stage, Term
from xosc_lateral.identification.terms.spread import known_log_scale, what_a_column_may_do, what_columns_do

if TYPE_CHECKING:
    from xosc_lateral.identification.search import Search
from xosc_lateral.identification.timeline import on_fine_grid

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MEMORIES_S = (6.0, 15.0, 40.0)
"""Lengths of regimes that are looked for. [s]"""

CLUSTER_S = 15
"""Loudness that persists for up to this is how people steer, by a correction now and then and what it takes to settle,
and no regime. Sensitivity: docs/design/identification.md. [s]"""

SHORTEST_S = 12
"""Lags are compared from here on. [s]"""

DRAWS = (400, 3600)
"""Orders of the blocks that are the null; the second lot where the first leaves it open."""

UNSURE = 0.05
"""Larger p-values of the first lot are large enough, whatever the second would say. [-]"""


@dataclass(frozen=True, eq=False)
class RegimesTerm(Term):
    """Two-state Markov chain in the log scale.

    Parameters
    ----------
    fit : RegimeFit
    """

    component: ClassVar[str] = "regimes"
    kind: ClassVar[str] = "regime"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.REGIMES,)
    weight: ClassVar[float] = 2.5
    seen_held_out: ClassVar[bool] = False
    fit: RegimeFit = field(repr=False)

    def known_scale(self, coarse: Coarse) -> FloatArray | None:
        """As far as the regimes can be told, about its mean, shape (n,). [-]"""
        scale = self.fit.on * np.log(self.fit.factor)
        return np.asarray(scale - scale[coarse.valid].mean())

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """Weighted autocovariance of the squared innovations; null: blocks of the same squares in another order."""
        coarse = fitted.coarse
        if not coarse.lasts or any(isinstance(term, cls) for term in fitted.terms):
            return None
        # what a column does to the size in another shape than the one that was found is no regime
        known = [
            known_log_scale(fitted),
            what_columns_do(search, fitted),
            what_a_column_may_do(search, fitted)[0],
        ]
        p_value = probability_of_persistence(
            squared_innovations(fitted.innovations, coarse.valid),
            coarse.valid,
            np.concatenate(known, axis=1),
            search.rng(LoopSeed.REGIMES),
        )
        return Outcome(cls(fit_regimes(fitted.innovations, coarse.valid)), (), p_value)

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


def probability_of_persistence(
    squares: FloatArray, valid: BoolArray, known: FloatArray, rng: np.random.Generator
) -> float:
    """Probability that loudness which lasts for no longer than `CLUSTER_S` shows as much persistence.

    Parameters
    ----------
    squares : array, shape (n,)
        Of white rows, one per second, mean 0; 0 where invalid.
    valid : bool array, shape (n,)
    known : array, shape (n, k)
        What is known to go with the size; taken out of the squares.
    rng : Generator
    """
    if known.shape[1]:
        basis = np.linalg.qr((known - known[valid].mean(axis=0)) * valid[:, None])[0]
        squares = squares - basis @ (basis.T @ squares)
    inside, drawn = np.flatnonzero(valid), np.zeros(len(squares))
    observed, null, p_value = float(_scores(squares, valid).max()), np.zeros(0), 1.0
    for draws in DRAWS:
        own = np.zeros(draws)
        for draw in range(draws):
            drawn[inside] = in_another_order(np.roll(squares[inside], rng.integers(CLUSTER_S)), CLUSTER_S, rng)
            own[draw] = _scores(drawn, valid).max()
        null = np.concatenate([null, own])
        p_value = upper_tail(observed, null, tail_share=HEAVY_TAIL_SHARE, least_excess=0.0)
        if p_value > UNSURE:
            break
    return p_value


def _products(series: FloatArray, lags: NDArray[np.intp]) -> FloatArray:
    """Sums of products at lags."""
    size = len(series) + int(lags[-1])
    return np.asarray(np.fft.irfft(np.abs(np.fft.rfft(series, size)) ** 2, size)[lags])


def _scores(squares: FloatArray, valid: BoolArray) -> FloatArray:
    lags = np.arange(SHORTEST_S, int(3 * max(MEMORIES_S)) + 1)
    weights = np.exp(-lags[None, :] / np.asarray(MEMORIES_S)[:, None])
    return np.asarray(weights @ _products(squares, lags) / np.sqrt(valid.sum() * (weights**2).sum(axis=1)))
