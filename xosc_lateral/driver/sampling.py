"""Offsets for segments: the core model's movement, what the effects make of it, scaled to the lane."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.compiled import prepare
from xosc_lateral.driver.core import CoreStream, Start
from xosc_lateral.driver.effects import Effect, EffectTerms
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.seeds import child
from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]

STEP_TOLERANCE = 0.1
"""A segment's step may differ from the model's by this share: the movement is then a little faster or slower. [-]"""

BLOCK = 12_288
"""Steps sampled at once: intermediate results stay in the cache. [-]"""

HORIZON = 512
"""Steps that hidden effects are first drawn for at least; doubled when a drive lasts longer. [-]"""


class OffsetSampler:
    """One driver on one drive, sampled segment after segment.

    The state goes on from segment to segment (through a lane change, say) and from call to call: a segment cut in two
    gives the same offsets as the whole, if both pieces carry the context around them (`Segment.before`, `after`).

    Parameters
    ----------
    profile : DriverProfile
    seed : int or numpy.random.SeedSequence
        Same profile, seed and segments: same offsets, bit by bit.
    """

    def __init__(self, profile: DriverProfile, seed: int | np.random.SeedSequence) -> None:
        self.profile = profile
        self._seed = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
        self._stream: CoreStream | None = None
        self._hidden = _HiddenTerms(tuple(effect for effect in profile.effects if not effect.columns), self._seed)
        self._columned = tuple(effect for effect in profile.effects if effect.columns)

    def sample(self, segment: Segment, *, start: float | None = None) -> FloatArray:
        """Next offsets, one per row inside the segment.

        Parameters
        ----------
        segment : Segment
            At the model's step (5 Hz).
        start : float, optional
            Offset at the first row [m]; at the start of a drive only. Without it the drive starts as chance has it.

        Returns
        -------
        array, shape (n,)
            From the lane centre, positive to the LEFT of travel. [m]

        Raises
        ------
        ValueError
            If the segment has another step, or `start` is given in the middle of a drive.
        """
        _check_step(segment, self.profile.model.step)
        width = segment.lane_width[segment.inside]
        n = len(width)
        if not n:
            return np.empty(0)
        terms = self._terms(segment)
        if self._stream is None:
            self._stream = self.profile.model.stream(child(self._seed, 0), _start(start, width, terms))
        elif start is not None:
            raise ValueError("a drive that goes on can't start anew")
        prepare(n)
        offset = np.empty(n)
        for first in range(0, n, BLOCK):
            rows = slice(first, min(first + BLOCK, n))
            offset[rows] = _move(self._stream, rows.stop - first, _cut(terms, rows), width[rows])
        return offset

    def copy(self) -> Self:
        """A sampler in the same state that goes on by itself."""
        return deepcopy(self)

    def _terms(self, segment: Segment) -> EffectTerms:
        inside = segment.inside
        found = [self._hidden.terms(segment.time[inside], self.profile.model.step)]
        if self._columned:
            context = {"lane_width": segment.lane_width, **segment.context}
            if np.isfinite(segment.speed).any():
                context.setdefault("speed", segment.speed)
            unused = np.random.default_rng(0)
            found += [_cut(effect.terms(segment.time, context, unused), inside) for effect in self._columned]
        return combine(found)


def _move(stream: CoreStream, n: int, terms: EffectTerms, width: FloatArray) -> FloatArray:
    """Next n offsets of a stream under the terms given; see `EffectTerms`. [m]"""
    coarse, fine = stream.take(n, terms.rate)
    moved = coarse if terms.spread is None else stream.mean + terms.spread * (coarse - stream.mean)
    moved = moved + (fine if terms.fine is None else terms.fine * fine)
    offset = moved * width
    return np.asarray(offset if terms.location is None else offset + terms.location)


def sample_offsets(
    profile: DriverProfile, segment: Segment, seed: int | np.random.SeedSequence, *, start: float | None = None
) -> FloatArray:
    """Offsets of one drive of a single segment; see `OffsetSampler.sample`."""
    return OffsetSampler(profile, seed).sample(segment, start=start)


def combine(terms: Sequence[EffectTerms]) -> EffectTerms:
    """What several effects do together: locations add up, factors multiply."""
    location: FloatArray | None = None
    factors: dict[str, FloatArray | None] = {"spread": None, "rate": None, "fine": None}
    for term in terms:
        if term.location is not None:
            location = term.location if location is None else location + term.location
        for name, so_far in factors.items():
            value = getattr(term, name)
            if value is not None:
                factors[name] = value if so_far is None else so_far * value
    return EffectTerms(location, factors["spread"], factors["rate"], factors["fine"])


@dataclass(eq=False)
class _HiddenTerms:
    """Terms of the effects without a column, drawn from the start of the drive on.

    Each is drawn anew from its own seed for a horizon that at least doubles as the drive goes on: an effect that draws
    in the order of time gives the same beginning every time, so that pieces agree with the whole.
    """

    effects: tuple[Effect, ...]
    seed: np.random.SeedSequence
    begin: float | None = None
    drawn: EffectTerms | None = None
    horizon: int = 0

    def terms(self, time: FloatArray, step: float) -> EffectTerms:
        """Terms at these times. [s]"""
        if not self.effects:
            return EffectTerms()
        if self.begin is None:
            self.begin = float(time[0])
        rows = np.maximum(np.round((time - self.begin) / step).astype(np.int64), 0)
        needed = int(rows[-1]) + 1
        if self.drawn is None or needed > self.horizon:
            self.horizon = max(needed, HORIZON, 2 * self.horizon)
            grid: FloatArray = self.begin + step * np.arange(self.horizon, dtype=np.float64)
            self.drawn = combine(
                [
                    effect.terms(grid, {}, np.random.default_rng(child(self.seed, 1, index)))
                    for index, effect in enumerate(self.effects)
                ]
            )
        return _cut(self.drawn, rows)


def _cut(terms: EffectTerms, rows: slice | NDArray[np.int64]) -> EffectTerms:
    values = (getattr(terms, item.name) for item in fields(EffectTerms))
    return EffectTerms(*(None if value is None else value[rows] for value in values))


def _start(offset: float | None, width: FloatArray, terms: EffectTerms) -> Start | None:
    if offset is None:
        return None
    location = 0.0 if terms.location is None else float(terms.location[0])
    return Start(
        rel_offset=(offset - location) / float(width[0]),
        spread=1.0 if terms.spread is None else float(terms.spread[0]),
        fine=1.0 if terms.fine is None else float(terms.fine[0]),
    )


def _check_step(segment: Segment, step: float) -> None:
    if len(segment) < 2:
        return
    steps = np.diff(segment.time)
    least, most = float(steps.min()), float(steps.max())
    if not (1.0 - STEP_TOLERANCE) * step <= least <= most <= (1.0 + STEP_TOLERANCE) * step:
        raise ValueError(f"segment with steps of {least:.4g} to {most:.4g} s, the model needs {step:g} s")
