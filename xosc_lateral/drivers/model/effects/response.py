"""How a driver responds to a quantity: when, and how slowly. Block by block; a whole drive is one long block.

References
----------
.. [1] K. J. Åström, B. Wittenmark, "Computer-Controlled Systems", 3rd ed., 1997, chapter 2: a lag sampled exactly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce
from itertools import pairwise
from operator import add

import msgspec
import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.linear_filters import recur


class ResponseState(msgspec.Struct):
    """Where a response is."""

    held: FloatArray | None = None  # Last rows of the quantity, as far back as they are still needed, shape (m, k).
    taken: int = 0  # Rows of the quantity seen.
    given: int = 0  # Rows of the response given.
    # Last response of each first-order lag, then peak and last row of an episode, shape (order * k,), (2 * k,).
    settled: FloatArray | None = None


class Response:
    """A shift in time, then equal first-order lags of gain 1 one after the other, of a quantity given block by block.

    Or a weighted sum of shifts in place of the one: a course over time. What is shifted may be held: from where it is
    beyond `episode` to either side its peak so far, until it is there again.

    Row i of the response is due once all rows of its preview were given; before the first row and, at the end,
    beyond the last one, the outermost row holds. The lag starts settled.

    Of an even grid of a `step` [s]; `lag_s`, `response_s`, `order`, `course` and `episode` as in `ColumnEffect`;
    `delay`: rows that everything comes later by, for who doesn't know what lies ahead.
    """

    def __init__(
        self,
        step: float,
        lag_s: float,
        response_s: float,
        state: ResponseState | None = None,
        *,
        order: int = 1,
        delay: int = 0,
        course: Sequence[tuple[float, float]] = (),
        episode: float = 0.0,
    ) -> None:
        self.state = ResponseState() if state is None else state
        self._order, self._episode = order if response_s > 0 else 0, episode
        shifts = [(*split_shift((lag_s + late) / step), weight) for late, weight in course or [(0.0, 1.0)]]
        self._shifts = [(whole - delay, share, weight) for whole, share, weight in shifts]
        self._earliest = min(whole for whole, _, _ in self._shifts)
        self._keep = float(np.exp(-step / response_s)) if response_s > 0 else None
        self.ahead = max(0, *(whole + (1 if share else 0) for whole, share, _ in self._shifts))
        """Rows of preview."""

    def take(self, values: FloatArray) -> FloatArray:
        """What is due of the response after more rows of the quantity, shape (n, k); (m, k). [unit of the quantity]"""
        self._add(values)
        return self._due(max(self.state.given, self.state.taken - self.ahead))

    def finish(self, values: FloatArray) -> FloatArray:
        """All responses that are left once the last rows are given, shape (m, k). [unit of the quantity]"""
        self._add(values)
        return self._due(self.state.taken)

    def _add(self, values: FloatArray) -> None:
        state = self.state
        state.held = values if state.held is None else np.concatenate([state.held, values])
        state.taken += len(values)

    def _due(self, until: int) -> FloatArray:
        """Rows of the response from the first that wasn't given."""
        state = self.state
        assert state.held is not None
        if until == state.given + 1:
            response = self._single(state.held, state.given)
        else:
            parts = (
                (weight, self._rows(state.held, state.given + whole, until + whole, share))
                for whole, share, weight in self._shifts
            )
            response = self._lagged(np.asarray(reduce(add, (weight * rows for weight, rows in parts))))
        state.given = until
        done = min(until + self._earliest, state.taken - 1) - (state.taken - len(state.held))
        if done > 0:
            state.held = state.held[done:]
        return response

    def _single(self, held: FloatArray, row: int) -> FloatArray:
        """One row of the response, by the operations of many, without their cost; shape (1, k)."""
        value = reduce(add, (weight * self._row(held, row + whole, share) for whole, share, weight in self._shifts))
        if self._episode:
            return self._lagged(np.array(value[None, :]))
        if self._keep is not None:
            settled = self._settled(value)
            for lagged in settled.reshape(self._order, -1):
                lagged[:] = value = (1.0 - self._keep) * value + self._keep * lagged
            self.state.settled = settled
        return np.asarray(value[None, :])

    def _row(self, held: FloatArray, at: int, share: float) -> FloatArray:
        """One row of the quantity, `share` of a step later than the row `at`, shape (k,)."""
        if at < 0:
            return np.asarray(held[0])
        if at >= self.state.taken - 1:
            return np.asarray(held[-1])
        at -= self.state.taken - len(held)
        return np.asarray(held[at] if not share else held[at] * (1.0 - share) + share * held[at + 1])

    def _rows(self, held: FloatArray, begin: int, end: int, share: float) -> FloatArray:
        """Rows `begin` to `end` of the quantity, each `share` of a step later, as an array of its own."""
        last = self.state.taken - 1
        at = last + 1 - len(held)
        result = np.empty((end - begin, held.shape[1]))
        before, behind = min(max(-begin, 0), len(result)), min(max(end - last, 0), len(result))
        inside = slice(before, len(result) - behind)
        low = slice(begin + before - at, end - behind - at)
        if inside.start < inside.stop:
            result[inside] = held[low]
            if share:
                result[inside] *= 1.0 - share
                result[inside] += share * held[low.start + 1 : low.stop + 1]
        result[:before], result[len(result) - behind :] = held[:1], held[-1:]
        return result

    def _lagged(self, values: FloatArray) -> FloatArray:
        """Holds and first-order lags, in place."""
        if not (self._order or self._episode) or not len(values):
            return values
        settled, keep = self._settled(values[0]), 0.0 if self._keep is None else self._keep
        rows = settled.reshape(-1, values.shape[1])
        if self._episode:
            peak, last = rows[-2:]
            for k, column in enumerate(values.T):
                now = column[-1]
                column[:] = hold_peaks(column, self._episode, peak[k], last[k])
                peak[k], last[k] = column[-1], now
        for lagged in rows[: self._order]:
            for k in range(values.shape[1]):
                values[:, k] = recur(lagged[k : k + 1], (1.0 - keep) * values[:, k], np.array([keep]))[1:]
            lagged[:] = values[-1]
        self.state.settled = settled
        return values

    def _settled(self, value: FloatArray) -> FloatArray:
        """Where each lag is, as an array of its own; at the start, at the value."""
        number = self._order + (2 if self._episode else 0)
        return np.tile(value, number) if self.state.settled is None else np.array(self.state.settled)


