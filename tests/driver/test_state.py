"""State of a random process as JSON."""

from __future__ import annotations

import json

import numpy as np
import pytest

from xosc_lateral.driver.pace import Paced
from xosc_lateral.driver.state import restore, state_of


class Process:
    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.seen = np.empty((0, 2))
        self.flags = (True, None, "x", 3)
        self.pace = Paced(lambda n: self.rng.random(n))

    def draw(self) -> np.ndarray:
        return self.pace.take(5, np.full(5, 0.7))


def test_a_process_goes_on_bit_by_bit() -> None:
    process, other = Process(1), Process(2)
    process.draw()
    process.flags = (False, None, "y", 4)
    restore(other, json.loads(json.dumps(state_of(process))))
    np.testing.assert_array_equal(other.draw(), process.draw())
    assert other.flags == (False, None, "y", 4)
    assert other.seen.shape == (0, 2)


def test_what_can_not_be_saved_is_named() -> None:
    process = Process(1)
    process.other = {1, 2}  # type: ignore[attr-defined]
    with pytest.raises(TypeError, match="other: a set can't be saved"):
        state_of(process)
