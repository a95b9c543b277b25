"""Planted lane changes come back: side, start, duration, shape; drifting is none, and turning back is one aborted."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from xosc_lateral.extras.recordings import plan as planning
from xosc_lateral.extras.recordings.recorded import SHAPES, LateralPlan, Transition, lateral_plan
from xosc_lateral.world.motion.nominal import EntityMotion, made_vehicle
from xosc_lateral.world.scenario.enums import DynamicsShape

WIDTH = 3.5
TIME = np.arange(0.0, 40.05, 0.1)


def recorded(y: np.ndarray, time: np.ndarray = TIME) -> EntityMotion:
    """A car at a lateral position [m] counted from the centre of the lane with number 0."""
    lanes = np.floor(y / WIDTH + 0.5)
    n = len(time)
    return EntityMotion.of(
        made_vehicle("a", 4.5, 1.8, 1.4), time, x=30.0 * time, y=y, road=np.zeros(n, dtype=np.int32),
        lane=-3 - lanes.astype(np.int32), s=30.0 * time, offset=y - WIDTH * lanes, lane_width=np.full(n, WIDTH),
        heading_relative=np.zeros(n),
    )  # fmt: skip


def sway(seed: int, rms: float = 0.2) -> np.ndarray:
    """A driver's slow movement. [m]"""
    rng = np.random.default_rng(seed)
    knots = np.arange(-10.0, 60.0, 4.0)
    return np.interp(
        TIME,
        np.arange(-2, 44, 0.5),
        np.convolve(
            np.interp(np.arange(-5, 47, 0.5), knots, rng.normal(0, 1.4 * rms, len(knots))), np.ones(13) / 13, "valid"
        ),
    )


def moved(start: float, duration: float, shape: DynamicsShape = DynamicsShape.SINUSOIDAL) -> np.ndarray:
    return SHAPES[shape](np.clip((TIME - start) / duration, 0.0, 1.0))


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("shape", list(SHAPES))
def test_a_played_lane_change_comes_back_to_the_digit(side, shape):
    plan = lateral_plan(recorded(side * WIDTH * moved(12.34, 4.5, shape)), 0.0)
    (one,) = plan.transitions
    assert plan.is_played
    assert (one.lanes, one.shape) == (side, shape)
    assert one.start == pytest.approx(12.34, abs=0.02)
    assert one.duration == pytest.approx(4.5, abs=0.04)
    assert one.level == pytest.approx(side * WIDTH, abs=1e-6)


def test_a_played_offset_is_a_maneuver_within_the_lane():
    plan = lateral_plan(recorded(0.3 - 0.8 * moved(10.0, 3.0)), 0.0)
    (one,) = plan.transitions
    assert plan.start == pytest.approx(0.3, abs=1e-3)
    assert (one.lanes, one.aborted) == (0, False)
    assert one.offset == pytest.approx(-0.5, abs=1e-3)


def test_lane_changes_of_drivers_are_found_when_they_begin_and_end():
    """Over 40 drivers: all found, none invented, both ends within half a second for nearly all."""
    ends = []
    for seed in range(40):
        rng = np.random.default_rng([7, seed])
        side, start, duration = rng.choice([-1, 1]), rng.uniform(8, 20), rng.uniform(4, 8)
        plan = lateral_plan(recorded(side * WIDTH * moved(start, duration) + sway(seed)), 0.0)
        changes = [one for one in plan.transitions if one.lanes]
        assert [one.lanes for one in changes] == [side], seed
        assert not plan.is_played
        ends.append((changes[0].start - start, changes[0].end - start - duration))
    errors = np.abs(np.array(ends))
    assert np.median(errors) < 0.25
    assert np.quantile(errors, 0.9) < 1.0


def test_drifting_over_a_marking_is_the_drivers_affair():
    assert lateral_plan(recorded(1.1 * np.sin(2 * np.pi * TIME / 60) + 0.01 * np.sin(TIME)), 0.0).transitions == ()


def test_a_lane_change_that_is_given_up_is_aborted():
    y = 2.4 * (moved(10.0, 3.0) - moved(14.0, 3.5)) + 0.3 * sway(1)
    out, back = lateral_plan(recorded(y), 0.0).transitions
    assert out.aborted
    assert back.aborted
    assert (out.lanes, back.lanes) == (0, 0)
    assert out.offset == pytest.approx(2.4, abs=0.3)
    assert back.level == 0.0
    assert out.start == pytest.approx(10.0, abs=0.7)
    assert back.end == pytest.approx(17.5, abs=0.9)


