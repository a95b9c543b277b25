"""The paper's model to the letter: smoothed Markov chain + shaped uniform noise, x = kappa + phi.

Sampled in pieces of any length, of one driver or of several at once.

References
----------
.. [1] N. Neis, J. Beyerer, "A two-level stochastic model for the lateral movement of vehicles within their lane", IEEE
       ITSC 2023, pp. 1896-1903, arXiv:2405.17080, section III.
.. [2] A. J. Walker, "An efficient method for generating discrete random variables with general distributions", ACM
       Trans. Mathematical Software 3, 1977.
.. [3] M. D. Vose, "A linear algorithm for generating random numbers with a given distribution", IEEE Trans. Software
       Engineering 17, 1991.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from math import fsum
from typing import Annotated, ClassVar

import msgspec
import numpy as np
from msgspec import Meta

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.drives.drive import STEP
from xosc_lateral.drivers.model.core.base import (
    KERNEL_TAPS,
    N_KNOTS,
    ClockState,
    CoreModel,
    ShapedNoise,
    Start,
    take_at_rate,
)
from xosc_lateral.drivers.model.linear_filters import JitKernel, convolve
from xosc_lateral.drivers.model.records import Record, frozen_array, set_once
from xosc_lateral.drivers.model.seeds import TwoLevelSeed, generator


# ---- coarse movement: a first-order Markov chain over bins of the relative offset, ready for sampling ----
def open_traps(counts: IntArray) -> IntArray:
    """Counts with a way out of every bin that has none, towards the nearest of the others. Shape as `counts`. [-]"""
    bins = np.arange(len(counts))
    visited = (counts.sum(axis=0) + counts.sum(axis=1)) > 0
    main = _main_part(counts)
    stuck = np.flatnonzero(visited & ~_reachable(counts.T, main))
    opened = counts.copy()
    opened[stuck, _nearest(bins[stuck], bins[main])] += 1
    empty = np.flatnonzero(~visited)
    opened[empty, empty + np.sign(_nearest(empty, bins[visited]) - empty)] += 1
    return opened


def _nearest(bins: IntArray, goals: IntArray) -> IntArray:
    return np.asarray(goals[np.abs(bins[:, None] - goals[None, :]).argmin(axis=1)])


def _reachable(counts: IntArray, start: BoolArray) -> BoolArray:
    """Bins that the chain can get to from `start` (itself included)."""
    bins = start.copy()
    while True:
        more = bins | (counts[bins] > 0).any(axis=0)
        if (more == bins).all():
            return bins
        bins = more


def _main_part(counts: IntArray) -> BoolArray:
    """The set of bins that all lead to one another in which most time was spent."""
    best, most = np.zeros(len(counts), dtype=np.bool_), -1
    left = counts.sum(axis=0) + counts.sum(axis=1) > 0
    while left.any():
        seed = np.zeros(len(counts), dtype=np.bool_)
        seed[np.argmax(left)] = True
        part = _reachable(counts, seed) & _reachable(counts.T, seed)
        inside = int(counts[np.ix_(part, part)].sum())
        if inside > most:
            best, most = part, inside
        left &= ~part
    return best


N_BINS = 20
"""Bins of the relative offset over [-0.5, 0.5]. [-]"""


@dataclass(frozen=True, eq=False)  # no slots: what follows from the counts is worked out once
class MarkovChain:
    """Coarse lateral position as a chain over bins of the relative offset.

    By observed transitions, shape (n_bins, n_bins): row i, column j: from bin i to bin j in one step. Raises
    `DriverProfileError` if it isn't square, a count is negative, or there is no transition at all.
    """

    counts: IntArray

    def __post_init__(self) -> None:
        counts = np.array(self.counts, dtype=np.int64)
        if counts.ndim != 2 or counts.shape[0] != counts.shape[1] or len(counts) < 2:
            raise DriverProfileError(f"Markov chain: counts of shape {counts.shape}, expected (n, n) with n >= 2")
        if counts.min() < 0 or counts.sum() == 0:
            raise DriverProfileError(f"Markov chain: smallest count {counts.min()}, sum {counts.sum()}: need 0 and > 0")
        counts.flags.writeable = False
        object.__setattr__(self, "counts", counts)

    @property
    def n_bins(self) -> int:
        """Count of bins."""
        return len(self.counts)

    @property
    def centres(self) -> FloatArray:
        """Bin centres, shape (n_bins,). [-]"""
        return (np.arange(self.n_bins) + 0.5) / self.n_bins - 0.5

    @cached_property
    def transition(self) -> FloatArray:
        """Probabilities of the next bin, shape (n_bins, n_bins), rows summing to 1, traps opened. [-]"""
        counts = open_traps(self.counts).astype(np.float64)
        return np.asarray(counts / counts.sum(axis=1, keepdims=True))

    @property
    def support(self) -> BoolArray:
        """Bins that were visited, shape (n_bins,). [-]"""
        return np.asarray((self.counts.sum(axis=0) + self.counts.sum(axis=1)) > 0)

    @cached_property
    def stationary(self) -> FloatArray:
        """Share of time in each bin in the long run, shape (n_bins,). [-]"""
        transition = self.transition
        system = np.vstack([transition.T - np.eye(self.n_bins), np.ones(self.n_bins)])
        share = np.linalg.lstsq(system, np.append(np.zeros(self.n_bins), 1.0), rcond=None)[0]
        share = np.where(self.support, np.maximum(np.round(share, 12), 0.0), 0.0)  # the same on every processor
        return np.asarray(share / share.sum())

    @cached_property
    def alias_table(self) -> AliasTable:
        """The chain made ready for sampling."""
        return AliasTable.of(self.transition)

    @property
    def mean(self) -> float:
        """Mean of the coarse part in the long run. [-]"""
        return fsum(self.stationary * self.centres)


def bin_of(rel_offset: FloatArray, n_bins: int = N_BINS) -> IntArray:
    """Bin, 0 to n_bins - 1, of each relative offset [-], any shape; beyond the markings the outermost."""
    return np.clip(np.floor((rel_offset + 0.5) * n_bins), 0, n_bins - 1).astype(np.int64)


@dataclass(frozen=True, eq=False, slots=True)
class AliasTable:
    """A chain made ready for sampling: one uniform number and two look-ups per step [2]_."""

    n_bins: int
    # Shape (n_bins * n_bins,). Column k of row i stands for bin k below this fraction of its width ...
    keep: FloatArray
    other: IntArray  # Shape (n_bins * n_bins,). ... and for this bin above it.

    @classmethod
    def of(cls, transition: FloatArray) -> AliasTable:
        """Build from rows of probabilities [-], shape (n_bins, n_bins), each summing to 1."""
        keep, other = zip(*map(_alias_row, transition), strict=True)
        return cls(len(transition), np.concatenate(keep), np.concatenate(other))


def _alias_row(probabilities: FloatArray) -> tuple[FloatArray, IntArray]:
    """What each bin lacks of 1 filled from one that has more: Vose's algorithm [3]_."""
    n = len(probabilities)
    keep, other = (probabilities * n).tolist(), list(range(n))
    small = [k for k in range(n) if keep[k] < 1.0]
    large = [k for k in range(n) if keep[k] >= 1.0]
    while small and large:
        less, more = small.pop(), large[-1]
        other[less] = more
        keep[more] -= 1.0 - keep[less]
        if keep[more] < 1.0:
            small.append(large.pop())
    for k in small + large:  # what is left differs from 1 by rounding
        keep[k] = 1.0
    # A bin of probability 0 that rounding left alone must not be drawn.
    likely = int(np.argmax(probabilities))
    for k in range(n):
        if probabilities[k] == 0.0:
            other[k] = likely if other[k] == k else other[k]
            keep[k] = 0.0
    return np.array(keep), np.array(other, dtype=np.int64)


