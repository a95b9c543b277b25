"""Offsets one by one, as a test bench asks for them: the batch call's numbers, in constant time and memory per step.

A driver alone is a group of one (`group`), who may know what lies ahead. What depends on context is worked out once per
step of the model (5 Hz), on that moment's context; a bench that runs faster gets the curve of `linear_filters` between.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any, Self

import msgspec
import numpy as np

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.limits import TIME
from xosc_lateral.drivers.model.actuator import CommandState
from xosc_lateral.drivers.model.effects import ColumnEffect
from xosc_lateral.drivers.model.group import DriverState, OffsetGroup, ResponseStreamState, rows_ahead
from xosc_lateral.drivers.model.linear_filters import SAMPLES_AHEAD, extrapolate, piece
from xosc_lateral.drivers.model.plausibility import TRIAL_SPEED, TRIAL_STEPS, check_context, check_offsets
from xosc_lateral.drivers.model.profile import DriverProfile, sampling_hash
from xosc_lateral.drivers.model.records import plain, read_as
from xosc_lateral.drivers.model.seeds import child

FORMAT = "xosc-lateral offset stream"

VERSION = 2
"""Of the state's format."""


class SeedState(msgspec.Struct, forbid_unknown_fields=True):
    """A seed sequence."""

    entropy: int | Sequence[int] | None
    spawn_key: tuple[int, ...]


class StreamState(msgspec.Struct, kw_only=True, forbid_unknown_fields=True):
    """Where an `OffsetStream` is; `profile` is the `sampling_hash` of whose."""

    profile: str = ""
    seed: SeedState
    factor: int  # Steps per model step.
    start: float | None
    time: float
    known: tuple[str, ...] | None = None  # Context columns that count; None before the first context.
    widths: list[float] = msgspec.field(default_factory=list)  # Lane widths of rows ahead. [m]
    recalled: int = 0  # Rows before the drive.
    looked: int = 0  # Steps looked ahead.
    row: int = 0  # Next model step.
    phase: int = 0  # Step within it.
    samples: list[float] = msgspec.field(default_factory=list)  # Model samples about the present piece. [m]
    curve: tuple[float, ...] = ()  # Its coefficients. [m]
    # Of the effects whose columns are known.
    responses: list[ResponseStreamState] = msgspec.field(name="answers", default_factory=list)
    process: Any = None  # `DriveState`; None before the first context.
    mean: float = 0.0  # As `drawn`, see `group.DriverState`; 0.2 wrote neither, and kept rows drawn ahead in `process`.
    drawn: list[list[float]] = msgspec.field(default_factory=list)
    command: CommandState | None = None


