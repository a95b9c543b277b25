"""Drivers of one profile side by side, a model step at a time: what `OffsetStream` gives each, for many at once.

A thousand streams spend their time on a dozen effects of one row each. Here an effect is one operation on all drivers;
what is random is drawn ahead for each as a stream draws it, so that nobody's numbers depend on who else drives.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.limits import LIVE_RANGES
from xosc_lateral.base.segment import FADES
from xosc_lateral.drivers.model.effects import Acts, EffectTerms
from xosc_lateral.drivers.model.effects.base import terms_of
from xosc_lateral.drivers.model.effects.response import Response, ResponseState
from xosc_lateral.drivers.model.linear_filters import SAMPLES_AHEAD, extrapolate, piece
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.records import plain, read_as
from xosc_lateral.drivers.model.sampling import DriveProcess, Movement, combine, offsets_of

BLOCK = 64
"""Model steps drawn at once for a driver. [-]"""

_PARTS = ("coarse", "fine", *(f"hidden_{name}" for name in ("location", "spread", "rate", "fine")))
"""What is drawn ahead: of the movement [lane widths], then factors of hidden effects (location: [m])."""

_NO_FACTORS = (0.0, 0.0, 0.0, 1.0, 1.0, 1.0)

_DRIVER = np.dtype(
    [("mean", float), ("at", np.int64), ("left", np.int64), ("row", np.int64), ("samples", float, 4),
     ("drawn", float, (2 * BLOCK, len(_PARTS)))]
)  # fmt: skip
"""Of one driver: what his coarse part moves about [-], which drawn row is next and how many are left, his next model
step, his last samples [m], rows drawn ahead."""


class OffsetGroup:
    """Drivers of one profile; each has an index, 0 to n - 1, in the order in which they came.

    Parameters
    ----------
    profile : DriverProfile
    columns : collection of str
        Context columns that `advance` is given; effects of others don't act.
    """

    def __init__(self, profile: DriverProfile, columns: Iterable[str]) -> None:
        self.profile, self.columns = profile, tuple(sorted(set(columns)))
        example = DriveProcess(profile, np.random.SeedSequence(0))
        columned, self._hidden = example.columned, bool(example.hidden)
        step = profile.model.step
        # as of a stream: the longest preview decides how much later everybody responds, whatever is known
        self._ahead = max((effect.response_in_blocks(step).ahead for effect in columned), default=0)
        self._which = [k for k, effect in enumerate(columned) if set(effect.columns) <= set(self.columns)]
        self._effects = [columned[k] for k in self._which]
        self._responses = [self._response(k) for k in range(len(self._effects))]
        self._rated = any(effect.acts is Acts.RATE for effect in self._effects)
        self._drives: list[DriveProcess] = []
        self._slopes: list[FloatArray] = [np.empty((0, len(effect.reference))) for effect in self._effects]
        self._state = np.empty(0, dtype=_DRIVER)

    def _response(self, k: int, state: ResponseState | None = None) -> Response:
        return self._effects[k].response_in_blocks(self.profile.model.step, state, delay=self._ahead)

    def __len__(self) -> int:
        return len(self._drives)

    @property
    def preview(self) -> float:
        """By how much later drivers respond than those who know what lies ahead. [s]"""
        return (self._ahead + SAMPLES_AHEAD) * self.profile.model.step

    def add(self, seeds: Sequence[np.random.SeedSequence]) -> None:
        """More drivers, whose drives begin with the next `advance`, at 0 s of their own clocks."""
        for drive in self._join(seeds):
            drive.begin_at(0.0)

    def _join(self, seeds: Sequence[np.random.SeedSequence]) -> list[DriveProcess]:
        new = [DriveProcess(self.profile, seed) for seed in seeds]
        self._drives += new
        for k, which in enumerate(self._which):
            slopes = [drive.columned[which].coefficients for drive in new]
            theirs = np.reshape(slopes, (len(new), self._slopes[k].shape[1]))
            self._slopes[k] = np.concatenate([self._slopes[k], theirs])
        self._state = np.concatenate([self._state, np.zeros(len(new), dtype=_DRIVER)])
        return new

    def keep_present(self, there: BoolArray) -> None:
        """Drop the drivers that are not there, shape (n,)."""
        if there.all():
            return
        self._drives = [drive for drive, stays in zip(self._drives, there, strict=True) if stays]
        if not there.any():  # who comes next meets nobody's past
            self._responses = [self._response(k) for k in range(len(self._effects))]
        for response, slopes in zip(self._responses, self._slopes, strict=True):
            state, known = response.state, there[: self._known(response, slopes.shape[1])]
            if state.held is not None:
                wide = np.repeat(known, slopes.shape[1])
                state.held = state.held[:, wide]
                if state.settled is not None:
                    state.settled = state.settled.reshape(-1, len(wide))[:, wide].ravel()
        self._slopes = [slopes[there] for slopes in self._slopes]
        self._state = self._state[there]

    @staticmethod
    def _known(response: Response, components: int) -> int:
        """Drivers whose quantity a response has seen; others have come since."""
        held = response.state.held
        return 0 if held is None else held.shape[1] // max(components, 1)

    def advance(self, context: Mapping[str, FloatArray], width: FloatArray) -> FloatArray:
        """One model step of everybody.

        Parameters
        ----------
        context : mapping of str to array, shape (n,)
            Of this moment, all `columns`; a driver responds to it `preview` seconds later.
        width : array, shape (n,)
            Of the lane. [m]

        Returns
        -------
        array, shape (n, 6)
            Coefficients in u, from 0 at this moment to 1 at the next, lowest power first, of the offset. [m]
        """
        effects, samples = self._terms(context), self._state["samples"]
        fresh = np.flatnonzero(self._state["row"] == 0)
        if len(fresh):
            first, second = (self._next(fresh, effects.rows(fresh), width[fresh]) for _ in range(2))
            samples[fresh] = np.stack([np.zeros(len(fresh)), extrapolate(second, first), first, second], axis=1)
        sample = self._next(np.arange(len(self)), effects, width)
        samples[:] = np.concatenate([samples[:, 1:], sample[:, None]], axis=1)
        return np.stack(np.broadcast_arrays(*piece(*samples.T)), axis=1)

    def _terms(self, context: Mapping[str, FloatArray]) -> EffectTerms:
        """What the effects of columns do to each driver at the sample that is next, shape (n,) each."""
        terms = []
        for effect, response, slopes in zip(self._effects, self._responses, self._slopes, strict=True):
            names = (*effect.columns, *(f"{column}{FADES}" for column in effect.columns))
            values = effect.known({name: context[name] for name in names if name in context})
            state, known = response.state, self._known(response, values.shape[1])
            row = values.ravel()
            if state.held is not None and known < len(values):  # to who has come, it has always been as it is now
                new = values[known:].ravel()
                state.held = np.concatenate([state.held, np.tile(new, (len(state.held), 1))], axis=1)
                if state.settled is not None:
                    lags = state.settled.reshape(-1, known * values.shape[1])
                    state.settled = np.concatenate([lags, np.tile(new, (len(lags), 1))], axis=1).ravel()
            due = response.take(row[None, :]).reshape(values.shape)
            terms.append(terms_of(effect.acts, effect.weighed(due, slopes.T)))
        return combine(terms)

    def _next(self, drivers: IntArray, effects: EffectTerms, width: FloatArray) -> FloatArray:
        """The next sample of some drivers, shape (m,). [m]"""
        if self._rated:
            return self._next_rated(drivers, effects, width)
        self._draw(drivers)
        state = self._state
        parts = state["drawn"][drivers, state["at"][drivers]].T
        state["at"][drivers] += 1
        state["left"][drivers] -= 1
        state["row"][drivers] += 1
        movement = Movement(state["mean"][drivers], parts[0], parts[1])
        hidden = EffectTerms(*parts[2:]) if self._hidden else EffectTerms()
        terms = combine([hidden, effects])
        factors = EffectTerms(terms.location, terms.spread, None, terms.fine)
        return offsets_of(self.profile, movement, factors, width)

    def _next_rated(self, drivers: IntArray, effects: EffectTerms, width: FloatArray) -> FloatArray:
        """The same where effects act on the rate of mean reversion: nothing can be drawn ahead."""
        offsets, row = np.empty(len(drivers)), self._state["row"]
        for k, index in enumerate(drivers):
            drive, only = self._drives[index], slice(k, k + 1)
            terms = combine([drive.hidden_terms_at(row[index : index + 1]), effects.rows(only)])
            offsets[k] = drive.take(terms, width[only])[0]
        row[drivers] += 1
        return offsets

    def _draw(self, drivers: IntArray) -> None:
        """Have at least one row drawn of each; a few of those with few left, so that not all are due at once."""
        remaining = self._state["left"]
        due = set(drivers[remaining[drivers] == 0].tolist())
        spare = drivers[remaining[drivers] <= BLOCK]
        few = spare[np.argsort(remaining[spare], kind="stable")[: 1 + 2 * len(self) // BLOCK]]
        for k in sorted(due | set(few.tolist())):
            driver, left = self._state[k], remaining[k]
            driver["drawn"][:left] = driver["drawn"][driver["at"] : driver["at"] + left]
            driver["mean"], driver["drawn"][left : left + BLOCK] = self._block(
                self._drives[k], int(driver["row"] + left)
            )
            driver["at"], driver["left"] = 0, left + BLOCK

    @staticmethod
    def _block(drive: DriveProcess, row: int) -> tuple[float, FloatArray]:
        """Mean, and `BLOCK` rows of a drive from `row` on, shape (BLOCK, parts)."""
        hidden = drive.hidden_terms_at(np.arange(row, row + BLOCK))
        movement = drive.movement(BLOCK, hidden.rate)
        rows = np.tile(_NO_FACTORS, (BLOCK, 1))
        for column, values in enumerate((movement.coarse, movement.fine, *hidden.parts)):
            if values is not None:
                rows[:, column] = values
        return float(movement.mean), rows

    def try_next(self) -> None:
        """Draw what comes after all that is drawn; a `ValueError` if a state from outside leads to no offsets."""
        for k, (drive, driver) in enumerate(zip(self._drives, self._state, strict=True)):
            next_ = (0.0, driver["drawn"]) if self._rated else self._block(drive, int(driver["row"] + driver["left"]))
            for values in (driver["mean"], driver["samples"], driver["drawn"], *next_):
                if not np.abs(values).max() <= LIVE_RANGES["offset"].high:
                    raise ValueError(f"drives[{k}]: a number that no driver has")

    # ---- state -------------------------------------------------------------------------------------------------------
    def to_dict(self) -> dict[str, Any]:
        """All that changes while driving, as plain JSON values."""
        drives = [
            {
                "process": drive.state,
                "mean": float(own["mean"]),
                "drawn": own["drawn"][own["at"] : own["at"] + own["left"]].tolist(),
                "row": int(own["row"]),
                "samples": own["samples"].tolist(),
            }
            for drive, own in zip(self._drives, self._state, strict=True)
        ]
        values: dict[str, Any] = plain(
            {"responses": [response.state for response in self._responses], "drives": drives, "columns": self.columns}
        )
        return values

    def restore(self, state: Mapping[str, Any], seeds: Sequence[np.random.SeedSequence]) -> None:
        """Go on from a state; the group is empty and of the same profile and columns, the seeds are the drivers'."""
        for k, (drive, saved) in enumerate(zip(self._join(seeds), state["drives"], strict=True)):
            drive.restore(saved["process"], f"drives[{k}]")
            driver, rows = self._state[k], np.reshape(saved["drawn"], (-1, len(_PARTS)))
            driver["drawn"][: len(rows)], driver["left"] = rows, len(rows)
            driver["mean"], driver["row"], driver["samples"] = float(saved["mean"]), int(saved["row"]), saved["samples"]
        self._responses = [
            self._response(k, read_as(ResponseState, driver, f"responses[{k}]"))
            for k, driver in enumerate(state["responses"])
        ]
