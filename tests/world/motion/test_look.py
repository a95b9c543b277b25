"""What is planted in a vehicle's motion is seen, with its time and size; what is as it was is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.kit.motion import drive, entity, two_roads
from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.track import Track
from xosc_lateral.world.motion.look import _Both, compare_tracks, rests_beside

STEP = 0.02
TIME = STEP * np.arange(1000)


def track(speed: FloatArray, aside: FloatArray, turned: FloatArray | float = 0.0, bend: float = 0.0) -> Track:
    """Along a circle of this curvature [1/m], so far to its left [m], turned against its way. [rad]"""
    way = np.concatenate(([0.0], np.cumsum(0.5 * STEP * (speed[1:] + speed[:-1]))))
    course = bend * way
    x, y = (np.sin(course) / bend, (1.0 - np.cos(course)) / bend) if bend else (way, np.zeros(len(way)))
    slope = np.arctan2(np.gradient(aside, STEP), np.maximum(speed, 1.0))
    columns = {
        "x": x - aside * np.sin(course), "y": y + aside * np.cos(course), "speed": speed,
        "heading": course + slope + turned,
    }  # fmt: skip
    return Track("A", TIME, columns, np.empty(0, dtype=np.intp))


EVEN, NONE = np.full(len(TIME), 20.0), np.zeros(len(TIME))
SWAYING = 0.3 * np.sin(0.8 * TIME)
STOPPING = np.clip(np.abs(TIME - 10.0) - 2.0, 0.0, 5.0)
LATER = (TIME >= 10.0).astype(np.float64)


@pytest.mark.parametrize("bend", [0.0, 0.02])
@pytest.mark.parametrize("speed", [EVEN, STOPPING], ids=["even", "stopping"])
def test_a_driver_s_movement_is_no_finding(speed: FloatArray, bend: float) -> None:
    moves = SWAYING if speed is EVEN else 0.3 * np.sin(0.04 * np.cumsum(speed) * STEP)
    source = track(speed, NONE, bend=bend)
    assert not list(compare_tracks(source, source))
    assert not list(compare_tracks(source, track(speed, moves, bend=bend)))


@pytest.mark.parametrize(
    ("kind", "words", "size", "speed", "change"),
    [
        ("corner", "40 mrad in a frame", 0.04, EVEN, {"turned": 0.04 * LATER}),
        ("corner", "m/s2 sideways", 5.0 * (np.sin(0.5) / 0.5) ** 2, EVEN, {"aside": 0.05 * np.sin(10.0 * TIME)}),
        ("heading", "is turned by 4.0 degrees", 0.0698, EVEN, {"turned": 0.00698 * TIME.clip(0.0, 10.0)}),
        ("elsewhere", "2.00 m elsewhere along the road", 2.0, EVEN, {"speed": EVEN + 0.2 * LATER}),
        ("creeps", "moves by 20 mm while it stands", 0.02, STOPPING, {"aside": 0.02 * np.clip(TIME - 9.0, 0.0, 1.0)}),
        ("turns at rest", "turns by 20 mrad while it stands", 0.02, STOPPING, {"turned": 0.02 * LATER}),
    ],
)  # fmt: skip
def test_what_is_planted_is_found_with_its_size(
    kind: str, words: str, size: float, speed: FloatArray, change: dict[str, FloatArray]
) -> None:
    made = {"speed": speed, "aside": NONE, **change}
    found = {one.kind: one for one in compare_tracks(track(speed, NONE), track(**made))}
    assert words in found[kind].what and found[kind].size == pytest.approx(size, rel=0.06)
    assert words in str(found[kind].note("nominal")) and "(run: nominal)" in str(found[kind].note("nominal"))


def test_a_place_is_not_judged_by_the_strict_limit_after_an_event_has_moved() -> None:
    source, late = track(EVEN, NONE), track(EVEN + 0.12 * LATER, NONE)
    assert [one.kind for one in compare_tracks(source, late)] == ["elsewhere"]
    assert not list(compare_tracks(source, late, shifted=10.0))


@pytest.mark.parametrize(
    ("faster", "shifted", "is_meaning"), [(0.4, np.inf, True), (0.12, np.inf, False), (0.4, 10.0, False)]
)
def test_who_is_far_elsewhere_though_nothing_came_at_another_time_has_another_meaning(
    faster: float, shifted: float, is_meaning: bool
) -> None:
    """In 10 s 4.0 or 1.2 m farther: the first is more than an event that comes a little later would explain."""
    (found,) = compare_tracks(track(EVEN, NONE), track(EVEN + faster * LATER, NONE), shifted)
    assert (found.kind, found.is_meaning) == ("elsewhere", is_meaning)
    assert found.size == pytest.approx(10.0 * faster, rel=0.02)


def test_who_drives_beside_the_middle_of_a_bend_is_where_his_speed_takes_him() -> None:
    """0.4 m to the inside of a bend of 50 m his way is 3.2 m in 400 m shorter: no finding; on a straight it is one."""
    inside, sooner = np.full(len(TIME), 0.4), EVEN / 0.992
    assert not [
        one
        for one in compare_tracks(track(EVEN, NONE, bend=0.02), track(sooner, inside, bend=0.02))
        if one.kind == "elsewhere"
    ]
    assert "elsewhere" in {one.kind for one in compare_tracks(track(EVEN, NONE), track(sooner, inside))}


def test_who_rests_beside_the_middle_is_told_from_when_on(tmp_path: Path) -> None:
    drives = drive(two_roads(tmp_path), entity(), start=0.0)
    offset = 0.2 * np.sin(0.5 * drives.time)
    assert not list(rests_beside(drives.having(offset=offset)))
    held = np.where(
        drives.time < 0.25 * drives.time[-1], offset, offset[np.searchsorted(drives.time, 0.25 * drives.time[-1])]
    )
    (found,) = rests_beside(drives.having(offset=held))
    assert found.size == pytest.approx(0.75, abs=0.05) and found.time == pytest.approx(0.25 * drives.time[-1], abs=1.0)


@pytest.mark.parametrize("time", [0.0, 0.02, 0.1, 0.3, 30.0])
def test_the_largest_around_is_that_of_all_rows_within_a_time(time: float) -> None:
    both, values = _Both(track(EVEN, NONE), track(EVEN, NONE)), np.random.default_rng(4).normal(size=len(TIME))
    reach = round(time / STEP)
    expected = [values[max(k - reach, 0) : k + reach + 1].max() for k in range(len(values))]
    np.testing.assert_array_equal(both.around(values, time), expected)