class OffsetStream:
    """One driver on one drive, step by step.

    The offsets are those that `OffsetSampler.sample` gives for the same profile, seed and context, and, at a higher
    rate, the curve of `upsampling` between them. A driver with preview, and a curve between samples, need to know what
    comes: `step` is therefore given the context `preview` seconds ahead of the offset that it returns, and `look`
    the context before that. A bench that doesn't know the future gives `step` the present context without a `look`:
    then the driver responds to it `preview` seconds later, to what is sudden over seconds (`actuator`); what is random
    is the same.

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
    drive : int, optional
        Number, from 0, of the drive that `sample` gives for that seed, and `start` of a compiled driver.

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
        drive: int | None = None,
    ) -> None:
        sequence = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
        sequence = sequence if drive is None else child(sequence, drive)
        factor = _steps_per_model_step(rate, profile.model.step)
        seeded = SeedState(sequence.entropy, tuple(sequence.spawn_key))
        self._begin_with(profile, sequence, StreamState(seed=seeded, factor=factor, start=start, time=time))

    def _begin_with(self, profile: DriverProfile, seed: np.random.SeedSequence, state: StreamState) -> None:
        self.profile, self._seed, self._state = profile, seed, state
        self._ahead = rows_ahead(profile) + (SAMPLES_AHEAD if state.factor > 1 else 0)
        self._driver: OffsetGroup | None = None

    @property
    def preview(self) -> float:
        """How far ahead of its offset `step` is given the context. [s]"""
        return self._ahead * self.profile.model.step

    @property
    def preview_steps(self) -> int:
        """The same in calls of `step`."""
        return self._ahead * self._state.factor

    def recall(self, context: Mapping[str, float]) -> None:
        """Context before time 0, one call per model step (0.2 s), oldest first; before anything else.

        Without it, what comes first is taken to have lasted: the driver's responses start settled.
        """
        self._check(context)
        state = self._state
        if state.looked or state.samples:
            raise ValueError("`recall` comes before `look` and before the first `step`")
        state.recalled += 1
        self._see(context, before=True)

    def look(self, context: Mapping[str, float]) -> None:
        """Context from time 0 on, at the stream's rate: `preview_steps` calls before the first `step`, or none."""
        state = self._state
        if state.samples or state.looked >= self.preview_steps:
            raise ValueError(f"`look` takes {self.preview_steps} steps, before the first `step`")
        if state.looked % state.factor == 0:
            self._check(context)
            self._take(context)
        state.looked += 1

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
        state = self._state
        phase = state.phase
        if phase == 0:
            self._advance({} if context is None else context)
        state.phase = phase + 1 if phase + 1 < state.factor else 0
        if phase == 0:
            return state.curve[0]
        share = phase / state.factor
        c0, c1, c2, c3, c4, c5 = state.curve
        return c0 + share * (c1 + share * (c2 + share * (c3 + share * (c4 + share * c5))))

    def _check(self, context: Mapping[str, float]) -> None:
        """Refuse a bad sample before anything has changed."""
        check_context(context, "context")
        if not float(context.get("lane_width", self.profile.lane_width)) > 0.0:
            raise ValueError(f"context: lane_width {context['lane_width']} m")
        missing = [column for column in self._state.known or () if column not in context]
        if missing:
            raise ValueError(f"the context has no {missing[0]!r}, which the first one had")

    def _advance(self, context: Mapping[str, float]) -> None:
        """To the next model step: read its context, complete the samples and the curve."""
        self._check(context)
        state = self._state
        if not state.samples and state.looked not in (0, self.preview_steps):
            raise ValueError(f"`look` was given {state.looked} steps, expected {self.preview_steps} or none")
        for _ in range(0 if state.samples or state.looked else self._ahead):  # as it is now, it is taken to be ahead
            self._take(context)
        self._take(context)
        if self._driver is not None:
            self._driver.actuator.is_surprised = self._ahead > 0 and not state.looked
        if state.factor == 1:
            state.samples = [self._sample()]
            state.curve = (state.samples[0],)
            return
        if not state.samples:
            first, second, third = self._sample(), self._sample(), self._sample()
            state.samples = [extrapolate(second, first), first, second, third]
        else:
            state.samples = [*state.samples[1:], self._sample()]
        state.curve = piece(*state.samples)

    def _take(self, context: Mapping[str, float]) -> None:
        """One more row of the drive itself."""
        self._see(context)
        self._state.widths.append(float(context.get("lane_width", self.profile.lane_width)))

    def _see(self, context: Mapping[str, float], *, before: bool = False) -> None:
        """Let the driver see one more row of context, of the drive or from before it; the first says what counts."""
        if self._driver is None:
            read = {
                name for effect in self.profile.effects if isinstance(effect, ColumnEffect) for name in effect.columns
            }
            self._state.known = tuple(sorted(read & context.keys()))
            self._driver = OffsetGroup(self.profile, self._state.known, sees_ahead=True)
            self._driver.add([self._seed], self._state.time)
        self._driver.see(
            {name: np.array([context[name]], dtype=np.float64) for name in self._driver.columns}, before=before
        )

    def _sample(self) -> float:
        """The next offset at the model's step; the context that it needs has been taken."""
        assert self._driver is not None
        state = self._state
        offset = self._driver.sample(np.array([state.widths.pop(0)]), None if state.row else state.start)
        state.row += 1
        return float(offset[0])

    def to_dict(self) -> dict[str, Any]:
        """The state as plain JSON values; `from_dict` goes on from it with the same profile."""
        state = self._state
        state.profile = sampling_hash(self.profile)
        if self._driver is not None:
            (driver,) = self._driver.driver_states()
            state.process, state.mean, state.drawn = driver.process, driver.mean, driver.drawn
            state.command = driver.command
            state.responses = [response.state for response in self._driver.responses]
        whole = sealed(plain(state))
        _SAVED_HASHES[whole["sha256"]] = None
        if len(_SAVED_HASHES) > REMEMBERED:
            del _SAVED_HASHES[next(iter(_SAVED_HASHES))]
        return whole

    @classmethod
    def from_dict(cls, profile: DriverProfile, state: Mapping[str, Any]) -> Self:
        """A stream that goes on where the one that gave `state` by `to_dict` was.

        Raises `DriverProfileError` if the state is none, damaged, of another version, or of another profile, or leads
        where no driver is: one that this process has not given itself is tried for half a minute.
        """
        try:
            if (values := unsealed(state)) and state["sha256"] not in _SAVED_HASHES:
                cls._restored(profile, values)._try_out()
            return cls._restored(profile, values)
        except DriverProfileError:
            raise
        except (ArithmeticError, AssertionError, LookupError, TypeError, ValueError) as error:  # sealed anew by hand
            raise DriverProfileError(f"the state of an offset stream is damaged: {error!r}") from error

    @classmethod
    def _restored(cls, profile: DriverProfile, values: Mapping[str, Any]) -> Self:
        saved = read_as(StreamState, values, "state")
        if saved.profile != sampling_hash(profile):
            raise DriverProfileError(f"the state belongs to another profile than {profile.name}")
        _steps_per_model_step(saved.factor / profile.model.step, profile.model.step)
        stream = cls.__new__(cls)
        seed = np.random.SeedSequence(saved.seed.entropy, spawn_key=saved.seed.spawn_key)
        stream._begin_with(profile, seed, saved)
        if saved.known is not None:
            stream._driver = OffsetGroup(profile, saved.known, sees_ahead=True)
            driver = DriverState(process=saved.process, mean=saved.mean, drawn=saved.drawn, row=saved.row)
            driver.command = saved.command or driver.command
            stream._driver.go_on_from([driver], saved.responses, [seed])
        return stream

    def _try_out(self) -> None:
        """Refuse a state from which offsets are none of a lane; it is another one then."""
        state = self._state
        begun = state.process is not None
        if not 0 <= state.phase < state.factor or abs(state.time) > TIME.value or begun != (state.known is not None):
            raise ValueError(f"step {state.phase} of {state.factor}, from {state.time:g} s")
        context = dict.fromkeys(state.known or (), np.nan) | {"speed": TRIAL_SPEED}
        width = max(self.profile.lane_width, abs(state.start or 0.0), *state.widths)
        check_context({"lane_width": width, **{f"lane {k}": one for k, one in enumerate(state.widths)}}, "state")
        share, offsets = np.linspace(0.0, 1.0, 5), list[float]()
        with np.errstate(all="ignore"):
            for number in range(TRIAL_STEPS):
                if number and state.known is not None:
                    self._advance(context)
                offsets += np.polynomial.polynomial.polyval(share, state.curve or (0.0,)).tolist()
        if self._driver is not None and self._driver.actuator.state["fault"].any():
            raise ValueError("it wants what can't be driven")
        check_offsets(np.array(offsets), width, "the state of an offset stream, in half a minute of even traffic")


