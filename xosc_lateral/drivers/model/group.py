"""Drivers of one profile side by side, a model step at a time; one alone (`OffsetStream`) is a group of one.

A thousand alone would spend their time on a dozen effects of one row each. Here an effect is one operation on all
drivers; what is random is drawn ahead for each, so that nobody's numbers depend on who else drives.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.limits import LIVE_RANGES
from xosc_lateral.drivers.model.actuator import Actuator, CommandState
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, EffectTerms
from xosc_lateral.drivers.model.effects.base import terms_of
from xosc_lateral.drivers.model.effects.response import ResponseState
from xosc_lateral.drivers.model.linear_filters import extrapolate, piece
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.records import plain, read_as
from xosc_lateral.drivers.model.sampling import DriveProcess, Movement, combine

ROWS_DRAWN = 64
"""Model steps drawn at once for a driver. [-]"""

_NO_FACTORS = (0.0, 1.0, 1.0, 1.0)
"""`EffectTerms.parts` that change nothing."""

_DRIVER = np.dtype(
    [("mean", float), ("at", np.int64), ("left", np.int64), ("row", np.int64),
     ("drawn", float, (2 * ROWS_DRAWN, 2 + len(_NO_FACTORS)))]
)  # fmt: skip
"""Of one driver: what his coarse part moves about [-], which drawn row is next and how many are left, his next model
step, rows drawn ahead: coarse and fine movement [lane widths], parts of his hidden effects."""


class ResponseStreamState(msgspec.Struct, forbid_unknown_fields=True):
    """The response to one effect's columns: where it is, rows that are ready, and how many of these are dropped."""

    response: ResponseState
    ready: list[FloatArray] = msgspec.field(default_factory=list)
    drop: int = 0


