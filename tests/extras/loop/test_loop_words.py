"""Findings in a driver's words: to which side he goes never hangs on the sign of a column."""

from __future__ import annotations

import pytest

from tests.kit.effects import made
from xosc_lateral.drivers.model.effects import Acts, Linear, Proximity, Saturating, Threshold
from xosc_lateral.extras.loop.loop_words import beside_words


def _words(*arguments: object) -> str:
    return beside_words(*arguments).replace("\N{NO-BREAK SPACE}", " ")  # type: ignore[arg-type]


def test_a_shift_beside_trucks_is_told_with_its_side_and_range() -> None:
    effect = made(Proximity, 0.22, column="right_distance", scale=40.0)
    assert _words(effect) == "moves 0.22 m left beside vehicles on his right, from 40 m on"
    assert _words(effect, 0.5).startswith("moves 0.22 ± 0.11 m left beside")
    flag = made(Linear, -0.1, column="truck_left")
    assert _words(flag) == "moves 0.10 m right beside trucks on his left"


@pytest.mark.parametrize("shift", [0.2, -0.2])
def test_a_signed_or_rising_distance_reads_the_right_way_round(shift: float) -> None:
    """The further away, the less of the shift: the coefficient's sign is the opposite of the shift's."""
    side = "left" if shift > 0 else "right"
    steps = made(Threshold, -shift, column="right_distance", at=25.0, above=True, jump=True)
    levels_off = made(Saturating, -shift, column="right_distance", middle=20.0, scale=20.0)
    falls = made(Linear, -shift / 100.0, column="right_distance")
    for effect in (steps, levels_off, falls):
        assert f" m {side} beside vehicles on his right" in _words(effect)
    assert _words(steps) == f"moves 0.20 m {side} beside vehicles on his right, from 25 m on"


def test_only_shifts_that_others_make_are_told_so() -> None:
    assert not _words(made(Linear, 0.1, column="curvature"))
    assert not _words(made(Proximity, 0.1, acts=Acts.SPREAD, column="right_distance", scale=40.0))
