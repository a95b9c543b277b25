"""Offsets for segments: a driver's drive, sampled segment after segment under what is known about each."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from typing import Self

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.model.effects import ColumnEffect, EffectTerms
from xosc_lateral.drivers.model.effects.base import step_of
from xosc_lateral.drivers.model.linear_filters import prepare
from xosc_lateral.drivers.model.process import DriveProcess, combine
from xosc_lateral.drivers.model.profile import DriverProfile

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
        _check_step(segment, self.profile.model.step)
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
    profile: DriverProfile, segment: Segment, seed: int | np.random.SeedSequence, *, start: float | None = None
) -> FloatArray:
    """Offsets [m] of one drive of a single segment, shape (n,); see `OffsetSampler.sample`."""
    return OffsetSampler(profile, seed).sample(segment, start=start)


def _check_step(segment: Segment, step: float) -> None:
    if len(segment) < 2:
        return
    steps = np.diff(segment.time)
    least, most = float(steps.min()), float(steps.max())
    if not (1.0 - STEP_TOLERANCE) * step <= least <= most <= (1.0 + STEP_TOLERANCE) * step:
        raise ValueError(f"segment with steps of {least:.4g} to {most:.4g} s, the model needs {step:g} s")
