"""Offsets one by one, as a test bench asks for them: the batch call's numbers, in constant time and memory per step.

What is random needs no context and is drawn ahead in blocks. What depends on context is worked out once per step of
the model (5 Hz), on that moment's context; a bench that runs faster gets the curve of `upsampling` in between.
"""

from __future__ import annotations

import hashlib
import json
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, Self

import msgspec
import numpy as np

from xosc_lateral.arrays import FloatArray
from xosc_lateral.driver.effects import Acts, ColumnEffect, EffectTerms
from xosc_lateral.driver.effects.response import ResponseState
from xosc_lateral.driver.plausibility import check_context
from xosc_lateral.driver.process import DriveProcess, combine
from xosc_lateral.driver.profile import DriverProfile, sampling_hash
from xosc_lateral.driver.records import Record, plain, read_as
from xosc_lateral.driver.upsampling import extrapolate, piece
from xosc_lateral.errors import DriverProfileError

BLOCK = 64
"""Model steps drawn at once. [-]"""

_NEIGHBOURS = 2
"""Samples ahead that the curve between two samples needs. [-]"""


FORMAT = "xosc-lateral offset stream"

VERSION = 2
"""Of the state's format."""


class SeedState(Record, frozen=True):
    """A seed sequence."""

    entropy: int | Sequence[int] | None
    spawn_key: tuple[int, ...]


class ResponseStreamState(Record, frozen=True):
    """The response to one effect's columns: where it is, rows that are ready, and how many of these are dropped."""

    response: ResponseState
    ready: tuple[tuple[float, ...], ...]
    drop: int


class StreamState(Record, frozen=True, kw_only=True):
    """Where an `OffsetStream` is; `sampling_hash` says of which profile."""

    profile: str
    seed: SeedState
    factor: int
    """Steps per model step."""
    start: float | None
    time: float
    known: tuple[str, ...] | None
    """Context columns that count; None before the first context."""
    widths: tuple[float, ...]
    """Lane widths of rows ahead. [m]"""
    recalled: int
    """Rows before the drive."""
    looked: int
    """Steps looked ahead."""
    row: int
    """Next model step."""
    phase: int
    """Step within it."""
    samples: tuple[float, ...]
    """Model samples about the present piece. [m]"""
    curve: tuple[float, ...]
    """Its coefficients. [m]"""
    responses: tuple[ResponseStreamState, ...] = msgspec.field(name="answers")
    """Of the effects whose columns are known."""
    process: Any
    """`DriveState` as plain values."""