REMEMBERED = 1000
"""States that this process has given last, by their hashes, are as they were. [-]"""

_SAVED_HASHES: dict[str, None] = {}


def sealed(values: Mapping[str, Any], form: str = FORMAT) -> dict[str, Any]:
    """A state's plain values with format, version and the SHA-256 of all of it, whatever its order and layout."""
    state = {"format": form, "version": VERSION, **values}
    return {**state, "sha256": hashlib.sha256(json.dumps(state, sort_keys=True).encode()).hexdigest()}


def unsealed(state: Mapping[str, Any], form: str = FORMAT) -> dict[str, Any]:
    """A state's values without format and version.

    Raises `DriverProfileError` if it is no state of a stream, of another version, or not what was written: nobody edits
    a generator's state.
    """
    if not isinstance(state, Mapping) or state.get("format") != form:
        raise DriverProfileError(f'not a state of {form.removeprefix("xosc-lateral ")}: "format" is not "{form}"')
    if state.get("version") != VERSION:
        raise DriverProfileError(
            f"a state written by another version of xosc-lateral (format {state.get('version')!r}; this one reads "
            f"{VERSION})"
        )
    values = {name: value for name, value in state.items() if name not in ("format", "version", "sha256")}
    if state.get("sha256") != sealed(values, form)["sha256"]:
        raise DriverProfileError(f"the state of {form.removeprefix('xosc-lateral ')} is damaged: its sha256 is another")
    return values


def _steps_per_model_step(rate: float | None, step: float) -> int:
    factor = 1 if rate is None else round(rate * step)
    if rate is not None and (factor < 1 or abs(rate * step - factor) > 1e-9 * factor):
        raise ValueError(f"rate {rate:g} Hz, expected a whole multiple of the model's {1.0 / step:g} Hz")
    return factor
