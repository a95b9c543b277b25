"""A column effect's response row by row, as contexts come in."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import ColumnEffect, EffectTerms
from xosc_lateral.driver.stream_state import ResponseStreamState

FloatArray = NDArray[np.float64]


class ResponseStream:
    """A driver's response to one effect's columns, row by row."""

    def __init__(self, effect: ColumnEffect, step: float) -> None:
        self.effect = effect
        self._response = effect.response_in_blocks(step)
        self._ready: deque[FloatArray] = deque()
        self._drop = 0

    @property
    def ahead(self) -> int:
        """Rows that the driver looks ahead."""
        return self._response.ahead

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
