"""Speed profiles with limited jerk: every piece leads to the next, and the limits hold."""

from __future__ import annotations

from itertools import pairwise
from math import inf

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from xosc_lateral.world.player.actions.speed_profile import NoSolutionError, Piece, follow
from xosc_lateral.world.scenario.entity import Performance

LIMITS = Performance(100.0, 3.0, 5.0, 2.0, 4.0)


def assert_joined(rows: list[Piece]) -> None:
    """Speed and acceleration at the end of each piece are those that the next begins with."""
    for (t0, v0, a0, jerk), (t1, v1, a1, _) in pairwise(rows):
        dt = t1 - t0
        assert dt >= -1e-9
        assert v0 + a0 * dt + 0.5 * jerk * dt * dt == pytest.approx(v1, abs=1e-6)
        assert a0 + jerk * dt == pytest.approx(a1, abs=1e-6)


def single(
    speed: float, wanted: float, seconds: float, *, limits: Performance = LIMITS, acceleration: float = 0.0
) -> list[Piece]:
    slope = (wanted - speed) / seconds
    targets = [Piece(0.0, speed, slope), Piece(seconds, wanted, 0.0)]
    rows, why = follow(targets, acceleration, limits)
    assert not why
    return rows


def test_a_single_target_is_reached_in_time_by_three_pieces() -> None:
    """From 10 to 20 m/s in 10 s: jerk 2 up for t, steady, jerk -4 down for t / 2; the areas give the acceleration."""
    rows = single(10.0, 20.0, 10.0)
    assert_joined(rows)
    assert rows[0][3] == 2.0
    assert rows[-2][3] == -4.0
    assert rows[-1] == pytest.approx((10.0, 20.0, 0.0, 0.0))
    top = rows[1][2]
    # 10 = a (10 - a / 2 - a / 4) + a^2 / 4 + a^2 / 8
    assert top * 10.0 - 0.375 * top * top == pytest.approx(10.0)


def test_braking_uses_its_own_jerks() -> None:
    rows = single(30.0, 10.0, 12.0)
    assert_joined(rows)
    assert rows[0][3] == -4.0
    assert rows[-2][3] == 2.0
    assert rows[-1][1:] == pytest.approx((10.0, 0.0, 0.0))


def test_a_limit_of_acceleration_is_kept_and_takes_longer() -> None:
    rows = single(0.0, 20.0, 5.0)
    assert_joined(rows)
    assert max(row[2] for row in rows) == pytest.approx(3.0)
    assert rows[-1][0] > 5.0
    assert rows[-1][1] == 20.0


@given(st.floats(0.0, 60.0), st.floats(0.0, 60.0), st.floats(0.5, 60.0))
def test_any_single_target_keeps_its_limits(speed: float, wanted: float, seconds: float) -> None:
    assume(abs(wanted - speed) > 0.1)
    rows = single(speed, wanted, seconds)
    assert_joined(rows)
    assert rows[-1][1] == pytest.approx(wanted)
    assert rows[-1][2:] == (0.0, 0.0)
    assert all(-5.0 - 1e-9 <= acceleration <= 3.0 + 1e-9 for _, _, acceleration, _ in rows)
    assert all(jerk in (2.0, -4.0, 0.0) for *_, jerk in rows)


def test_a_target_without_limits_of_jerk_is_a_straight_line() -> None:
    rows = single(10.0, 20.0, 5.0, limits=Performance(inf, inf, inf, inf, inf))
    assert rows[1][2] == pytest.approx(2.0, abs=1e-5)
    assert rows[-1][0] == pytest.approx(5.0, abs=1e-4)


def test_several_targets_round_the_corners_between_their_lines() -> None:
    targets = [Piece(0.0, 10.0, 1.0), Piece(10.0, 20.0, -0.5), Piece(20.0, 15.0, 0.0)]
    rows, why = follow(targets, 0.0, LIMITS)
    assert not why
    assert_joined(rows)
    assert rows[0] == (0.0, 10.0, 0.0, 2.0)
    assert rows[-1][1:] == pytest.approx((15.0, 0.0, 0.0))
    steady = {round(acceleration, 9) for _, _, acceleration, jerk in rows if jerk == 0.0}
    assert {1.0, -0.5, 0.0} <= steady


def test_a_target_that_leaves_no_time_goes_on_in_straight_lines_and_says_so() -> None:
    targets = [Piece(0.0, 10.0, 2.9), Piece(0.2, 10.58, -4.9), Piece(0.4, 9.6, 0.0)]
    rows, why = follow(targets, 0.0, LIMITS)
    assert "leaves no time for the jerk" in why
    assert all(jerk == 0.0 for *_, jerk in rows[2:])


def test_an_acceleration_beyond_the_limits_has_no_profile() -> None:
    targets = [Piece(0.0, 10.0, 1.0), Piece(5.0, 15.0, 0.5), Piece(9.0, 17.0, 0.0)]
    with pytest.raises(NoSolutionError, match=r"the present acceleration of 6\.00 m/s2 is beyond the limits"):
        follow(targets, 6.0, LIMITS)


def test_one_target_alone_is_where_it_is() -> None:
    assert follow([Piece(1.0, 20.0, 0.0)], 0.0, LIMITS) == ([(1.0, 20.0, 0.0, 0.0)], "")
    assert follow([], 0.0, LIMITS) == ([], "")


@given(st.floats(-2.0, 2.0), st.floats(5.0, 30.0), st.floats(5.0, 30.0), st.floats(3.0, 30.0))
def test_a_present_acceleration_is_taken_along_or_refused(
    acceleration: float, speed: float, wanted: float, seconds: float
) -> None:
    assume(abs(wanted - speed) > 0.1)
    try:
        rows = single(speed, wanted, seconds, acceleration=acceleration)
    except NoSolutionError:
        return
    assert rows[0][2] == acceleration
    assert_joined(rows)
    assert rows[-1][1] == pytest.approx(wanted)


def test_an_acceleration_that_cannot_be_taken_back_in_time_is_refused() -> None:
    """From 12 m/s and -2 m/s2 to 11.5 m/s in 3 s: the last piece would have to begin after its end."""
    with pytest.raises(NoSolutionError, match="already beyond what is needed"):
        single(12.0, 11.5, 3.0, acceleration=-2.0)