class OffsetStream:
    """One driver on one drive, step by step.

    The offsets are those that `OffsetSampler.sample` gives for the same profile, seed and context, and, at a higher
    rate, the curve of `upsampling` between them. A driver with preview, and a curve between samples, need to know what
    comes: `step` is therefore given the context `preview` seconds ahead of the offset that it returns, and `look`
    the context before that. A bench that doesn't know the future gives `step` the present context without a `look`:
    then the driver responds to it `preview` seconds later; what is random is the same.

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

    Raises `ValueError` if the rate is no whole multiple of the model's.

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
        self._process = DriveProcess(profile, self._seed, ahead=BLOCK)
        self._process.begin_at(time)
        self._responses = tuple(ResponseStream(effect, profile.model.step) for effect in self._process.columned)
        self._ahead = max([0, *(response.ahead for response in self._responses)]) + (
            _NEIGHBOURS if self._factor > 1 else 0
        )
        self._known: tuple[str, ...] | None = None
        self._widths: deque[float] = deque()
        self._recalled = 0
        self._looked = 0
        self._row = 0
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

        Without it, what comes first is taken to have lasted: the driver's responses start settled.
        """
        self._check(context)
        if self._looked or self._samples:
            raise ValueError("`recall` comes before `look` and before the first `step`")
        self._recalled += 1
        self._see(context, before=True)

    def look(self, context: Mapping[str, float]) -> None:
        """Context from time 0 on, at the stream's rate: `preview_steps` calls before the first `step`, or none."""
        if self._samples or self._looked >= self.preview_steps:
            raise ValueError(f"`look` takes {self.preview_steps} steps, before the first `step`")
        if self._looked % self._factor == 0:
            self._check(context)
            self._take(context)
        self._looked += 1

    def step(self, context: Mapping[str, float] | None = None) -> float:
        """Next offset from the lane centre, positive to the LEFT of travel. [m]

        Raises `ValueError` if a name that the first context had is missing, a value is none that a road has (`limits`),
        or `look` was called too few times. The stream is as it was then, and goes on with the next good context.

        Parameters
        ----------
        context : mapping of str to float, optional
            Among its names `lane_width` [m] (the profile's where absent) and `speed` [m/s]; NaN: there is none (no
            vehicle ahead). The names of the first call are those that count; a driver whose column is not among them
            does not respond to it. Read once per model step.
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

    def _check(self, context: Mapping[str, float]) -> None:
        """Refuse a bad sample before anything has changed."""
        check_context(context, "context")
        if not float(context.get("lane_width", self.profile.lane_width)) > 0.0:
            raise ValueError(f"context: lane_width {context['lane_width']} m")
        missing = [column for column in self._known or () if column not in context]
        if missing:
            raise ValueError(f"the context has no {missing[0]!r}, which the first one had")

    def _advance(self, context: Mapping[str, float]) -> None:
        """To the next model step: read its context, complete the samples and the curve."""
        self._check(context)
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
            raise ValueError(f"`look` was given {self._looked} steps, expected {self.preview_steps} or none")
        if not self._looked:
            for _ in range(self._ahead):
                self._take(context)

    def _take(self, context: Mapping[str, float]) -> None:
        """One more row of the drive itself."""
        self._see(context)
        self._widths.append(float(context.get("lane_width", self.profile.lane_width)))

    def _see(self, context: Mapping[str, float], *, before: bool = False) -> None:
        """Let the effects see one more row of context, of the drive or from before it."""
        if self._known is None:
            columns = {column for response in self._responses for column in response.effect.columns}
            self._know(tuple(sorted(columns & context.keys())))
        assert self._known is not None
        row = {column: np.array([context[column]], dtype=np.float64) for column in self._known}
        for response in self._responses:
            response.take(row, before=before)

    def _know(self, columns: tuple[str, ...]) -> None:
        """From now on these columns of the context count."""
        self._known = columns
        self._responses = tuple(
            response for response in self._responses if set(response.effect.columns) <= set(columns)
        )
        if any(response.effect.acts is Acts.RATE for response in self._responses):
            self._process.draw_nothing_ahead()

    def _sample(self) -> float:
        """The next offset at the model's step; the context that it needs has been taken."""
        hidden = self._process.hidden_terms_at(np.array([self._row]))
        terms = combine([hidden, *(response.next() for response in self._responses)])
        offset = self._process.take(terms, np.array([self._widths.popleft()]), None if self._row else self._start)
        self._row += 1
        return float(offset[0])

    def to_dict(self) -> dict[str, Any]:
        """The state as plain JSON values; `from_dict` goes on from it with the same profile."""
        state = StreamState(
            profile=sampling_hash(self.profile),
            seed=SeedState(self._seed.entropy, tuple(self._seed.spawn_key)),
            factor=self._factor,
            start=self._start,
            time=self._time,
            known=self._known,
            widths=tuple(self._widths),
            recalled=self._recalled,
            looked=self._looked,
            row=self._row,
            phase=self._phase,
            samples=tuple(self._samples),
            curve=self._curve,
            responses=tuple(response.state() for response in self._responses),
            process=self._process.state,
        )
        return sealed(plain(state))

    @classmethod
    def from_dict(cls, profile: DriverProfile, state: Mapping[str, Any]) -> Self:
        """A stream that goes on where the one that gave `state` by `to_dict` was.

        Raises `DriverProfileError` if the state is none, damaged, of another version, or of another profile.
        """
        try:
            return cls._restored(profile, state)
        except DriverProfileError:
            raise
        except (ArithmeticError, LookupError, TypeError, ValueError) as error:  # sealed anew by hand
            raise DriverProfileError(f"the state of an offset stream is damaged: {error!r}") from error

    @classmethod
    def _restored(cls, profile: DriverProfile, state: Mapping[str, Any]) -> Self:
        saved = read_as(StreamState, unsealed(state), "state")
        if saved.profile != sampling_hash(profile):
            raise DriverProfileError(f"the state belongs to another profile than {profile.name}")
        seed = np.random.SeedSequence(saved.seed.entropy, spawn_key=saved.seed.spawn_key)
        rate = saved.factor / profile.model.step
        stream = cls(profile, seed, rate=rate, start=saved.start, time=saved.time)
        if saved.known is not None:
            stream._know(saved.known)
        stream._widths.extend(saved.widths)
        stream._recalled, stream._looked, stream._row, stream._phase = (
            saved.recalled, saved.looked, saved.row, saved.phase,
        )  # fmt: skip
        stream._samples, stream._curve = list(saved.samples), saved.curve
        for response, own in zip(stream._responses, saved.responses, strict=True):
            response.restore(own)
        stream._process.restore(saved.process, "state.process")
        return stream


