"""Offsets of one driver on one drive: what chance and the effects make of the core model's movement, block by block.

This is the one place where offsets come from. A batch is one long block, a stream many short ones; the numbers are the
same however a drive is cut into blocks. A drive is sampled segment after segment under what is known about each.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from typing import Any, NamedTuple, Self

import msgspec
import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.segment import MINIMUM_SPEED, Segment, is_slow, ticks_of, within_heading
from xosc_lateral.drivers.model.core.base import CoreStream, Start
from xosc_lateral.drivers.model.effects import ColumnEffect, EffectTerms, HiddenEffect
from xosc_lateral.drivers.model.effects.base import step_of
from xosc_lateral.drivers.model.linear_filters import extrapolate, piece, prepare
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.records import read_as
from xosc_lateral.drivers.model.seeds import DriveSeed, child, generator

Responses = Sequence[FloatArray | None]

STEP_TOLERANCE = 0.1
"""A segment's step may differ from the model's by this share: the movement is then a little faster or slower. [-]"""

BLOCK = 12_288
"""Steps sampled at once: intermediate results stay in the cache. [-]"""


class OffsetSampler:
    """One driver on one drive, sampled segment after segment.

    The state goes on from segment to segment (through a lane change, say) and from call to call: a segment cut in two
    gives the same offsets as the whole, if both pieces carry the context around them (`Segment.before`, `after`). Same
    profile, seed and segments: same offsets, bit by bit.
    """

    def __init__(self, profile: DriverProfile, seed: int | np.random.SeedSequence) -> None:
        self.profile = profile
        sequence = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
        self._process = DriveProcess(profile, sequence)

    def sample(self, segment: Segment, *, start: float | None = None, responses: Responses | None = None) -> FloatArray:
        """Next offsets from the lane centre, positive to the LEFT of travel, one per row inside the segment. [m]

        Raises `ValueError` if the segment has another step or lies before the last one, or `start` [m] is given in the
        middle of a drive; without it a drive starts as chance has it. `responses`: what `responses_to` gave for this
        profile and segment, where that was asked before.
        """
        if len(segment) > 1:
            step, steps = self.profile.model.step, np.diff(segment.time)
            least, most = float(steps.min()), float(steps.max())
            if not (1.0 - STEP_TOLERANCE) * step <= least <= most <= (1.0 + STEP_TOLERANCE) * step:
                raise ValueError(f"segment with steps of {least:.4g} to {most:.4g} s, the model needs {step:g} s")
        width = segment.lane_width[segment.inside]
        n = len(width)
        if not n:
            return np.empty(0)
        terms = self._terms(segment, responses)
        if start is not None and self._process.has_begun:
            raise ValueError("a drive that continues from a state has no start")
        prepare(n)
        offset = np.empty(n)
        for first in range(0, n, BLOCK):
            rows = slice(first, min(first + BLOCK, n))
            offset[rows] = self._process.take(terms.rows(rows), width[rows], start if first == 0 else None)
        return offset

    def skip(self, seconds: float) -> None:
        """Drive on for so long, unseen [s]; not before the start, and not backwards."""
        rows = round(seconds / self.profile.model.step) if self._process.has_begun else 0
        for first in range(0, rows, BLOCK):
            self._process.take(EffectTerms(), np.ones(min(BLOCK, rows - first)))

    def copy(self) -> Self:
        """A sampler in the same state that goes on by itself."""
        return deepcopy(self)

    def _terms(self, segment: Segment, responses: Responses | None) -> EffectTerms:
        terms = [self._process.hidden_terms(segment.time[segment.inside])]
        if responses is None:
            responses = responses_to(segment, self.profile)
        terms += [
            effect.acting(response)
            for effect, response in zip(self._process.columned, responses, strict=True)
            if response is not None
        ]
        return combine(terms)


def responses_to(segment: Segment, profile: DriverProfile) -> Responses:
    """What every driver of a profile responds to in the same way on a segment; drivers differ in how strongly.

    Per effect of columns, in the profile's order, what `ColumnEffect.response` gives for the rows inside, shape (n, k);
    None where a column is not known.
    """
    columned = [effect for effect in profile.effects if isinstance(effect, ColumnEffect)]
    if not columned:
        return ()
    step, inside = step_of(segment.time), segment.inside
    context = {"lane_width": segment.lane_width, **segment.context}
    if np.isfinite(segment.speed).any():
        context.setdefault("speed", segment.speed)
    return tuple(
        effect.response(step, context)[inside] if all(column in context for column in effect.columns) else None
        for effect in columned
    )


def sample_offsets(
    profile: DriverProfile,
    segment: Segment,
    seed: int | np.random.SeedSequence,
    *,
    start: float | None = None,
    responses: Responses | None = None,
) -> FloatArray:
    """Offsets [m] of one drive of a single segment, shape (n,); see `OffsetSampler.sample`.

    On the driver's own clock where the segment's speed, if known, is below 40 km/h (`base.segment`).
    """
    sampler, inside = OffsetSampler(profile, seed), segment.inside
    time, speed = segment.time[inside], np.nan_to_num(segment.speed[inside], nan=MINIMUM_SPEED)
    if len(time) < 2 or not is_slow(speed).any():
        return sampler.sample(segment, start=start, responses=responses)
    step = float(time[1] - time[0])
    own_times, _, rows = ticks_of(time, speed, step)
    samples = sampler.sample(segment.at(np.append(rows, rows[-1])), start=start)
    samples = np.append(extrapolate(samples[1], samples[0]), samples)
    at = np.minimum(own_times / step, len(rows) - 1.0)
    first = np.minimum(at.astype(np.int64), len(rows) - 2)
    powers = (at - first)[:, None] ** np.arange(6)
    offset = (np.stack(piece(*(samples[first + k] for k in range(4))), axis=1) * powers).sum(axis=1)
    way = np.abs(speed)
    return within_heading(offset, np.append(0.0, np.cumsum(0.5 * (way[1:] + way[:-1]) * np.diff(time))))


# ---- the drive that is sampled from ----
class DriveState(msgspec.Struct, kw_only=True):
    """Where a drive is."""

    begun_at: float | None = None  # Time of row 0 in the drive's clock; None before it is known. [s]
    core: Any = None  # `CoreModel.State`; None before the first offset.
    hidden: list[Any]  # `HiddenEffect.State` of each.
    # `EffectTerms.parts` of all hidden effects at rows `first` to `drawn`, which may still be asked for.
    terms: list[FloatArray | None] = msgspec.field(default_factory=lambda: [None] * len(EffectTerms().parts))
    first: int = 0
    drawn: int = 0
    coarse: FloatArray  # Drawn ahead, as is `fine`, by a stream that 0.2 saved, shape (k,). [lane widths]
    fine: FloatArray


class Movement(NamedTuple):
    """What is random of offsets, before effects act: the mean that the coarse part moves about, both parts. [-]"""

    mean: FloatArray | float
    coarse: FloatArray
    fine: FloatArray


def offsets_of(profile: DriverProfile, movement: Movement, terms: EffectTerms, width: FloatArray) -> FloatArray:
    """Offsets, by the formula of `EffectTerms`; rows of one drive, or one row of many drives, shape (n,) each. [m]"""
    mean, coarse, fine = movement
    by_lane, by_hand = profile.scales(width)
    moved = coarse if terms.spread is None else mean + terms.spread * (coarse - mean)
    noise = fine if terms.fine is None else terms.fine * fine
    offset = (moved + noise) * by_lane if by_lane is by_hand else moved * by_lane + noise * by_hand
    return np.asarray(offset if terms.location is None else offset + terms.location)


class DriveProcess:
    """One drive: what is random of it, and what that makes of the effects."""

    def __init__(self, profile: DriverProfile, seed: np.random.SeedSequence) -> None:
        self._profile, self._model, self._seed = profile, profile.model, seed
        for effect in profile.effects:
            if not isinstance(effect, HiddenEffect | ColumnEffect):
                raise TypeError(f"effect {effect!r} is made neither from HiddenEffect nor from ColumnEffect")
        self.hidden = tuple(effect for effect in profile.effects if isinstance(effect, HiddenEffect))
        columned = [effect for effect in profile.effects if isinstance(effect, ColumnEffect)]
        self.columned = tuple(
            effect.of_one_driver(generator(seed, DriveSeed.SLOPES, index)) if any(effect.between_drivers) else effect
            for index, effect in enumerate(columned)
        )
        """The effects of columns, with this driver's own coefficients; their terms are given from outside."""
        self.state = DriveState(
            hidden=[
                effect.begin(generator(seed, DriveSeed.HIDDEN, index), profile.model.step)
                for index, effect in enumerate(self.hidden)
            ],
            coarse=np.empty(0),
            fine=np.empty(0),
        )
        self._core: CoreStream | None = None

    @property
    def has_begun(self) -> bool:
        """Whether offsets were taken."""
        return self._core is not None

    def begin_at(self, time: float) -> None:
        """Time of row 0 in the drive's clock; once. [s]"""
        if self.state.begun_at is None:
            self.state.begun_at = time

    def hidden_terms(self, time: FloatArray) -> EffectTerms:
        """What the hidden effects do together at times of the drive, which begins at the first one ever asked for.

        `time` [s] of shape (n,), n >= 1, at about the model's step, none earlier than the last of an earlier call.
        """
        if not self.hidden:
            return EffectTerms()
        self.begin_at(float(time[0]))
        rows = np.round((time - (self.state.begun_at or 0.0)) / self._model.step).astype(np.int64)
        return self.hidden_terms_at(rows)

    def hidden_terms_at(self, rows: IntArray) -> EffectTerms:
        """The same at rows, counted in model steps from the drive's start; shape (n,), n >= 1."""
        if not self.hidden:
            return EffectTerms()
        state, low, high = self.state, int(rows[0]), int(rows[-1]) + 1
        if low < state.first:
            raise ValueError(f"row {low} of a drive that has gone on to row {state.first}")
        if high > state.drawn:
            self._draw_hidden(high)
        terms = EffectTerms(*state.terms)
        if high - low == len(rows):
            taken = terms.rows(slice(low - state.first, high - state.first))
        else:  # a segment whose step is a little off the model's
            taken = terms.rows(rows - state.first)
        if (done := high - 1 - state.first) > 0:  # the last row stays: the next segment may begin with it
            state.terms = [None if values is None else values[done:] for values in state.terms]
            state.first += done
        return taken

    def _draw_hidden(self, until: int) -> None:
        state, step = self.state, self._model.step
        assert state.begun_at is not None
        time = state.begun_at + step * np.arange(state.drawn, until, dtype=np.float64)
        new = combine([effect.advance(own, time, step) for effect, own in zip(self.hidden, state.hidden, strict=True)])
        state.terms = [
            more if kept is None or more is None else np.concatenate([kept, more])
            for kept, more in zip(state.terms, new.parts, strict=True)
        ]
        state.drawn = until

    def take(self, terms: EffectTerms, width: FloatArray, start: float | None = None) -> FloatArray:
        """Next offsets, shape (n,), by what all effects do together there and the lane's width, shape (n,). [m]

        Raises `ValueError` if the first offset `start` [m] is given in the middle of a drive.
        """
        if self._core is None:
            self._begin(_start(self._profile, start, width, terms))
        elif start is not None:
            raise ValueError("a drive that continues from a state has no start")
        return offsets_of(self._profile, self.movement(len(width), terms.rate), terms, width)

    def movement(self, n: int, rate: FloatArray | None = None) -> Movement:
        """Next movement, before effects act: what `take` makes offsets of; `rate` [-] of shape (n,).

        A drive that has not begun begins as chance has it.
        """
        core, state = self._core or self._begin(None), self.state
        if not len(state.coarse):
            return Movement(core.mean, *core.take(n, rate))
        drawn = [state.coarse[:n], state.fine[:n]]
        state.coarse, state.fine = state.coarse[n:], state.fine[n:]
        if len(drawn[0]) < n:
            more = core.take(n - len(drawn[0]), rate)
            drawn = [np.concatenate(parts) for parts in zip(drawn, more, strict=True)]
        return Movement(core.mean, *drawn)

    def _begin(self, start: Start | None) -> CoreStream:
        self._core = self._model.stream(child(self._seed, DriveSeed.CORE), start)
        self.state.core = self._core.state
        return self._core

    def restore(self, values: Any, where: str) -> None:
        """Go on from a state as plain JSON values.

        Raises `DriverProfileError` if it is none, or of a profile with other effects.
        """
        state = read_as(DriveState, values, where)
        state.hidden = [
            read_as(effect.State, own, f"{where}.hidden[{index}]")
            for index, (effect, own) in enumerate(zip(self.hidden, state.hidden, strict=True))
        ]
        if state.core is not None:
            self._core = self._model.resume(read_as(self._model.State, state.core, f"{where}.core"))
            state.core = self._core.state
        self.state = state


def combine(terms: Sequence[EffectTerms]) -> EffectTerms:
    """What several effects do together: locations add up, factors multiply."""
    location = spread = rate = fine = None
    for term in terms:
        if term.location is not None:
            location = term.location if location is None else location + term.location
        if term.spread is not None:
            spread = term.spread if spread is None else spread * term.spread
        if term.rate is not None:
            rate = term.rate if rate is None else rate * term.rate
        if term.fine is not None:
            fine = term.fine if fine is None else fine * term.fine
    return EffectTerms(location, spread, rate, fine)


def _start(profile: DriverProfile, offset: float | None, width: FloatArray, terms: EffectTerms) -> Start | None:
    if offset is None:
        return None
    location = 0.0 if terms.location is None else float(terms.location[0])
    by_lane, by_hand = (float(scale[0]) for scale in profile.scales(width[:1]))
    return Start(
        rel_offset=(offset - location) / by_lane,
        spread=1.0 if terms.spread is None else float(terms.spread[0]),
        fine=(1.0 if terms.fine is None else float(terms.fine[0])) * by_hand / by_lane,
    )