def hold_peaks(values: FloatArray, beyond: float, peak: float, last: float) -> FloatArray:
    """Signed peak so far of the episode that goes on, else of the last, shape (n,), in the unit of the values.

    An episode is a stretch `beyond` a size, to one side; `peak` and `last` are what is held and the value just before.
    """
    series = np.concatenate([[last], values])
    before, *sides = np.where(np.abs(series) > beyond, np.sign(series), 0.0).tolist()
    edges = np.flatnonzero(np.diff([before, *sides]))
    held = np.empty(len(values))
    for first, end in pairwise(dict.fromkeys((0, *edges.tolist(), len(values)))):
        side, so_far = sides[first], peak if first == 0 and sides[0] == before else 0.0
        if side:
            so_far = side * so_far
            held[first:end] = side * np.maximum.accumulate(np.maximum(side * values[first:end], so_far))
            peak = float(held[end - 1])
        else:
            held[first:end] = peak
    return held


def respond(
    values: FloatArray,
    step: float,
    lag_s: float,
    response_s: float,
    *,
    order: int = 1,
    course: Sequence[tuple[float, float]] = (),
    episode: float = 0.0,
) -> FloatArray:
    """Response to a whole drive's finite values, even in time, shape (n,) or (n, k), in their unit; see `Response`."""
    values = np.asarray(values, dtype=np.float64)
    if not len(values):
        return values.copy()
    response = Response(step, lag_s, response_s, order=order, course=course, episode=episode)
    return response.finish(values.reshape(len(values), -1)).reshape(values.shape)


def split_shift(steps: float) -> tuple[int, float]:
    """Row i of a series delayed by `steps` is ``(1 - share) * values[i + whole] + share * values[i + whole + 1]``.

    Gives `whole`, and `share` in [0, 1), the same for every row: rounding does not grow along the drive.
    """
    whole = math.floor(-steps)
    return whole, -steps - whole