def sealed(values: Mapping[str, Any]) -> dict[str, Any]:
    """A state's plain values with format, version and the hash of all of it."""
    state = {"format": FORMAT, "version": VERSION, **values}
    return {**state, "sha256": _hash(state)}


def _hash(state: Mapping[str, Any]) -> str:
    """SHA-256 of a state, whatever the order and the layout of its JSON."""
    return hashlib.sha256(json.dumps(state, sort_keys=True).encode()).hexdigest()


def unsealed(state: Mapping[str, Any]) -> dict[str, Any]:
    """A state's values without format and version.

    Raises `DriverProfileError` if it is no state of a stream, of another version, or not what was written: nobody edits
    a generator's state.
    """
    if not isinstance(state, Mapping) or state.get("format") != FORMAT:
        raise DriverProfileError(f'not a state of an offset stream: "format" is not "{FORMAT}"')
    if state.get("version") != VERSION:
        raise DriverProfileError(
            f"a state written by another version of xosc-lateral (format {state.get('version')!r}; this one reads "
            f"{VERSION})"
        )
    written = {name: value for name, value in state.items() if name != "sha256"}
    if state.get("sha256") != _hash(written):
        raise DriverProfileError("the state of an offset stream is damaged: its sha256 is another")
    return {name: value for name, value in written.items() if name not in ("format", "version")}


def _steps_per_model_step(rate: float | None, step: float) -> int:
    factor = 1 if rate is None else round(rate * step)
    if rate is not None and (factor < 1 or abs(rate * step - factor) > 1e-9 * factor):
        raise ValueError(f"rate {rate:g} Hz, expected a whole multiple of the model's {1.0 / step:g} Hz")
    return factor


class ResponseStream:
    """A driver's response to one effect's columns, row by row; `ahead` are the rows of its preview."""

    def __init__(self, effect: ColumnEffect, step: float) -> None:
        self.effect = effect
        self._response = effect.response_in_blocks(step)
        self.ahead = self._response.ahead
        self._ready: deque[FloatArray] = deque()
        self._drop = 0

    def take(self, row: Mapping[str, FloatArray], *, before: bool) -> None:
        """One more row of context, each column of shape (1,); what responds to a row before the drive is not given."""
        self._drop += before
        self._ready.extend(self._response.take(self.effect.known(row)))
        while self._drop and self._ready:
            self._ready.popleft()
            self._drop -= 1

    def next(self) -> EffectTerms:
        """Terms at the next row, each of shape (1,)."""
        return self.effect.acting(self._ready.popleft()[None, :])

    def state(self) -> ResponseStreamState:
        """Its state."""
        return ResponseStreamState(self._response.state, tuple(tuple(row.tolist()) for row in self._ready), self._drop)

    def restore(self, state: ResponseStreamState) -> None:
        """Back to a state."""
        self._response.state = state.response
        self._ready.extend(np.array(row) for row in state.ready)
        self._drop = state.drop