# ---- the model ----
class TwoLevelSettings(Record, frozen=True):
    """Constants of the model, each above 0; the defaults are the paper's."""

    n_bins: Annotated[int, Meta(description="Bins of the relative offset over [-0.5, 0.5].")] = N_BINS
    smoothing_sigma: Annotated[float, Meta(description="Of the Gaussian that smooths the chain. [s]")] = 0.6
    smoothing_support: Annotated[float, Meta(description="Distance at which it is cut off. [s]")] = 1.0
    fine_cap: Annotated[float, Meta(description="Of the measured fine part, to both sides. [lane widths]")] = 0.03
    # The paper shows a figure, no count, and for the kernel no length: one snippet.
    n_knots: Annotated[int, Meta(description="Of the piecewise linear damping function.")] = N_KNOTS
    n_taps: Annotated[int, Meta(description="Length of the kernel of the fine noise, odd.")] = KERNEL_TAPS
    # A drive that has to start at a given offset meets it exactly; the paper's starts in the right bin.
    start_fade: Annotated[float, Meta(description="Time in which what a start lacked fades out. [s]")] = 1.0
    step: Annotated[float, Meta(description="[s]")] = STEP

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            if not 0 < getattr(self, name) < np.inf:
                raise DriverProfileError(f"{name} {getattr(self, name)}, expected above 0")

    @property
    def smoothing_kernel(self) -> FloatArray:
        """Gaussian weights that sum to 1, shape (2 * support / step + 1,). [-]"""
        half = round(self.smoothing_support / self.step)
        weights = np.exp(-0.5 * (np.arange(-half, half + 1) * self.step / self.smoothing_sigma) ** 2)
        return np.asarray(weights / weights.sum())

    @property
    def fade_out(self) -> FloatArray:
        """Share of what a start lacked that is still added, step by step, shape (start_fade / step,). [-]"""
        n = max(1, round(self.start_fade / self.step))
        return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.arange(n) / n))


