"""Offsets one by one, as a test bench asks for them: the batch call's numbers, in constant time and memory per step.

What is random needs no context and is drawn ahead in blocks. What depends on context is worked out once per step of
the model (5 Hz), on that moment's context; a bench that runs faster gets the curve of `upsampling` in between.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections import deque
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.core import CoreStream, Start
from xosc_lateral.driver.effects import EffectTerms
from xosc_lateral.driver.effects.acts import Acts, terms_of
from xosc_lateral.driver.effects.column import ColumnEffect
from xosc_lateral.driver.effects.hidden import HiddenEffect
from xosc_lateral.driver.effects.response import split_shift
from xosc_lateral.driver.effects.running import RunningTerms
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.sampling import combine
from xosc_lateral.driver.seeds import child
from xosc_lateral.driver.state import restore, state_of
from xosc_lateral.driver.upsampling import extrapolate, piece
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]

BLOCK = 64
"""Model steps drawn at once. [-]"""

FORMAT = "xosc-lateral offset stream"

_NEIGHBOURS = 2
"""Samples ahead that the curve between two samples needs. [-]"""


class OffsetStream:
    """One driver on one drive, step by step.

    The offsets are those that `OffsetSampler.sample` gives for the same profile, seed and context, and, at a higher
    rate, those that `upsample` makes of them. A driver who looks ahead, and a curve between samples, need to know what
    comes: `step` is therefore given the context `preview` seconds ahead of the offset that it returns, and `look`
    the context before that. A bench that doesn't know the future gives `step` the present context without a `look`:
    then the driver answers to it `preview` seconds later; what is random is the same.

    Parameters
    ----------
    profile : DriverProfile
    seed : int or numpy.random.SeedSequence
    rate : float, optional
        Calls of `step` per second, a whole multiple of the model's 5 Hz (100 for a bench at 100 Hz). [1/s]
    start : float, optional
        Offset at time 0; without it the drive starts as chance has it. [m]
    time : float
        Of the first offset in the drive's clock, for effects that depend on time. [s]

    Raises
    ------
    ValueError
        If the rate is no whole multiple of the model's.

    Examples
    --------
    >>> stream = OffsetStream(profile, seed=1, rate=100.0)
    >>> for context in road_ahead(0.0, stream.preview):
    ...     stream.look(context)
    >>> offset = stream.step({"speed": 30.0, "lane_width": 3.5, "curvature": 1e-3})
    """

    def __init__(
        self,
        profile: DriverProfile,
        seed: int | np.random.SeedSequence,
        *,
        rate: float | None = None,
        start: float | None = None,
        time: float = 0.0,
    ) -> None:
        self.profile = profile
        self._seed = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
        self._factor = _steps_per_model_step(rate, profile.model.step)
        self._start, self._time = start, time
        effects = [effect for effect in profile.effects if isinstance(effect, ColumnEffect)]
        shifts = [effect.lag_s / profile.model.step for effect in effects]
        self._ahead = max([0, *(math.ceil(-shift) for shift in shifts)]) + (_NEIGHBOURS if self._factor > 1 else 0)
        self._answers = tuple(_Answer(effect, profile.model.step, self._ahead) for effect in effects)
        self._movement = _Movement(profile, self._seed, time)
        self._known: tuple[str, ...] | None = None
        self._widths: deque[float] = deque()
        self._recalled = 0
        self._looked = 0
        self._phase = 0
        self._samples: list[float] = []
        self._curve: tuple[float, ...] = ()

    @property
    def preview(self) -> float:
        """How far ahead of its offset `step` is given the context. [s]"""
        return self._ahead * self.profile.model.step

    @property
    def preview_steps(self) -> int:
        """The same in calls of `step`."""
        return self._ahead * self._factor

    def recall(self, context: Mapping[str, float]) -> None:
        """Context before time 0, one call per model step (0.2 s), oldest first; before anything else.

        Without it, what comes first is taken to have lasted: the driver's answers start settled.
        """
        if self._looked or self._samples:
            raise ValueError("recall what was before the drive before looking ahead and before the first step")
        self._recalled += 1
        self._see(context)

    def look(self, context: Mapping[str, float]) -> None:
        """Context from time 0 on, at the stream's rate: `preview_steps` calls before the first `step`, or none."""
        if self._samples or self._looked >= self.preview_steps:
            raise ValueError(f"look {self.preview_steps} steps ahead, before the first step")
        if self._looked % self._factor == 0:
            self._take(context)
        self._looked += 1

    def step(self, context: Mapping[str, float] | None = None) -> float:
        """Next offset.

        Parameters
        ----------
        context : mapping of str to float, optional
            Under DESIGN's names, among them `lane_width` [m] (the profile's where absent) and `speed` [m/s]; NaN:
            there is none (no vehicle ahead). The names of the first call are those that count; a driver whose column
            is not among them does not answer to it. Read once per model step.

        Returns
        -------
        float
            From the lane centre, positive to the LEFT of travel. [m]

        Raises
        ------
        ValueError
            If a name that the first context had is missing, or `look` was called too few times.
        """
        phase = self._phase
        if phase == 0:
            self._advance({} if context is None else context)
        self._phase = phase + 1 if phase + 1 < self._factor else 0
        if phase == 0:
            return self._curve[0]
        share = phase / self._factor
        c0, c1, c2, c3, c4, c5 = self._curve
        return c0 + share * (c1 + share * (c2 + share * (c3 + share * (c4 + share * c5))))

    def _advance(self, context: Mapping[str, float]) -> None:
        """To the next model step: read its context, complete the samples and the curve."""
        if not self._samples:
            self._begin(context)
        self._take(context)
        if self._factor == 1:
            self._curve = (self._sample(),)
            self._samples = [self._curve[0]]
            return
        if not self._samples:
            first, second, third = self._sample(), self._sample(), self._sample()
            self._samples = [extrapolate(second, first), first, second, third]
        else:
            self._samples = [*self._samples[1:], self._sample()]
        self._curve = piece(*self._samples)

    def _begin(self, context: Mapping[str, float]) -> None:
        """Before the first step: what was not looked at is taken to be like the first context."""
        if self._looked not in (0, self.preview_steps):
            raise ValueError(f"looked {self._looked} steps ahead; {self.preview_steps} or none")
        if not self._looked:
            for _ in range(self._ahead):
                self._take(context)

    def _take(self, context: Mapping[str, float]) -> None:
        """One more row of the drive itself."""
        self._see(context)
        width = float(context.get("lane_width", self.profile.lane_width))
        if not width > 0.0:
            raise ValueError(f"lane_width {width} m")
        self._widths.append(width)

    def _see(self, context: Mapping[str, float]) -> None:
        """Let the effects see one more row of context."""
        if self._known is None:
            columns = {column for answer in self._answers for column in answer.effect.columns}
            self._known = tuple(sorted(columns & context.keys()))
            self._answers = tuple(answer for answer in self._answers if set(answer.effect.columns) <= context.keys())
            self._movement.paced |= any(answer.effect.acts is Acts.RATE for answer in self._answers)
        try:
            row = {column: np.array([context[column]], dtype=np.float64) for column in self._known}
        except KeyError as error:
            raise ValueError(f"the context has no {error}, which the first one had") from error
        for answer in self._answers:
            answer.take(row)
            answer.pass_by(self._recalled, self._ahead)

    def _sample(self) -> float:
        """The next offset at the model's step; the context that it needs has been taken."""
        width = self._widths.popleft()
        return self._movement.next(width, [answer.next() for answer in self._answers], self._start)

    def to_dict(self) -> dict[str, Any]:
        """The state as plain JSON values; `from_dict` goes on from it with the same profile."""
        return {
            "format": FORMAT,
            "profile": _profile_hash(self.profile),
            "seed": {"entropy": self._seed.entropy, "spawn_key": list(self._seed.spawn_key)},
            "factor": self._factor,
            "start": self._start,
            "time": self._time,
            "known": None if self._known is None else list(self._known),
            "widths": list(self._widths),
            "recalled": self._recalled,
            "looked": self._looked,
            "phase": self._phase,
            "samples": list(self._samples),
            "curve": list(self._curve),
            "answers": [answer.to_dict() for answer in self._answers],
            "movement": self._movement.to_dict(),
        }

    @classmethod
    def from_dict(cls, profile: DriverProfile, state: Mapping[str, Any]) -> Self:
        """A stream that goes on where the one that gave `state` was.

        Raises
        ------
        DriverProfileError
            If the state is none, or of another profile.
        """
        if state.get("format") != FORMAT:
            raise DriverProfileError(f'no state of an offset stream: "format" is not "{FORMAT}"')
        if state["profile"] != _profile_hash(profile):
            raise DriverProfileError(f"the state belongs to another profile than {profile.name}")
        seed = np.random.SeedSequence(state["seed"]["entropy"], spawn_key=tuple(state["seed"]["spawn_key"]))
        rate = state["factor"] / profile.model.step
        stream = cls(profile, seed, rate=rate, start=state["start"], time=state["time"])
        if state["known"] is not None:
            stream._known = tuple(state["known"])
            stream._answers = tuple(
                answer for answer in stream._answers if set(answer.effect.columns) <= set(stream._known)
            )
        stream._widths.extend(state["widths"])
        stream._recalled, stream._looked, stream._phase = state["recalled"], state["looked"], state["phase"]
        stream._samples, stream._curve = list(state["samples"]), tuple(state["curve"])
        for answer, saved in zip(stream._answers, state["answers"], strict=True):
            answer.restore(saved)
        stream._movement.restore(state["movement"])
        return stream


