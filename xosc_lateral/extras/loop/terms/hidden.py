"""What no column explains: loud and quiet stretches, as by distraction, and a cycle of the mean.

Regimes are a two-state Markov chain [1]_. Their null is a movement that is loud or quiet for no longer than
`CLUSTER_S`: its own squares, in blocks of that length, in random order [2]_. A cycle is a line of the spectrum [3]_.

References
----------
.. [1] J. D. Hamilton, "A new approach to the economic analysis of nonstationary time series and the business cycle",
       Econometrica 57, 1989.
.. [2] E. Carlstein, "The use of subseries values for estimating the variance of a general statistic from a stationary
       sequence", Annals of Statistics 14, 1986: blocks that do not overlap. Dealt without replacement: a permutation
       test, of blocks that are taken for exchangeable.
.. [3] E. J. Hannan, "The estimation of frequency", J. Applied Probability 10, 1973.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import ClassVar, Self

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray
from xosc_lateral.base.lazy import njit
from xosc_lateral.drivers.model.effects import Acts, Cycle, Effect, Regimes
from xosc_lateral.drivers.model.seeds import generator
from xosc_lateral.extras.loop.dictionary import Search, beside
from xosc_lateral.extras.loop.drives import counted
from xosc_lateral.extras.loop.model import Description, Fitted, Outcome, Stage, Term, proper
from xosc_lateral.extras.loop.residual import OSCILLATION
from xosc_lateral.extras.loop.significance import HEAVY_TAIL_SHARE, LoopSeed, in_another_order, upper_tail
from xosc_lateral.extras.loop.terms import spread
from xosc_lateral.extras.loop.terms.column import columns_on_size
from xosc_lateral.extras.loop.timeline import Coarse, on_fine_grid


@njit
def forward_backward(squares, valid, quiet, loud, go, leave):  # type: ignore[no-untyped-def]
    """Probability of the loud state per row, expected numbers of switches on and off, log-likelihood."""
    n = len(squares)
    forward, emit = np.empty((n, 2)), np.ones((n, 2))
    likelihood = 0.0
    a0, a1 = leave / (go + leave), go / (go + leave)
    for t in range(n):
        if valid[t]:
            emit[t, 0] = np.exp(-0.5 * squares[t] / quiet**2) / quiet + 1e-300
            emit[t, 1] = np.exp(-0.5 * squares[t] / loud**2) / loud + 1e-300
        p0 = (a0 * (1.0 - go) + a1 * leave) * emit[t, 0]
        p1 = (a0 * go + a1 * (1.0 - leave)) * emit[t, 1]
        total = p0 + p1
        likelihood += np.log(total)
        a0, a1 = p0 / total, p1 / total
        forward[t, 0], forward[t, 1] = a0, a1
    on = np.empty(n)
    on[n - 1] = forward[n - 1, 1]
    b0, b1, went, left = 1.0, 1.0, 0.0, 0.0
    for t in range(n - 2, -1, -1):
        e0, e1 = emit[t + 1, 0] * b0, emit[t + 1, 1] * b1
        j00, j01 = forward[t, 0] * (1.0 - go) * e0, forward[t, 0] * go * e1
        j10, j11 = forward[t, 1] * leave * e0, forward[t, 1] * (1.0 - leave) * e1
        total = j00 + j01 + j10 + j11
        went += j01 / total
        left += j10 / total
        on[t] = (j10 + j11) / total
        b0, b1 = (1.0 - go) * e0 + go * e1, leave * e0 + (1.0 - leave) * e1
        norm = b0 + b1
        b0, b1 = b0 / norm, b1 / norm
    return on, went, left, likelihood


ITERATIONS = 60  # Of expectation maximisation; converges well before.
# Factor between the regimes and mean length [s] that the fit starts from; the likelier end is kept.
FIT_STARTS = ((1.6, 15.0), (2.2, 40.0))


@dataclass(frozen=True, eq=False, slots=True)
class RegimeFit:
    """Two regimes of a movement."""

    factor: float  # Spread in the loud regime over the quiet one. [-]
    on_s: float  # Mean length of either. [s]
    off_s: float  # Mean length of either. [s]
    on: FloatArray  # shape (n,): Probability that the loud regime is on, given the whole drive.
    quiet: float  # Standard deviation of the innovations in the quiet regime. [-]
    log_likelihood: float


def fit_regimes(rows: FloatArray, valid: BoolArray) -> RegimeFit:
    """Fit to white rows [-], shape (n,), by expectation maximisation; cut-out seconds say nothing about the regime."""
    squares, fits = rows**2, []
    for factor, length in FIT_STARTS:
        quiet = float(np.sqrt(np.mean(squares[valid]) / (0.7 + 0.3 * factor**2)))
        loud, go, leave = quiet * factor, 1.0 / (2.0 * length), 1.0 / length
        for _ in range(ITERATIONS):
            on, went, left, likelihood = forward_backward(squares, valid, quiet, loud, go, leave)  # type: ignore[no-untyped-call]  # compiled: numba has no types
            weight_on, weight_off = on[valid], 1.0 - on[valid]
            loud = float(np.sqrt((weight_on @ squares[valid]) / max(weight_on.sum(), 1e-9)))
            quiet = float(np.sqrt((weight_off @ squares[valid]) / max(weight_off.sum(), 1e-9)))
            go = float(np.clip(went / max(float((1.0 - on).sum()), 1e-9), 1e-4, 0.5))
            leave = float(np.clip(left / max(float(on.sum()), 1e-9), 1e-4, 0.5))
            if quiet > loud:
                quiet, loud, go, leave = loud, quiet, leave, go
            quiet = max(quiet, 1e-3)
        fits.append(RegimeFit(loud / quiet, 1.0 / leave, 1.0 / go, on, quiet, likelihood))
    return max(fits, key=lambda fit: fit.log_likelihood)


MEMORIES_S = (6.0, 15.0, 40.0)  # Lengths of regimes that are tested. [s]
# Loudness that persists for up to this is how people steer, by a correction now and then and what it takes to settle,
# and no regime. [s]
CLUSTER_S = 15
SHORTEST_S = 12  # Lags are compared from here on. [s]
BLOCK_ORDERS = 2000  # Orders of the blocks that are the null.


@dataclass(frozen=True, eq=False)
class RegimesTerm(Term):
    """Two-state Markov chain in the log scale."""

    component: ClassVar[str] = "regimes"
    kind: ClassVar[str] = "regime"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.REGIMES,)
    weight: ClassVar[float] = 2.5
    seen_held_out: ClassVar[bool] = False
    fit: RegimeFit = field(repr=False)

    def known_scale(self, coarse: Coarse) -> FloatArray | None:
        """As far as the regimes are known, about its mean, shape (n,). [-]"""
        scale = self.fit.on * np.log(self.fit.factor)
        return np.asarray(scale - scale[coarse.valid].mean())

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """Weighted autocovariance of the squared innovations; null: blocks of the same squares in another order."""
        coarse = fitted.coarse
        if not coarse.lasts or any(isinstance(term, cls) for term in fitted.terms):
            return None
        # what a column does to the size in another shape than the one that was found is no regime
        columns = search.cross_basis(columns_on_size(fitted)), spread.what_a_column_may_do(search, fitted)[0]
        known = np.concatenate([spread.known_log_scale(fitted), *columns], axis=1)
        squares, rng = spread.quick_squares(fitted).standardised, generator(search.seed, LoopSeed.REGIMES)
        p_value = probability_of_persistence(squares, coarse.valid, known, rng)
        return Outcome(cls(fit_regimes(fitted.innovations, coarse.valid)), (), p_value)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Regimes are found in the innovations; what they do to the movement itself may be more."""
        on = self.fit.on[:, None]
        # the fit holds the regimes' scale already; squares of its innovations say what is left of them
        fine = float(spread.log_sizes(spread.fine_squares(fitted), on)[0][0])
        moved = float(spread.log_sizes(spread.slow_squares(fitted), on)[0][0])
        factor = self.fit.factor * max(1.0, float(np.exp(moved)))
        loud = float(np.sum(self.fit.on[fitted.coarse.valid]))
        error = factor / np.sqrt(2.0 * max(loud / spread.SLOW_S, 1.0))
        lengths = {"on_s": self.fit.on_s, "off_s": self.fit.off_s}
        return (Regimes(factor=factor, factor_error=error, fine_factor=float(np.exp(fine)), **lengths),)

    def removed(self, fitted: Fitted, effects: tuple[Effect, ...]) -> Sequence[tuple[Acts, FloatArray]]:
        """By the probability that the loud regime is on."""
        effect = proper(effects, Regimes)
        on = on_fine_grid(self.fit.on, fitted.coarse.timeline)
        return [(Acts.SPREAD, on * np.log(effect.factor)), (Acts.FINE, on * np.log(effect.fine_factor))]

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Factor and mean lengths."""
        effect = proper(effects, Regimes)
        longest = float(np.bincount(fitted.coarse.drive, fitted.coarse.valid.astype(np.float64)).max())
        on, off = (
            f"{lasts:.0f} s on average" if lasts < longest else "longer than a drive lasts"
            for lasts in (effect.on_s, effect.off_s)
        )
        shape = f"on for {on}, off for {off}"
        return Description(
            "on/off regimes", shape, effect.factor, effect.factor_error, statistic="quantiles of local spread"
        )


def probability_of_persistence(
    squares: FloatArray, valid: BoolArray, known: FloatArray, rng: np.random.Generator
) -> float:
    """Probability that loudness of `CLUSTER_S` at most, beside what is `known`, persists as much."""
    from scipy.fft import next_fast_len

    if known.shape[1]:
        squares = beside(np.linalg.qr((known - known[valid].mean(axis=0)) * valid[:, None])[0], squares)
    lags = np.arange(SHORTEST_S, int(3 * max(MEMORIES_S)) + 1)
    weights = np.exp(-lags / np.asarray(MEMORIES_S)[:, None])
    scales = np.sqrt(valid.sum() * (weights**2).sum(axis=1))
    size = next_fast_len(len(squares) + int(lags[-1]), real=True)

    def score(series: FloatArray) -> float:
        products = np.fft.irfft(np.abs(np.fft.rfft(series, size)) ** 2, size)[lags]
        return float((weights @ products / scales).max())

    inside, drawn, null = np.flatnonzero(valid), np.zeros(len(squares)), np.zeros(BLOCK_ORDERS)
    for draw in range(BLOCK_ORDERS):
        drawn[inside] = in_another_order(np.roll(squares[inside], rng.integers(CLUSTER_S)), CLUSTER_S, rng)
        null[draw] = score(drawn)
    return upper_tail(score(squares), null, tail_share=HEAVY_TAIL_SHARE, least_excess=0.0)


# ---- cycles ----
PERIODS_S = (4.0, 60.0)  # Periods that are tested. [s]
# Neighbouring frequencies taken together: a cycle keeps its phase for the whole drive, or for a part. [-]
WIDTHS = (1, 3, 7)
SURROUNDINGS_HZ = 0.035  # To each side: how high the spectrum is without a cycle. [Hz]
LINE_MARGIN = 5  # Frequencies to each side of a line that have some of it, where a window is not whole periods. [-]
LINE_DRAWS = 400  # White tables that the highest line is compared with.


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
        """Highest line of the innovations' spectra, summed over drives, over its surroundings; null: white rows."""
        coarse = fitted.coarse
        if any(isinstance(term, cls) for term in fitted.terms):
            return None
        lasting = coarse.valid & (counted(coarse) > 0.0)[coarse.drive]
        if not lasting.any():
            return None
        rng = generator(search.seed, LoopSeed.CYCLE)
        p_value, frequency, width = line(np.where(lasting, fitted.innovations, 0.0), lasting, coarse.drive, rng)
        return Outcome(cls(frequency, width), (), p_value)

    def matches(self, other: Self) -> bool:
        """About the same period."""
        return isinstance(other, CycleTerm) and bool(abs(np.log(self.frequency / other.frequency)) < 0.1)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Amplitude from the power of all its sines, noise taken out."""
        coarse, part = fitted.coarse, fitted.mean_part(self)
        sizes, errors = fitted.sizes[part], np.sqrt(np.maximum(np.diag(fitted.covariance)[part], 0.0))
        power = max(float(np.sum(sizes**2) - np.sum(errors**2)) / coarse.drives, 1e-8)
        seconds = float(coarse.valid.sum()) / coarse.drives
        coherence = 1e6 if self.width == 1 else float(seconds / (np.pi * self.width))
        amplitude, error = float(np.sqrt(power)), float(np.sqrt(np.mean(errors**2)))
        return (
            Cycle(
                amplitude=amplitude, amplitude_error=error, period_s=1.0 / self.frequency, coherence_s=float(coherence)
            ),
        )

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Amplitude and period."""
        effect = proper(effects, Cycle)
        shape = f"period {effect.period_s:.1f} s"
        return Description("weave", shape, effect.amplitude, effect.amplitude_error, OSCILLATION)


