"""Measured movement with the effects taken out: what the base model is fitted on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Acts, ColumnEffect, GrowingSpread, Regimes
from xosc_lateral.driver.series import MIN_RUN, STEP, Run
from xosc_lateral.loop.movement import Coarse, Fitted, fit_movement
from xosc_lateral.loop.regimes import fit_regimes
from xosc_lateral.loop.sizing import Sized
from xosc_lateral.loop.timeline import COARSE, Timeline

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

FINE_S = 1.0
"""Movement within this time counts as fine when a spread is taken out. [s]"""


@dataclass(frozen=True, eq=False, slots=True)
class Share:
    """What the effects did to the measured offsets, on the 0.2 s grid, shape (n,) each.

    Parameters
    ----------
    location : array
        [m]
    spread, fine, rate : array
        Factors. [-]
    """

    location: FloatArray
    spread: FloatArray
    fine: FloatArray
    rate: FloatArray


def effects_share(coarse: Coarse, fitted: Fitted, sized: Sized) -> Share:
    """Evaluate all effects; hidden ones as they most likely were on this drive."""
    timeline = coarse.timeline
    n = len(timeline)
    location = _on_grid(_hidden_location(coarse, fitted), n)
    logs = {Acts.SPREAD: np.zeros(n), Acts.FINE: np.zeros(n), Acts.RATE: np.zeros(n)}
    for effect in sized.effects:
        if isinstance(effect, ColumnEffect):
            strength = effect.strength(timeline.step, coarse.context)
            if strength is None:
                continue
            if effect.acts is Acts.LOCATION:
                location = location + strength
            else:
                logs[effect.acts] = logs[effect.acts] + strength
        elif isinstance(effect, GrowingSpread):
            terms = effect.terms(timeline.time, {}, np.random.default_rng(0))
            logs[Acts.SPREAD] += np.log(terms.spread) if terms.spread is not None else 0.0
            logs[Acts.FINE] += np.log(terms.fine) if terms.fine is not None else 0.0
        elif isinstance(effect, Regimes):
            on = _on_grid(_regime_share(coarse, fitted), n)
            logs[Acts.SPREAD] += on * np.log(effect.factor)
            logs[Acts.FINE] += on * np.log(effect.fine_factor)
    return Share(location, np.exp(logs[Acts.SPREAD]), np.exp(logs[Acts.FINE]), np.exp(logs[Acts.RATE]))


def stripped_runs(timeline: Timeline, share: Share, used: BoolArray) -> list[Run]:
    """Runs of the movement without effects, from the valid rows in `used`."""
    runs: list[Run] = []
    for index, name in enumerate(timeline.names):
        for rows in uninterrupted(timeline.valid & used & (timeline.drive == index)):
            if (rows.stop - rows.start) * STEP < MIN_RUN:
                continue
            runs.append(_run(timeline, share, rows, name, len(runs)))
    return runs


def bare_movement(timeline: Timeline, share: Share, rows: slice, mean: float | None = None) -> FloatArray:
    """Offsets of one uninterrupted stretch without the effects, about their own mean or the given one [m]."""
    left = timeline.offset[rows] - share.location[rows]
    mean = float(left.mean()) if mean is None else mean
    slow = _smooth(left)
    return np.asarray(mean + (slow - mean) / share.spread[rows] + (left - slow) / share.fine[rows])


def _run(timeline: Timeline, share: Share, rows: slice, name: str, index: int) -> Run:
    movement = bare_movement(timeline, share, rows)
    width = timeline.lane_width[rows]
    rate = share.rate[rows]
    if np.any(rate != 1.0):
        # the base's own clock runs at the effect's pace: read the movement at even ticks of that clock
        ticks = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))])
        even = np.arange(int(ticks[-1]) + 1, dtype=np.float64)
        movement, width = np.interp(even, ticks, movement), np.interp(even, ticks, width)
    time = timeline.time[rows.start] + STEP * np.arange(len(movement))
    return Run(name, index, time, movement, width, {}, frozenset())


def _smooth(values: FloatArray) -> FloatArray:
    width = 2 * round(0.5 * FINE_S / STEP) + 1
    half = width // 2
    padded = np.concatenate([2 * values[0] - values[half:0:-1], values, 2 * values[-1] - values[-2 : -half - 2 : -1]])
    return np.convolve(padded, np.ones(width) / width, mode="valid")


def _hidden_location(coarse: Coarse, fitted: Fitted) -> FloatArray:
    """Weave, step and drift as fitted, at 1 Hz; the step about its mean, as the effect has it."""
    columns = sum(coarse.answer(effect).shape[1] for effect in fitted.terms.location)
    hidden = fitted.location_columns[:, columns:] @ fitted.location_sizes[columns:]
    return hidden - (hidden[coarse.valid].mean() if hidden.any() else 0.0)


def _regime_share(coarse: Coarse, fitted: Fitted) -> FloatArray:
    bare = fit_movement(coarse, replace(fitted.terms, regime_scale=None))
    return fit_regimes(bare.rows, coarse.valid).on


def _on_grid(values: FloatArray, n: int) -> FloatArray:
    return np.interp(np.arange(n), np.arange(len(values)) * COARSE + 0.5 * (COARSE - 1), values)


def uninterrupted(mask: BoolArray) -> list[slice]:
    """Stretches of rows in a row, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [slice(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]
