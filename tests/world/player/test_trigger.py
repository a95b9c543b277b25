"""Triggers against timelines worked out by hand."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from xosc_lateral.world.player.storyboard import RunningCondition, RunningTrigger, Watch
from xosc_lateral.world.scenario.enums import ConditionEdge

NONE, RISING, FALLING, EITHER = (
    ConditionEdge.NONE,
    ConditionEdge.RISING,
    ConditionEdge.FALLING,
    ConditionEdge.RISING_OR_FALLING,
)


class Signal:
    """A condition whose values a test gives, one for each evaluation."""

    def __init__(self, values: Iterable[int]) -> None:
        self.values = iter(values)
        self.looks = 0

    def __call__(self) -> bool:
        self.looks += 1
        return bool(next(self.values))


def fired(values: str, edge: ConditionEdge, delay: float = 0.0, step: float = 1.0) -> str:
    """Values of a condition, one digit per second -> whether it holds."""
    condition = RunningCondition(Signal(int(v) for v in values), edge, delay)
    return "".join(str(int(condition.evaluate(k * step))) for k in range(len(values)))


@pytest.mark.parametrize(
    ("edge", "values", "expected"),
    [
        (NONE, "0110010", "0110010"),
        (RISING, "0110010", "0100010"),
        (FALLING, "0110010", "0001001"),
        (EITHER, "0110010", "0101011"),
        (RISING, "1100100", "0000100"),
        (FALLING, "0001100", "0000010"),
        (EITHER, "1000001", "0100001"),
    ],
)
def test_edges_and_the_first_look_gives_none(edge: ConditionEdge, values: str, expected: str) -> None:
    assert fired(values, edge) == expected


@pytest.mark.parametrize(
    ("edge", "values", "delay", "expected"),
    [
        (NONE, "0011100000", 2.0, "0000111000"),
        (RISING, "0011100000", 3.0, "0000010000"),
        (FALLING, "0011100000", 1.0, "0000001000"),
        (NONE, "1111", 2.0, "0011"),
        (RISING, "0101010000", 2.0, "0001010100"),
    ],
)
def test_a_delay_looks_at_the_past(edge: ConditionEdge, values: str, delay: float, expected: str) -> None:
    assert fired(values, edge, delay) == expected


def test_a_delayed_pulse_between_two_looks_is_not_lost() -> None:
    condition = RunningCondition(Signal([0, 1, 0, 0, 0]), RISING, 1.0)
    seen = [condition.evaluate(t) for t in (0.0, 0.4, 0.8, 1.2, 1.9)]
    assert seen == [False, False, False, False, True]


def test_at_the_same_time_again_the_new_value_counts() -> None:
    condition = RunningCondition(Signal([0, 1, 1]), RISING, 0.0)
    assert [condition.evaluate(t) for t in (0.0, 0.0, 0.02)] == [False, True, False]


def condition(values: Iterable[int], edge: ConditionEdge = NONE, delay: float = 0.0) -> tuple[RunningCondition, Signal]:
    signal = Signal(values)
    return RunningCondition(signal, edge, delay), signal


def test_a_group_stops_at_the_first_false_condition_unless_a_later_one_is_delayed() -> None:
    first, _ = condition([0, 0])
    plain, plain_signal = condition([1, 1])
    delayed, delayed_signal = condition([1, 1], delay=5.0)
    trigger = RunningTrigger(((first, plain, delayed),), when_empty=True)
    assert [trigger.evaluate(t) for t in (0.0, 1.0)] == [False, False]
    assert (plain_signal.looks, delayed_signal.looks) == (0, 2)


def test_any_group_fires_and_all_are_looked_at() -> None:
    a, _ = condition([1])
    b, b_signal = condition([0])
    assert RunningTrigger(((a,), (b,)), when_empty=True).evaluate(0.0)
    assert b_signal.looks == 1


def test_empty_triggers_and_groups() -> None:
    assert RunningTrigger((), when_empty=True).evaluate(0.0)
    assert not RunningTrigger((), when_empty=False).evaluate(0.0)
    assert not RunningTrigger(((),), when_empty=True).evaluate(0.0)


def test_after_firing_the_next_look_gives_no_edge() -> None:
    rising, _ = condition([0, 1, 1, 0, 1], RISING)
    trigger = RunningTrigger(((rising,),), when_empty=True)
    assert [trigger.evaluate(float(t)) for t in range(5)] == [False, True, False, False, True]


def test_a_reset_forgets_what_was_delayed() -> None:
    delayed, _ = condition([1, 0, 0, 0], delay=2.0)
    trigger = RunningTrigger(((delayed,),), when_empty=True)
    trigger.evaluate(0.0)
    trigger.reset()
    assert [trigger.evaluate(t) for t in (1.0, 2.0, 3.0)] == [False, False, False]


class Told(Watch):
    """A watch that is told of changes, and counts how often it is looked at."""

    def __init__(self) -> None:
        self.value, self.looks = False, 0

    def tell(self, value: bool) -> None:
        self.value, self.is_settled = value, False
        if self.wake is not None:
            self.wake()

    def __call__(self) -> bool:
        self.looks += 1
        self.is_settled = True
        return self.value


@pytest.mark.parametrize("seed", range(8))
def test_a_trigger_that_rests_fires_when_one_that_is_always_looked_at_does(seed: int) -> None:
    rng = np.random.default_rng(seed)
    delays = rng.choice([0.0, 0.3, 1.0], size=(2, 2))
    pairs = [[[Told() for _ in range(2)] for _ in range(2)] for _ in range(2)]
    resting, looking = (
        RunningTrigger(
            tuple(
                tuple(RunningCondition(w, NONE, d) for w, d in zip(group, row, strict=True))
                for group, row in zip(watches, delays.tolist(), strict=True)
            ),
            when_empty=True,
        )
        for watches in pairs
    )
    looking._may_rest = False
    for frame in range(400):
        for row, column in np.argwhere(rng.random((2, 2)) < 0.03).tolist():
            value = bool(rng.random() < 0.2)
            for watches in pairs:
                watches[row][column].tell(value)
        assert resting.evaluate(0.1 * frame) == looking.evaluate(0.1 * frame)
    counts = [sum(watch.looks for group in watches for watch in group) for watches in pairs]
    assert counts[0] < 0.9 * counts[1]
