"""What follows from the car's own movement is told from what moves it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from xosc_lateral.extras.loop.columns import Assigned, Column, Feedback, Role, Values, find_feedback, roles_of
from xosc_lateral.extras.loop.timeline import Timeline

STEP = 0.2
N = round(3000.0 / STEP)


def low_passed(seconds: float, rng: np.random.Generator, n: int = N) -> np.ndarray:
    keep = np.exp(-STEP / seconds)
    walk = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.normal(size=n))
    return np.asarray(walk)


def timeline(offset: np.ndarray, valid: np.ndarray | None = None, **context: np.ndarray) -> Timeline:
    n = len(offset)
    valid = np.ones(n, dtype=bool) if valid is None else valid
    return Timeline(
        ("d",), np.zeros(n, dtype=np.intp), STEP * np.arange(n), np.where(valid, offset, 0.0), valid, np.full(n, 3.5),
        context, frozenset(),
    )  # fmt: skip


def driven(seed: int) -> tuple[np.ndarray, np.random.Generator]:
    """A movement of tenths of a metre that lasts seconds."""
    rng = np.random.default_rng(seed)
    return 0.15 * low_passed(6.0, rng) + 0.05 * low_passed(1.0, rng), rng


def feedback(offset: np.ndarray, values: np.ndarray, kind: Values = Values.NUMBER) -> Feedback | None:
    found = find_feedback(timeline(offset, x=values), [Column("x", kind, False)])
    return found[0] if found else None


@pytest.mark.parametrize("seed", [21, 22, 23])
def test_a_torque_that_keeps_the_lane_follows_from_the_offset(seed: int) -> None:
    offset, rng = driven(seed)
    late = np.concatenate([np.zeros(1), offset[:-1]])
    found = feedback(offset, -2.0 * late + 0.05 * rng.normal(size=N))
    assert found is not None
    assert not found.doubtful
    assert found.predicted_share > 0.5


@pytest.mark.parametrize("seed", [24, 25])
def test_a_heading_follows_from_the_lateral_speed(seed: int) -> None:
    offset, rng = driven(seed)
    found = feedback(offset, np.gradient(offset, STEP) / 30.0 + 1e-4 * rng.normal(size=N))
    assert found is not None
    assert (found.of, found.doubtful) == ("lateral speed", False)
    assert found.coherence > 0.5


def test_a_distance_to_the_nearer_marking_follows_from_the_offset_s_size() -> None:
    offset, _ = driven(26)
    found = feedback(offset, 1.75 - np.abs(offset - np.median(offset)))
    assert found is not None
    assert found.of == "size of the offset"


@pytest.mark.parametrize("seed", [31, 32, 33])
@pytest.mark.parametrize("size", [0.06, 0.2])
def test_what_moves_the_car_slowly_does_not_follow_from_it(seed: int, size: float) -> None:
    """By 0.2 and 0.7 m between its 5 % and 95 % quantiles; answered in 2 s: fast movement has little of it."""
    offset, rng = driven(seed)
    cause = low_passed(20.0, rng)
    keep = np.exp(-STEP / 2.0)
    assert feedback(offset + size * lfilter([1.0 - keep], [1.0, -keep], cause), cause) is None


@pytest.mark.parametrize("seed", [41, 42, 43])
def test_what_has_nothing_to_do_with_the_car_does_not_follow_from_it(seed: int) -> None:
    offset, rng = driven(seed)
    columns = {
        "slow": low_passed(60.0, rng),
        "fast": rng.normal(size=N),
        "switch": (low_passed(10.0, rng) > 1).astype(float),
    }
    kinds = {"slow": Values.NUMBER, "fast": Values.NUMBER, "switch": Values.SWITCH}
    found = find_feedback(timeline(offset, **columns), [Column(name, kind, False) for name, kind in kinds.items()])
    assert not found


def test_gaps_and_missing_values_are_no_evidence() -> None:
    offset, rng = driven(51)
    column = low_passed(20.0, rng)
    column[rng.random(N) < 0.05] = np.nan
    valid = np.ones(N, dtype=bool)
    valid[4000:5000] = False
    assert not find_feedback(timeline(offset, valid, x=column), [Column("x", Values.NUMBER, True)])


def test_a_direction_that_turns_by_itself_is_no_feedback() -> None:
    offset, rng = driven(52)
    assert feedback(offset, 2.0 * low_passed(30.0, rng) % 3.0, Values.ANGLE) is None


def test_what_jumps_like_an_angle_may_follow_too() -> None:
    """A torque that keeps the lane changes its sign at each lane change."""
    offset, rng = driven(52)
    found = feedback(offset, -2.0 * offset + 0.05 * rng.normal(size=N), Values.ANGLE)
    assert found is not None
    assert not found.doubtful


@pytest.mark.parametrize("seed", [54, 55])
def test_an_activity_over_seconds_follows_from_how_fast_the_car_moves(seed: int) -> None:
    """As a system reports it that watches a driver, or its own interventions."""
    offset, rng = driven(seed)
    keep = np.exp(-STEP / 3.0)
    activity = lfilter([1.0 - keep], [1.0, -keep], np.abs(np.gradient(offset, STEP)))
    found = feedback(offset, activity + 0.1 * activity.std() * low_passed(2.0, rng))
    assert found is not None
    assert (found.of, found.doubtful) == ("size of the lateral speed", False)


@pytest.mark.parametrize("seed", [56, 57])
def test_what_makes_a_car_restless_does_not_follow_from_it(seed: int) -> None:
    offset, rng = driven(seed)
    cause = low_passed(20.0, rng)
    louder = lfilter([1.0], [1.0, -np.exp(-STEP / 2.0)], 0.05 * np.exp(0.5 * cause) * rng.normal(size=N))
    assert feedback(offset + louder, cause) is None


def test_too_short_a_drive_says_nothing() -> None:
    offset, _ = driven(53)
    short = offset[: round(12.0 / STEP)]
    assert not find_feedback(timeline(short, x=-short), [Column("x", Values.NUMBER, False)])


@pytest.mark.parametrize("seed", [61, 62, 63, 64])
def test_runs_of_seconds_tell_too(seed: int) -> None:
    """A phone's acceleration, half of it the car's, and its speed, over ten minutes in runs of 15 s."""
    offset, rng = driven(seed)
    seconds = np.arange(N) * STEP
    valid = (seconds < 750.0) & (seconds % 18.75 < 15.0)
    acceleration = np.gradient(np.gradient(offset, STEP), STEP)
    acceleration += 1.0 * acceleration.std() * rng.normal(size=N)
    columns = [Column("acceleration", Values.NUMBER, False), Column("speed", Values.NUMBER, False)]
    found = find_feedback(timeline(offset, valid, acceleration=acceleration, speed=low_passed(30.0, rng)), columns)
    assert [one.column for one in found] == ["acceleration"]


@pytest.mark.parametrize("seed", range(70, 78))
def test_runs_of_seconds_bar_no_cause(seed: int) -> None:
    offset, rng = driven(seed)
    seconds = np.arange(N) * STEP
    valid = (seconds < 750.0) & (seconds % 18.75 < 15.0)
    cause = low_passed(20.0, rng)
    keep = np.exp(-STEP / 2.0)
    moved = offset + 0.1 * lfilter([1.0 - keep], [1.0, -keep], cause)
    assert not find_feedback(timeline(moved, valid, x=cause), [Column("x", Values.NUMBER, False)])


def warning(offset: np.ndarray, on: float, off: float) -> np.ndarray:
    """1 from `on` metres away until it is nearer than `off` metres."""
    state, out = False, np.zeros(len(offset))
    for row, distance in enumerate(np.abs(offset)):
        state = distance > (off if state else on)
        out[row] = state
    return out


@pytest.mark.parametrize("seed", [81, 82, 83])
@pytest.mark.parametrize("hysteresis", [0.0, 0.06])
def test_a_warning_is_a_function_of_the_present_offset(seed: int, hysteresis: float) -> None:
    offset, _ = driven(seed)
    found = feedback(offset, warning(offset, 0.3, 0.3 - hysteresis), Values.SWITCH)
    assert found is not None
    assert (found.of, found.doubtful) == ("offset", False)
    assert found.function > 0.5


@pytest.mark.parametrize("seed", [84, 85, 86])
def test_a_switch_that_moves_the_car_is_no_function_of_where_it_is(seed: int) -> None:
    offset, rng = driven(seed)
    switch = (low_passed(15.0, rng) > 0.8).astype(float)
    keep = np.exp(-STEP / 1.5)
    assert feedback(offset + 0.3 * lfilter([1.0 - keep], [1.0, -keep], switch), switch, Values.SWITCH) is None


def test_declared_road_is_never_dismissed_and_a_name_alone_only_if_both_marks_are_strong() -> None:
    offset, rng = driven(87)
    columns = {"curvature": -2.0 * offset + 0.05 * rng.normal(size=N)}
    kinds = [Column("curvature", Values.NUMBER, False)]
    by_name = {"curvature": Assigned("curvature", Role.ROAD, "name")}
    declared = {"curvature": Assigned("curvature", Role.ROAD, "declared")}
    assert find_feedback(timeline(offset, **columns), kinds, by_name)
    assert not find_feedback(timeline(offset, **columns), kinds, declared)


@pytest.mark.parametrize("seed", [88, 89, 90, 91])
def test_a_bend_that_is_answered_before_it_comes_stays_a_cause(seed: int) -> None:
    """The car is at its place a second before the bend is: what it does predicts the column."""
    offset, rng = driven(seed)
    bend = lfilter(*butter(2, 0.1, fs=1.0 / STEP), low_passed(8.0, rng))
    moved = offset + 0.5 * np.roll(bend, -round(1.0 / STEP))
    by_name = {"curvature": Assigned("curvature", Role.ROAD, "name")}
    assert not find_feedback(timeline(moved, curvature=bend), [Column("curvature", Values.NUMBER, False)], by_name)


def bends(rng: np.random.Generator) -> np.ndarray:
    """Bends of 250 m to 1 km radius, 5 to 15 s long, 10 to 40 s apart. [1/m]"""
    curvature, at = np.zeros(N), 0
    while at < N:
        gap, length = (round(rng.uniform(*seconds) / STEP) for seconds in ((10.0, 40.0), (5.0, 15.0)))
        inside = curvature[at + gap : at + gap + length]
        inside[:] = rng.choice([-1.0, 1.0]) * rng.uniform(0.001, 0.004) * np.hanning(len(inside) + 2)[1:-1]
        at += gap + length
    return curvature


@pytest.mark.parametrize("seed", range(50, 58))
@pytest.mark.parametrize(("size", "noise", "response"), [(100.0, 0.05, 0.5), (200.0, 0.03, 0.3)])
def test_bends_seen_ahead_are_no_consequence_and_the_car_s_own_turning_is(
    seed: int, size: float, noise: float, response: float
) -> None:
    """A driver who looks 1.5 s ahead moves as if he predicted the bends, by 0.4 m and more."""
    rng = np.random.default_rng(seed)
    curvature, keep = bends(rng), np.exp(-STEP / response)
    ahead = np.roll(curvature, -round(1.5 / STEP))
    offset = size * lfilter([1.0 - keep], [1.0, -keep], ahead) + noise * low_passed(5.0, rng)
    turning = np.gradient(np.gradient(offset, STEP), STEP)
    columns = {
        "curvature": curvature,
        "yaw_rate": 30.0 * curvature + turning / 30.0 + 0.002 * rng.normal(size=N),
        "lateral_acceleration": 900.0 * curvature + turning + 0.05 * rng.normal(size=N),
        "steering_wheel_angle": 4e4 * curvature + 40.0 * turning + 0.5 * rng.normal(size=N),
        "lane_place": offset + 0.01 * rng.normal(size=N),
        "yaw_as_road": 30.0 * curvature + turning / 30.0 + 0.002 * rng.normal(size=N),
    }
    line = timeline(offset, **columns)
    known = [Column(name, Values.NUMBER, False) for name in columns]
    declared = {"yaw_as_road": "road"}
    dismissed = {one.column for one in find_feedback(line, known, roles_of(line, columns, declared))}
    assert dismissed == {"yaw_rate", "lateral_acceleration", "steering_wheel_angle", "lane_place"}