def line(rows: FloatArray, valid: BoolArray, drive: IndexArray, rng: np.random.Generator) -> tuple[float, float, int]:
    """p-value over all frequencies and widths, the best frequency [1/s], its width.

    White rows, shape (n,), 0 where invalid. Each drive has one spectrum, and all are summed: a cycle keeps its period
    from drive to drive, and its phase not.
    """
    edges = np.flatnonzero(np.diff(drive, prepend=-1, append=-1))
    spans = [slice(*pair) for pair in pairwise(edges) if valid[slice(*pair)].any()]
    size = 2 ** int(np.ceil(np.log2(max(span.stop - span.start for span in spans))))
    frequency = np.fft.rfftfreq(size)
    band = (frequency >= 1.0 / PERIODS_S[1]) & (frequency <= 1.0 / PERIODS_S[0])
    beyond = max(round(SURROUNDINGS_HZ * size), 2 * max(WIDTHS))

    def ratios(values: FloatArray) -> list[FloatArray]:
        """Line over surroundings in the band, shape (k, frequencies), of each width; `values` of shape (k, n)."""
        powers = [np.abs(np.fft.rfft(values[:, span], size)) ** 2 for span in spans]
        sizes = [np.maximum(np.square(values[:, span]).sum(axis=1), 1e-300)[:, None] for span in spans]
        sums = np.cumsum(np.pad(np.sum(np.divide(powers, sizes), axis=0), ((0, 0), (beyond + 1, beyond))), axis=1)

        def window_sum(half: int) -> FloatArray:
            middle = beyond + 1 + np.flatnonzero(band)
            return np.asarray(sums[:, middle + half] - sums[:, middle - half - 1])

        gaps = [min(width // 2 + LINE_MARGIN, beyond - 1) for width in WIDTHS]
        return [
            window_sum(width // 2)
            / np.maximum((window_sum(beyond) - window_sum(gap)) / (2 * (beyond - gap)) * width, 1e-300)
            for width, gap in zip(WIDTHS, gaps, strict=True)
        ]

    seen = ratios(rows[None])
    null = ratios(np.where(valid, rng.normal(size=(LINE_DRAWS, len(rows))), 0.0))
    tests = [
        upper_tail(float(one.max()), other.max(axis=1), least_excess=0.0) for one, other in zip(seen, null, strict=True)
    ]
    best = int(np.argmin(tests))
    at = float(frequency[band][np.argmax(seen[best][0])])
    return min(1.0, tests[best] * len(WIDTHS)), at, WIDTHS[best]