PAPER_SETTINGS = TwoLevelSettings()


class TwoLevelState(msgspec.Struct):
    """Where drives are. The generators, of the coarse and of the fine part, draw one number per step and driver."""

    chain: np.random.Generator
    noise: np.random.Generator
    bins: IntArray  # Last bin, shape (drivers,).
    levels: FloatArray  # Last levels of the chain, before smoothing, shape (smoothing taps - 1, drivers). [-]
    white: FloatArray  # Last values of the fine part's noise, before shaping, shape (kernel taps - 1, drivers). [-]
    fade: FloatArray  # What is still added to meet a start, step by step, shape (k, drivers). [-]
    clock: ClockState  # Of the coarse part.
    single: bool = True  # One driver, arrays without an axis of drivers.


class TwoLevelModel(CoreModel, frozen=True, eq=False, dict=True):
    """Fitted two-level model, x = kappa + phi.

    `counts`: transitions of kappa before smoothing, from the row's bin to the column's in one step; `damping` of phi's
    noise, at frequencies evenly spaced from 0 to half the sampling rate [lane widths]. Raises `DriverProfileError` if
    counts and settings disagree, or counts or damping are none.
    """

    State: ClassVar[type] = TwoLevelState

    settings: TwoLevelSettings
    counts: IntArray
    damping: FloatArray

    def __post_init__(self) -> None:
        set_once(self, counts=frozen_array(self.counts, np.int64), damping=frozen_array(self.damping))
        if self.chain.n_bins != self.settings.n_bins:
            raise DriverProfileError(f"counts of {self.chain.n_bins} bins, settings of {self.settings.n_bins}")
        assert self.noise

    @cached_property
    def chain(self) -> MarkovChain:
        """Coarse part, before smoothing."""
        return MarkovChain(self.counts)

    @cached_property
    def noise(self) -> ShapedNoise:
        """Fine part."""
        return ShapedNoise(self.damping, self.settings.n_taps)

    @property
    def step(self) -> float:
        """[s]"""
        return self.settings.step

    @property
    def mean(self) -> float:
        """Mean of the coarse part in the long run. [-]"""
        return self.chain.mean

    def stream(
        self, seed: np.random.SeedSequence, start: Start | None = None, *, drivers: int | None = None
    ) -> TwoLevelStream:
        """Begin a drive; without `start` in a bin drawn from the stationary distribution. See `CoreModel.stream`."""
        m = drivers or 1
        noise = generator(seed, TwoLevelSeed.NOISE)
        bins = _first_bins(self, seed, start, m)
        half = len(self.settings.smoothing_kernel) // 2
        state = TwoLevelState(
            chain=generator(seed, TwoLevelSeed.CHAIN),
            noise=noise,
            bins=bins,
            # Before its start the chain is taken to have stayed where it starts.
            levels=np.tile(self.chain.centres[bins], (half + 1, 1)),
            white=noise.random((len(self.noise.kernel) - 1, m)) - 0.5,
            fade=np.empty((0, m)),
            clock=ClockState(),
            single=drivers is None,
        )
        stream = TwoLevelStream(self, state)
        state.levels = np.concatenate([state.levels, stream.walk(half - 1)])
        if start is not None:
            coarse, fine = deepcopy(stream).take(1)
            unscaled = (start.rel_offset - stream.mean - start.fine * fine[0]) / start.spread
            state.fade = self.settings.fade_out[:, None] * np.atleast_1d(stream.mean + unscaled - coarse[0])
        return stream

    def resume(self, state: TwoLevelState) -> TwoLevelStream:
        """Go on from a state."""
        return TwoLevelStream(self, state)