class ResponseStream:
    """How drivers side by side respond to the columns of the effect `number` of a profile, a model step at a time.

    Their responses begin once the rows of its preview were seen, or, where nobody knows what lies ahead, at once and
    later by `delay` rows.
    """

    def __init__(self, effect: ColumnEffect, step: float, number: int = 0, *, delay: int = 0) -> None:
        self.effect, self.number = effect, number
        self._response = effect.response_in_blocks(step, delay=delay)
        self.ahead = self._response.ahead
        self._slopes = np.empty((0, len(effect.reference)))
        self.state = ResponseStreamState(self._response.state)

    def join(self, slopes: Sequence[tuple[float, ...]]) -> None:
        """More drivers, by the effect's coefficients of each."""
        self._slopes = np.concatenate([self._slopes, np.reshape(slopes, (len(slopes), self._slopes.shape[1]))])

    def keep_present(self, there: BoolArray) -> None:
        """Drop the drivers that are not there, shape (n,)."""
        state, known = self.state.response, np.repeat(there, self._slopes.shape[1])
        if state.held is not None:
            known = known[: state.held.shape[1]]  # others have come since
            state.held = state.held[:, known]
            if state.settled is not None:
                state.settled = state.settled.reshape(-1, len(known))[:, known].ravel()
        self._slopes = self._slopes[there]
        if not there.any():  # who comes next meets nobody's past
            self.restore(ResponseStreamState(ResponseState()))

    def see(self, context: Mapping[str, FloatArray], *, before: bool = False, whose: BoolArray | None = None) -> None:
        """One more row of context, shape (n,) each; what responds to a row before the drive is not given.

        Others than those `whose` row it is, shape (n,), are left where they are; what `next` gives of them is void.
        """
        row = self.effect.known(context).ravel()
        state, seen = self.state, self.state.response
        if seen.held is not None and (known := seen.held.shape[1]) < len(row):
            new = row[known:]  # to who has come, it has always been as it is now
            seen.held = np.concatenate([seen.held, np.tile(new, (len(seen.held), 1))], axis=1)
            if seen.settled is not None:
                lags = seen.settled.reshape(-1, known)
                seen.settled = np.concatenate([lags, np.tile(new, (len(lags), 1))], axis=1).ravel()
        held, settled = seen.held, seen.settled
        state.ready.extend(self._response.take(row[None, :]))
        if whose is not None and not whose.all() and held is not None and seen.held is not None:
            waits = np.repeat(~whose, self._slopes.shape[1])
            rows = np.maximum(np.arange(len(held) - len(seen.held), len(held)), 0)
            seen.held = np.where(waits, held[rows], seen.held)
            if settled is not None and seen.settled is not None:
                seen.settled = np.where(np.tile(waits, len(settled) // len(waits)), settled, seen.settled)
        if state.drop or before:
            state.drop += before
            dropped = min(state.drop, len(state.ready))
            del state.ready[:dropped]
            state.drop -= dropped

    def next(self) -> EffectTerms:
        """Terms at the next row, shape (n,) each."""
        row = self.state.ready.pop(0).reshape(self._slopes.shape)
        return terms_of(self.effect.acts, self.effect.weighed(row, self._slopes.T))

    def restore(self, state: ResponseStreamState) -> None:
        """Back to a state."""
        self.state, self._response.state = state, state.response


class DriverState(msgspec.Struct, kw_only=True):
    """Where a driver of a group is; see `_DRIVER`."""

    process: Any  # `DriveState`.
    mean: float = 0.0
    drawn: list[list[float]] = msgspec.field(default_factory=list)
    row: int
    command: CommandState = msgspec.field(default_factory=CommandState)


def rows_ahead(profile: DriverProfile) -> int:
    """Rows of context that a driver's longest preview needs, whatever is known of it. [-]"""
    columned = (effect for effect in profile.effects if isinstance(effect, ColumnEffect))
    return max((effect.response_in_blocks(profile.model.step).ahead for effect in columned), default=0)


class OffsetGroup:
    """Drivers of one profile; each has an index, 0 to n - 1, in the order in which they came.

    Parameters
    ----------
    profile : DriverProfile
    columns : collection of str
        Context columns that `see` is given; effects of others don't act.
    sees_ahead : bool
        What is seen lies `rows_ahead` ahead of the next sample. Else it is the present, and everybody responds that
        much later.
    """

    def __init__(self, profile: DriverProfile, columns: Iterable[str], *, sees_ahead: bool = False) -> None:
        self.profile, self.columns = profile, tuple(sorted(set(columns)))
        example, delay = DriveProcess(profile, np.random.SeedSequence(0)), 0 if sees_ahead else rows_ahead(profile)
        self.responses = [
            ResponseStream(effect, profile.model.step, number, delay=delay)
            for number, effect in enumerate(example.columned)
            if set(effect.columns) <= set(self.columns)
        ]
        columned = [k for k, effect in enumerate(profile.effects, 1) if isinstance(effect, ColumnEffect)]
        numbers = [columned[response.number] for response in self.responses]
        self.actuator = Actuator(profile, numbers, is_surprised=not sees_ahead)
        self._rated = any(response.effect.acts is Acts.RATE for response in self.responses)
        example.begin_at(0.0)
        self._hidden = [part is not None for part in example.hidden_terms_at(np.zeros(1, dtype=np.int64)).parts]
        self._drives: list[DriveProcess] = []
        self._widths = np.zeros((delay + 1, 0))  # of the lane, not yet responded to, by driver; 0: none yet [m]
        self._state = np.empty(0, dtype=_DRIVER)

    def __len__(self) -> int:
        return len(self._drives)

    def add(self, seeds: Sequence[np.random.SeedSequence], time: float = 0.0) -> None:
        """More drivers, whose drives begin with the next sample, at a time of their own clocks. [s]"""
        for drive in self._join(seeds):
            drive.begin_at(time)

    def _join(self, seeds: Sequence[np.random.SeedSequence]) -> list[DriveProcess]:
        new = [DriveProcess(self.profile, seed) for seed in seeds]
        self._drives += new
        for response in self.responses:
            response.join([drive.columned[response.number].coefficients for drive in new])
        self._state = np.concatenate([self._state, np.zeros(len(new), dtype=_DRIVER)])
        self._widths = np.concatenate([self._widths, np.zeros((len(self._widths), len(new)))], axis=1)
        self.actuator.join(len(new))
        return new

    def keep_present(self, there: BoolArray) -> None:
        """Drop the drivers that are not there, shape (n,)."""
        if there.all():
            return
        self._drives = [drive for drive, stays in zip(self._drives, there, strict=True) if stays]
        for response in self.responses:
            response.keep_present(there)
        self._state = self._state[there]
        self.actuator.keep_present(there)
        self._widths = self._widths[:, there]

    def advance(
        self, context: Mapping[str, FloatArray], width: FloatArray, whose: BoolArray | None = None
    ) -> FloatArray:
        """One model step of everybody, or of those `whose` it is, shape (n,): what is returned of others is void.

        Parameters
        ----------
        context : mapping of str to array, shape (n,)
            Of this moment, all `columns`; a driver responds `rows_ahead` and `SAMPLES_AHEAD` later.
        width : array, shape (n,)
            Of the lane. [m]

        Returns
        -------
        array, shape (n, 6)
            Coefficients in u, from 0 at this moment to 1 at the next, lowest power first, of the offset. [m]
        """
        self.see(context, whose=whose)
        on = np.arange(len(self)) if whose is None else np.flatnonzero(whose)
        effects, width = [terms.rows(on) for terms in self._effects()], self._width_heeded(on, width[on])
        fresh = np.flatnonzero(self._state["row"][on] == 0)
        if len(fresh):
            theirs = [terms.rows(fresh) for terms in effects]
            first, second = (self._next(on[fresh], theirs, width[fresh]) for _ in range(2))
            self.actuator.state["samples"][on[fresh], 1] = extrapolate(second, first)
        self._next(on, effects, width)
        return np.stack(np.broadcast_arrays(*piece(*self.actuator.state["samples"].T)), axis=1)

    def _width_heeded(self, drivers: IntArray, width: FloatArray) -> FloatArray:
        """The lane width that some drivers, who now see this one, respond to: as late as to all else. [m]"""
        new = self._widths[0, drivers] == 0.0  # to who came, it has always been as it is now
        self._widths[:, drivers] = np.where(new, width, np.vstack([self._widths[1:, drivers], width]))
        return np.asarray(self._widths[0, drivers])

    def see(self, context: Mapping[str, FloatArray], *, before: bool = False, whose: BoolArray | None = None) -> None:
        """One more row of context, shape (n,) each: of the drive, or from before it; of all, or of some drivers."""
        for response in self.responses:
            response.see(context, before=before, whose=whose)

    def sample(self, width: FloatArray, start: float | None = None) -> FloatArray:
        """Everybody's next sample, once what it depends on was seen, shape (n,); the first may be given. [m]"""
        return self._next(np.arange(len(self)), self._effects(), width, start)

    def _effects(self) -> list[EffectTerms]:
        """What each effect of columns does to each driver at the sample that is next, shape (n,)."""
        return [response.next() for response in self.responses]

    def _next(
        self, drivers: IntArray, effects: Sequence[EffectTerms], width: FloatArray, start: float | None = None
    ) -> FloatArray:
        """The next sample of some drivers, shape (m,). [m]"""
        if start is not None:
            hidden = self._drives[int(drivers[0])].hidden_terms_at(np.zeros(1, dtype=np.int64))
            offset = self._drives[int(drivers[0])].take(combine([hidden, *effects]), width, start)
        else:
            movement, hidden = self._moved(drivers, effects)
            offset = self.actuator.command(drivers, self._state["row"][drivers], movement, hidden, effects, width)
        self._state["row"][drivers] += 1
        self.actuator.note(drivers, offset)
        return offset

    def _moved(self, drivers: IntArray, effects: Sequence[EffectTerms]) -> tuple[Movement, EffectTerms]:
        """Of some drivers, what is random of their next sample and what their hidden effects do to it, shape (m,)."""
        state = self._state
        if not self._rated:
            self._draw(drivers)
            at = state["at"][drivers]
            drawn = state["drawn"][drivers, at].T
            state["at"][drivers] = at + 1
            state["left"][drivers] -= 1
            hidden = (part if acts else None for part, acts in zip(drawn[2:], self._hidden, strict=True))
            return Movement(state["mean"][drivers], drawn[0], drawn[1]), EffectTerms(*hidden)
        moves, hides = [], []  # what the rate of mean reversion acts on can't be drawn ahead
        for k, index in enumerate(drivers.tolist()):
            hides.append(self._drives[index].hidden_terms_at(state["row"][index : index + 1]))
            rate = combine([hides[k], *(effect.rows(slice(k, k + 1)) for effect in effects)]).rate
            moves.append([np.ravel(part)[:1] for part in self._drives[index].movement(1, rate)])
        parts = zip(*(terms.parts for terms in hides), strict=True)
        hidden = (None if part[0] is None else np.concatenate(part) for part in parts)
        return Movement(*map(np.concatenate, zip(*moves, strict=True))), EffectTerms(*hidden)

    def _draw(self, drivers: IntArray) -> None:
        """Have at least one row drawn of each; a few of those with few left, so that not all are due at once."""
        left = self._state["left"][drivers]
        none, few = (np.count_nonzero(left <= most) for most in (0, ROWS_DRAWN // 2))
        count = max(none, min(few, 1 + 2 * len(self) // ROWS_DRAWN))
        for k in drivers[np.argsort(left, kind="stable")[:count]].tolist():
            self._draw_more(k)

    def draw_ahead(self) -> bool:
        """Have more rows drawn of the driver with the fewest, while no step is due; False: all have enough."""
        left = self._state["left"]
        if needs := not self._rated and left.min(initial=2 * ROWS_DRAWN) <= ROWS_DRAWN:
            self._draw_more(int(np.argmin(left)))
        return bool(needs)

    def _draw_more(self, k: int) -> None:
        driver, left = self._state[k], self._state["left"][k]
        driver["drawn"][:left] = driver["drawn"][driver["at"] : driver["at"] + left]
        driver["mean"], driver["drawn"][left : left + ROWS_DRAWN] = self._block(k)
        driver["at"], driver["left"] = 0, left + ROWS_DRAWN

    def _block(self, k: int) -> tuple[float, FloatArray]:
        """Mean, and the `ROWS_DRAWN` rows of a drive that come after all that is drawn, shape (BLOCK, parts)."""
        drive, row = self._drives[k], int(self._state["row"][k] + self._state["left"][k])
        hidden = drive.hidden_terms_at(np.arange(row, row + ROWS_DRAWN))
        movement = drive.movement(ROWS_DRAWN, hidden.rate)
        rows = np.empty((ROWS_DRAWN, 2 + len(_NO_FACTORS)))
        rows[:, 0], rows[:, 1] = movement.coarse, movement.fine
        for column, (values, neutral) in enumerate(zip(hidden.parts, _NO_FACTORS, strict=True)):
            self._hidden[column] |= values is not None
            rows[:, 2 + column] = neutral if values is None else values
        return float(movement.mean), rows

    def try_next(self) -> None:
        """Draw what comes after all that is drawn; a `ValueError` if a state from outside leads to no offsets."""
        for k, driver in enumerate(self._state):
            next_ = (0.0, driver["drawn"]) if self._rated else self._block(k)
            asked = (self.actuator.state[name][k] for name in ("samples", "heeded", "owed", "pace"))
            for values in (driver["mean"], *asked, driver["drawn"], *next_):
                if not np.abs(values).max() <= LIVE_RANGES["offset"].high:
                    raise ValueError(f"drives[{k}]: a number that no driver has")

    # ---- state -------------------------------------------------------------------------------------------------------
    def driver_states(self) -> list[DriverState]:
        """Where everybody is."""
        states = []
        for drive, driver, asked in zip(self._drives, self._state, self.actuator.states(), strict=True):
            rows = driver["drawn"][driver["at"] : driver["at"] + driver["left"]].tolist()
            mean, row = float(driver["mean"]), int(driver["row"])
            states.append(DriverState(process=drive.state, mean=mean, drawn=rows, row=row, command=asked))
        return states

    def to_dict(self) -> dict[str, Any]:
        """All that changes while driving, as plain JSON values."""
        responses = [response.state.response for response in self.responses]
        known = {"drives": self.driver_states(), "columns": self.columns, "widths": list(self._widths)}
        return plain({"responses": responses, **known})  # type: ignore[no-any-return]

    def restore(self, state: Mapping[str, Any], seeds: Sequence[np.random.SeedSequence]) -> None:
        """Go on from a state; the group is empty and of the same profile and columns, the seeds are the drivers'."""
        responses = read_as(list[ResponseState], state["responses"], "responses")
        drivers = read_as(list[DriverState], state["drives"], "drives")
        self.go_on_from(drivers, [ResponseStreamState(response) for response in responses], seeds)
        self._widths[:] = np.stack(read_as(list[FloatArray], state["widths"], "widths"))

    def go_on_from(
        self,
        drivers: Sequence[DriverState],
        responses: Sequence[ResponseStreamState],
        seeds: Sequence[np.random.SeedSequence],
    ) -> None:
        """The same from states that were read."""
        for k, (drive, saved) in enumerate(zip(self._join(seeds), drivers, strict=True)):
            drive.restore(saved.process, f"drives[{k}].process")
            driver, rows = self._state[k], np.reshape(saved.drawn, (-1, 2 + len(_NO_FACTORS)))
            driver["drawn"][: len(rows)], driver["left"] = rows, len(rows)
            driver["mean"], driver["row"] = saved.mean, saved.row
            self.actuator.restore(k, saved.command)
        for response, response_state in zip(self.responses, responses, strict=True):
            response.restore(response_state)