class _Answer:
    """A driver's answer to one effect's columns, row by row: what `respond` does with whole arrays."""

    def __init__(self, effect: ColumnEffect, step: float, ahead: int) -> None:
        self.effect = effect
        shift = effect.lag_s / step
        self._whole, self._share = split_shift(shift)
        self._keep = float(np.exp(-step / effect.response_s)) if effect.response_s > 0 else None
        self._reference = np.asarray(effect.reference)
        # Rows that are still needed: from the one that a delay goes back to, to the one that is looked ahead to.
        self._rows: deque[FloatArray] = deque(maxlen=ahead + max(0, math.ceil(shift)) + 2)
        self._taken = 0
        self._given = 0
        self._settled: FloatArray | None = None

    def take(self, context: Mapping[str, FloatArray]) -> None:
        """One more row of context, each column of shape (1,)."""
        values = self.effect.quantity(context)[0]
        missing = np.isnan(values)
        self._rows.append(np.where(missing, self._reference, values) if missing.any() else values)
        self._taken += 1

    def pass_by(self, rows: int, ahead: int) -> None:
        """Go through the first rows without asking for terms, as far as what they look ahead to has been taken."""
        while self._given < min(rows, self._taken - ahead):
            self._respond()

    def next(self) -> EffectTerms:
        """Terms at the next row, each of shape (1,)."""
        return terms_of(self.effect.acts, self.effect.weighed(self._respond()[None, :]))

    def _respond(self) -> FloatArray:
        """Shift and first-order lag, as `respond` has them."""
        shifted = self._shifted(self._given + self._whole)
        self._given += 1
        if self._keep is not None:
            carried = self._keep * (shifted if self._settled is None else self._settled)
            shifted = self._settled = (1.0 - self._keep) * shifted + carried
        return shifted

    def _shifted(self, low: int) -> FloatArray:
        if low < 0 or self._share == 0.0:
            return self._row(max(low, 0))
        return (1.0 - self._share) * self._row(low) + self._share * self._row(low + 1)

    def _row(self, index: int) -> FloatArray:
        return self._rows[index - self._taken + len(self._rows)]

    def to_dict(self) -> dict[str, Any]:
        """Its state."""
        return {
            "rows": [row.tolist() for row in self._rows],
            "taken": self._taken,
            "given": self._given,
            "settled": None if self._settled is None else self._settled.tolist(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Back to a state."""
        self._rows.extend(np.array(row) for row in state["rows"])
        self._taken, self._given = state["taken"], state["given"]
        self._settled = None if state["settled"] is None else np.array(state["settled"])


class _Movement:
    """The random part: core model and hidden effects, drawn ahead in blocks unless an effect sets the pace."""

    def __init__(self, profile: DriverProfile, seed: np.random.SeedSequence, time: float) -> None:
        self._model, self._seed, self._time = profile.model, seed, time
        hidden = [effect for effect in profile.effects if isinstance(effect, HiddenEffect)]
        self._hidden: list[RunningTerms] = [
            effect.running(np.random.default_rng(child(seed, 1, index))) for index, effect in enumerate(hidden)
        ]
        self._core: CoreStream | None = None
        self._begun: Start | None = None
        self.paced = False
        self._row = 0
        self._terms = EffectTerms()
        self._coarse: FloatArray = np.empty(0)
        self._fine: FloatArray = np.empty(0)

    def next(self, width: float, answers: list[EffectTerms], start: float | None) -> float:
        """Next offset. [m]"""
        place = self._row % BLOCK
        if place == 0 and self._hidden:
            self._terms = self._hidden_terms()
        terms = combine([_at(self._terms, place), *answers])
        core = self._core or self._begin(_start(start, width, terms))
        if self.paced or terms.rate is not None:
            coarse, fine = (float(values[0]) for values in core.take(1, terms.rate))
        else:
            if place == 0:
                self._coarse, self._fine = core.take(BLOCK)
            coarse, fine = float(self._coarse[place]), float(self._fine[place])
        self._row += 1
        moved = coarse if terms.spread is None else self._mean + float(terms.spread[0]) * (coarse - self._mean)
        moved = moved + (fine if terms.fine is None else float(terms.fine[0]) * fine)
        offset = moved * width
        return offset if terms.location is None else offset + float(terms.location[0])

    def _begin(self, start: Start | None) -> CoreStream:
        self._begun = start
        self._core = self._model.stream(child(self._seed, 0), start)
        self._mean = self._core.mean
        return self._core

    def _hidden_terms(self) -> EffectTerms:
        step = self._model.step
        time = self._time + step * np.arange(self._row, self._row + BLOCK, dtype=np.float64)
        return combine([effect.take(time) for effect in self._hidden])

    def to_dict(self) -> dict[str, Any]:
        """Its state."""
        return {
            "begun": None if self._begun is None else asdict(self._begun),
            "core": None if self._core is None else state_of(self._core),
            "hidden": [state_of(effect) for effect in self._hidden],
            "paced": self.paced,
            "row": self._row,
            "terms": {name: _listed(getattr(self._terms, name)) for name in _TERMS},
            "coarse": self._coarse.tolist(),
            "fine": self._fine.tolist(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Back to a state."""
        if state["core"] is not None:
            restore(self._begin(None if state["begun"] is None else Start(**state["begun"])), state["core"])
        for effect, saved in zip(self._hidden, state["hidden"], strict=True):
            restore(effect, saved)
        self.paced, self._row = state["paced"], state["row"]
        arrays = {name: None if values is None else np.array(values) for name, values in state["terms"].items()}
        self._terms = EffectTerms(**arrays)
        self._coarse, self._fine = np.array(state["coarse"]), np.array(state["fine"])


_TERMS = ("location", "spread", "rate", "fine")


def _at(terms: EffectTerms, row: int) -> EffectTerms:
    """One row of terms, each of shape (1,)."""
    return EffectTerms(
        *(None if (values := getattr(terms, name)) is None else values[row : row + 1] for name in _TERMS)
    )


def _listed(values: FloatArray | None) -> list[float] | None:
    return None if values is None else values.tolist()


def _start(offset: float | None, width: float, terms: EffectTerms) -> Start | None:
    if offset is None:
        return None
    location, spread, fine = (
        otherwise if values is None else float(values[0])
        for values, otherwise in ((terms.location, 0.0), (terms.spread, 1.0), (terms.fine, 1.0))
    )
    return Start(rel_offset=(offset - location) / width, spread=spread, fine=fine)


def _steps_per_model_step(rate: float | None, step: float) -> int:
    factor = 1 if rate is None else round(rate * step)
    if rate is not None and (factor < 1 or abs(rate * step - factor) > 1e-9 * factor):
        raise ValueError(f"rate {rate:g} Hz, expected a whole multiple of the model's {1.0 / step:g} Hz")
    return factor


def _profile_hash(profile: DriverProfile) -> str:
    return hashlib.sha256(json.dumps(profile.to_dict(), sort_keys=True).encode()).hexdigest()