class TwoLevelStream:
    """See `CoreStream`."""

    def __init__(self, model: TwoLevelModel, state: TwoLevelState) -> None:
        self.mean = model.mean
        self.state = state
        self._table, self._centres = model.chain.alias_table, model.chain.centres
        self._smoothing, self._kernel = model.settings.smoothing_kernel, model.noise.kernel

    def take(self, n: int, rate: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Next n values of the coarse and of the fine part, shape (n,) or (n, drivers) [-]; see `CoreStream`."""
        state = self.state
        coarse = take_at_rate(state.clock, self.smoothed, n, rate)
        fading = min(n, len(state.fade))
        if fading:
            coarse[:fading] += state.fade[:fading]
            state.fade = state.fade[fading:]
        white = np.concatenate([state.white, state.noise.random((n, len(state.bins))) - 0.5])
        state.white = white[n:]
        fine = convolve(white, self._kernel)
        return (coarse[:, 0], fine[:, 0]) if state.single else (coarse, fine)

    def walk(self, n: int) -> FloatArray:
        """Next n levels of the chain, shape (n, drivers). [-]"""
        state = self.state
        bins = walk(self._table, state.bins, state.chain.random((n, len(state.bins))))
        if n:
            state.bins = bins[-1]
        return np.asarray(self._centres[bins])

    def smoothed(self, n: int) -> FloatArray:
        """Next n values of the smoothed chain, shape (n, drivers). [-]"""
        levels = np.concatenate([self.state.levels, self.walk(n)])
        self.state.levels = levels[n:]
        return convolve(levels, self._smoothing)


def _first_bins(model: TwoLevelModel, seed: np.random.SeedSequence, start: Start | None, m: int) -> IntArray:
    """Bin of each driver's first level, shape (m,)."""
    if start is None:
        return generator(seed, TwoLevelSeed.FIRST_BIN).choice(model.chain.n_bins, size=m, p=model.chain.stationary)
    within = model.mean + (np.asarray(start.rel_offset) - model.mean) / start.spread
    return np.broadcast_to(bin_of(within, model.chain.n_bins), m).copy()


def _walk_body(uniform, drivers, n_bins, keep, other, states):  # type: ignore[no-untyped-def]
    # states: each driver's last state first, then one per driver and step; all arrays flat, step by step
    if drivers == 1:  # the same, faster: the last state stays in a register
        state = states[0]
        for i in range(len(uniform)):
            scaled = uniform[i] * n_bins
            column = int(scaled)
            k = state * n_bins + column
            state = column if scaled - column < keep[k] else other[k]
            states[i + 1] = state
        return
    for i in range(len(uniform)):
        scaled = uniform[i] * n_bins
        column = int(scaled)
        k = states[i] * n_bins + column
        states[i + drivers] = column if scaled - column < keep[k] else other[k]


_walk = JitKernel(_walk_body)


def walk(table: AliasTable, states: IntArray, uniform: FloatArray) -> IntArray:
    """States after each step of chains that run side by side, shape (n, drivers).

    From `states`, shape (drivers,), with one number of `uniform`, shape (n, drivers), in [0, 1), per step and chain.
    """
    m = len(states)
    flat = np.empty(m + uniform.size, dtype=np.int64)
    flat[:m] = states
    _walk(uniform.size, (uniform.ravel(), m, table.n_bins, table.keep, table.other), (flat,))
    return flat[m:].reshape(-1, m)
