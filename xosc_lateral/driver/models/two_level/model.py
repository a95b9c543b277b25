"""The paper's model to the letter: smoothed Markov chain + shaped uniform noise, x = kappa + phi.

Sampled in pieces of any length, of one driver or of several at once.

References
----------
.. [1] N. Neis, J. Beyerer, "Modelling of lateral movement within the lane", arXiv:2405.17080, 2024, section III.
"""

from __future__ import annotations

from copy import deepcopy
from typing import ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.jit_kernel import JitKernel
from xosc_lateral.driver.linear_filters import convolve
from xosc_lateral.driver.models.base import Start
from xosc_lateral.driver.models.mean_reversion import ClockState, take_at_rate
from xosc_lateral.driver.models.two_level.markov import AliasTable, bin_of
from xosc_lateral.driver.models.two_level.settings import TwoLevelParameters, TwoLevelSettings
from xosc_lateral.driver.seeds import TwoLevelSeed, generator

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


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
    """States after each step of chains that run side by side.

    Parameters
    ----------
    table : AliasTable
    states : array of int, shape (drivers,)
        Where they are.
    uniform : array, shape (n, drivers)
        One number in [0, 1) per step and chain. [-]

    Returns
    -------
    array of int, shape (n, drivers)
    """
    m = len(states)
    flat = np.empty(m + uniform.size, dtype=np.int64)
    flat[:m] = states
    _walk(uniform.size, (uniform.ravel(), m, table.n_bins, table.keep, table.other), (flat,))
    return flat[m:].reshape(-1, m)


class TwoLevelState(msgspec.Struct):
    """Where drives are.

    Parameters
    ----------
    chain, noise : numpy.random.Generator
        Of the coarse and of the fine part; each draws one number per step and driver.
    bins : array of int, shape (drivers,)
        Last bin.
    levels : array, shape (smoothing taps - 1, drivers)
        Last levels of the chain, before smoothing. [-]
    white : array, shape (kernel taps - 1, drivers)
        Last values of the fine part's noise, before shaping. [-]
    fade : array, shape (k, drivers)
        What is still added to meet a start, step by step. [-]
    clock : ClockState
        Of the coarse part.
    single : bool
        One driver, arrays without an axis of drivers.
    """

    chain: np.random.Generator
    noise: np.random.Generator
    bins: IntArray
    levels: FloatArray
    white: FloatArray
    fade: FloatArray
    clock: ClockState
    single: bool = True


class TwoLevelStream:
    """See `CoreStream`."""

    def __init__(self, model: TwoLevelParameters, state: TwoLevelState) -> None:
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
        fine = self._shaped(n)
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

    def _shaped(self, n: int) -> FloatArray:
        state = self.state
        white = np.concatenate([state.white, state.noise.random((n, len(state.bins))) - 0.5])
        state.white = white[n:]
        return convolve(white, self._kernel)


def begin(
    model: TwoLevelParameters, seed: np.random.SeedSequence, start: Start | None, drivers: int | None
) -> TwoLevelStream:
    """Begin drives; see `CoreModel.stream`."""
    m = drivers or 1
    noise = generator(seed, TwoLevelSeed.NOISE)
    bins = _first_bins(model, seed, start, m)
    half = len(model.settings.smoothing_kernel) // 2
    state = TwoLevelState(
        chain=generator(seed, TwoLevelSeed.CHAIN),
        noise=noise,
        bins=bins,
        # Before its start the chain is taken to have stayed where it starts.
        levels=np.tile(model.chain.centres[bins], (half + 1, 1)),
        white=noise.random((len(model.noise.kernel) - 1, m)) - 0.5,
        fade=np.empty((0, m)),
        clock=ClockState(),
        single=drivers is None,
    )
    stream = TwoLevelStream(model, state)
    state.levels = np.concatenate([state.levels, stream.walk(half - 1)])
    if start is not None:
        state.fade = _fade_out(model.settings)[:, None] * _lack(stream, start)
    return stream


def _first_bins(model: TwoLevelParameters, seed: np.random.SeedSequence, start: Start | None, m: int) -> IntArray:
    """Bin of each driver's first level, shape (m,)."""
    if start is None:
        return generator(seed, TwoLevelSeed.FIRST_BIN).choice(model.chain.n_bins, size=m, p=model.chain.stationary)
    within = model.mean + (np.asarray(start.rel_offset) - model.mean) / start.spread
    return np.broadcast_to(bin_of(within, model.chain.n_bins), m).copy()


def _lack(stream: TwoLevelStream, start: Start) -> FloatArray:
    """What the coarse part lacks at the first step to start as asked for, shape (drivers,) or (1,). [-]"""
    coarse, fine = deepcopy(stream).take(1)
    unscaled = (start.rel_offset - stream.mean - start.fine * fine[0]) / start.spread
    return np.atleast_1d(stream.mean + unscaled - coarse[0])


def _fade_out(settings: TwoLevelSettings) -> FloatArray:
    n = max(1, round(settings.start_fade / settings.step))
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.arange(n) / n))


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