@pytest.mark.parametrize("side", [1, -1])
def test_a_change_that_crosses_with_the_side_only_is_aborted(side):
    """A car of 1.8 m in a lane of 3.5 m: its side crosses at 0.85 m, its middle stays in the lane at up to 1.5 m."""
    for seed in range(9):
        rng = np.random.default_rng([11, seed])
        height, start, out, back = rng.uniform((1.15, 8.0, 2.0, 2.5), (1.5, 16.0, 3.5, 5.0))
        stay = rng.uniform(0.0, 3.0)
        y = side * height * (moved(start, out) - moved(start + out + stay, back)) + 0.3 * sway(seed)
        plan = lateral_plan(recorded(y), 0.0)
        one, other = plan.transitions
        assert (one.aborted, other.aborted, one.lanes, other.lanes) == (True, True, 0, 0), seed
        assert one.offset == pytest.approx(side * height, abs=0.35), seed
        assert one.start == pytest.approx(start, abs=1.0), seed
        assert other.end == pytest.approx(start + out + stay + back, abs=1.6), seed
        assert np.sqrt(((plan.at(TIME) - y) ** 2).mean()) < 0.2, seed


def test_swaying_drivers_abort_nothing():
    assert not [seed for seed in range(200) if lateral_plan(recorded(sway(seed, 0.25)), 0.0).transitions]


def test_an_aborted_change_that_is_part_of_a_change_leaves_no_half():
    """Out over the marking, back a little, and then over: one lane change."""
    for pause in np.arange(0.0, 2.0, 0.25):
        y = 1.2 * moved(10.0, 2.0) - 0.5 * moved(12.0 + pause, 1.0) + (WIDTH - 0.7) * moved(13.0 + pause, 4.0)
        plan = lateral_plan(recorded(y + 0.3 * sway(4)), 0.0)
        assert [one.lanes for one in plan.transitions if one.lanes] == [1], pause
        assert len([one for one in plan.transitions if one.aborted]) in (0, 2), pause
        assert plan.at(TIME[-1:])[0] == pytest.approx(WIDTH, abs=0.5)


def test_two_lanes_in_one_movement_are_one_maneuver_and_with_a_rest_two():
    at_once = lateral_plan(recorded(2 * WIDTH * moved(10.0, 7.0) + sway(2)), 0.0).transitions
    assert [one.lanes for one in at_once] == [2]
    rested = lateral_plan(recorded(WIDTH * (moved(8.0, 5.0) + moved(16.0, 5.0)) + sway(2)), 0.0).transitions
    assert [one.lanes for one in rested] == [1, 1]


def test_a_track_that_begins_amid_a_lane_change_starts_where_it_is():
    late = TIME >= 12.0
    y = (WIDTH * moved(10.0, 5.0) + sway(3))[late]
    plan = lateral_plan(recorded(y, TIME[late]), 12.0)
    assert np.abs(plan.at(TIME[late]) - y).max() < 1.0
    assert all(one.start >= 12.0 for one in plan.transitions)


def test_maneuvers_never_overlap_and_none_begins_before_the_vehicle_is_there():
    for seed in range(10):
        rng = np.random.default_rng([9, seed])
        y = sum(WIDTH * rng.choice([-1, 1]) * moved(at, rng.uniform(2, 9)) for at in rng.uniform(0, 35, 5))
        plan = lateral_plan(recorded(y + sway(seed)), 0.5)
        edges = [0.5, *(edge for one in plan.transitions for edge in (one.start, one.end))]
        assert (np.diff(edges) >= -1e-6).all(), seed


def test_noise_of_the_positions_makes_no_lane_change_shorter() -> None:
    """40 of 4 to 8 s with 10 cm: each is found to half a second; their mean, known to 0.07 s, is not short by 1.3 s."""
    errors = []
    for seed in range(40):
        rng = np.random.default_rng([23, seed])
        start, duration = rng.uniform(10, 20), rng.uniform(4, 8)
        y = WIDTH * moved(start, duration) + 0.5 * sway(seed) + 0.1 * rng.normal(size=len(TIME))
        (change,) = (one for one in lateral_plan(recorded(y), 0.0).transitions if one.lanes)
        errors.append(change.duration - duration)
    assert abs(np.mean(errors)) < 0.25


@pytest.mark.parametrize(
    ("there_from", "begins"), [(0.0, 3.0), (100.0, 4.0 + planning.ENTRY_DELAY), (174.0, 3.0), (900.0, 3.0)]
)
def test_a_change_to_a_lane_that_is_yet_to_come_begins_where_it_is(
    monkeypatch: pytest.MonkeyPatch, there_from: float, begins: float
) -> None:
    """At 25 m/s from 3 s to 7 s, which are 75 m and 175 m; where it never comes in time, the change stays."""
    monkeypatch.setattr(planning, "_target", lambda *_: -2)
    time = np.arange(0.0, 20.0, 0.04)
    vehicle: Any = SimpleNamespace(time=time, road=np.zeros(len(time), dtype=np.int32), s=25.0 * time)
    network: Any = SimpleNamespace(has_lane_at=lambda road, lane, s: s >= there_from - 1e-6)
    change = Transition(3.0, 4.0, DynamicsShape.SINUSOIDAL, -1, 0.0, -WIDTH)
    (moved,) = planning._beside_lanes(LateralPlan(0.0, (change,), is_played=False), vehicle, network).transitions
    assert (moved.start, moved.end) == pytest.approx((begins, 7.0))
