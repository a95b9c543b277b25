"""Which events start when: timelines worked out by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.kit.stage import (
    Stage,
    after,
    by_lanes,
    entity,
    event,
    lane_change,
    maneuvers,
    on_lane,
    row,
    speed,
    start_of,
    state_of,
    teleport,
    time_is,
    to_lane,
    when,
)
from xosc_lateral.workflows.conversion.load import Played


def starts(played: Played, name: str) -> list[float]:
    """All start times of an event's first action. [s]"""
    return [round(a.start, 6) for a in played.motion.actions if a.path[-1:] == (f"{name}-0",)]


def ends(played: Played, name: str) -> list[float | None]:
    found = [a.end for a in played.motion.actions if a.path[-1:] == (f"{name}-0",)]
    return [None if end is None else round(end, 6) for end in found]


def test_an_event_starts_in_the_frame_whose_start_fulfils_its_trigger(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(maneuvers(event(speed(30.0), trigger=after(1.0))))
    motion = entity(played)
    assert starts(played, "event") == [1.0]
    assert motion.speed[row(motion, 1.0)] == 20.0
    assert motion.speed[row(motion, 1.02)] == 30.0
    np.testing.assert_allclose(np.diff(motion.x), motion.speed[1:] * 0.02, atol=1e-9)


def test_the_run_ends_with_the_row_whose_time_fulfils_the_stop_trigger(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(last=3.0)
    assert entity(played).time[-1] == pytest.approx(3.0)
    assert played.motion.ended_by == "stop trigger"


def test_a_run_without_an_end_stops_at_the_time_limit_and_says_so(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(last=1e6, time_limit=5.0)
    assert entity(played).time[-1] == pytest.approx(5.0)
    assert played.motion.ended_by == "time limit"
    assert "time limit of 5 s" in str(played.motion.cut_off)


@pytest.mark.parametrize("end", [100.0, pytest.param(3000.0, marks=pytest.mark.slow)])
def test_a_stop_trigger_counts_for_up_to_an_hour(tmp_path: Path, end: float) -> None:
    start = {"Ego": teleport(on_lane(-1, 10.0)) + speed(0.01)}
    motion = Stage(tmp_path).play(start=start, last=end, time_limit=None).motion
    assert (motion.ended_by, motion.end_time, motion.cut_off) == ("stop trigger", pytest.approx(end), None)


def test_without_an_end_a_run_is_cut_off_after_a_minute_only_if_something_is_still_to_come(tmp_path: Path) -> None:
    empty = when()
    done = Stage(tmp_path).play(maneuvers(event(speed(30.0))), stop=empty, time_limit=None, step=0.5).motion
    waits = (
        Stage(tmp_path)
        .play(maneuvers(event(speed(30.0), trigger=after(70.0))), stop=empty, time_limit=None, step=0.5)
        .motion
    )
    assert (done.end_time, done.cut_off) == (60.0, None)
    assert waits.end_time == 60.0 and "time limit of 60 s" in str(waits.cut_off)


def test_act_event_and_action_start_in_one_frame(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(maneuvers(event(speed(30.0))), act_trigger=after(2.0))
    assert starts(played, "event") == [2.0]


def test_a_stopped_act_ends_its_actions(tmp_path: Path) -> None:
    group = maneuvers(event(speed(40.0, "linear", over=10.0), trigger=after(1.0)))
    played = Stage(tmp_path).play(group, act_stop=after(3.0))
    assert ends(played, "event") == [3.0]
    assert entity(played).speed[-1] == pytest.approx(24.0)


def test_an_end_is_seen_one_frame_later(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(
        maneuvers(event(speed(30.0, "linear", over=2.0), name="first", trigger=after(1.0)), name="a"),
        maneuvers(event(speed(10.0), name="second", trigger=when(state_of("first", "completeState"))), name="b"),
    )
    assert ends(played, "first") == [3.0]
    assert starts(played, "second") == [3.0]
    motion = entity(played)
    assert motion.speed[row(motion, 3.0)] == 30.0
    assert motion.speed[row(motion, 3.02)] == 10.0


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        ("standbyState", [0.0]),
        ("startTransition", [1.0]),
        ("runningState", [1.0]),
        ("endTransition", [3.0]),
        ("completeState", [3.0]),
        ("stopTransition", []),
    ],
)
def test_states_and_transitions_of_an_event(tmp_path: Path, state: str, expected: list[float]) -> None:
    played = Stage(tmp_path).play(
        maneuvers(event(speed(30.0, "linear", over=2.0), name="first", trigger=after(1.0)), name="a"),
        maneuvers(event(lane_change(to_lane(-2)), name="second", trigger=when(state_of("first", state))), name="b"),
    )
    assert starts(played, "second") == expected


def test_a_story_element_is_found_by_the_end_of_its_path(tmp_path: Path) -> None:
    first = event(speed(30.0), name="same", trigger=after(1.0))
    other = event(lane_change(to_lane(-2)), name="same", trigger=after(4.0))
    third = event(speed(5.0), name="third", trigger=when(state_of("b-maneuver::same", "startTransition")))
    played = Stage(tmp_path).play(maneuvers(first, name="a"), maneuvers(other, name="b"), maneuvers(third, name="c"))
    assert starts(played, "third") == [4.0]


def test_an_element_that_is_not_there_is_named(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(maneuvers(event(speed(5.0), trigger=when(state_of("nowhere", "runningState")))))
    assert starts(played, "event") == []
    assert any("nowhere" in note.what for note in played.motion.notes)


# ---- priorities ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("priority", "minor", "second", "first_ends"),
    [("parallel", 2, [2.0], 3.0), ("override", 2, [2.0], 2.0), ("overwrite", 0, [2.0], 2.0), ("skip", 2, [3.0], 3.0)],
)
def test_priorities_within_a_maneuver(
    tmp_path: Path, priority: str, minor: int, second: list[float], first_ends: float
) -> None:
    played = Stage(tmp_path).play(
        maneuvers(
            event(speed(30.0, "linear", over=2.0), name="first", trigger=after(1.0)),
            event(lane_change(to_lane(-2)), name="second", trigger=after(2.0), priority=priority),
        ),
        minor=minor,
    )
    assert starts(played, "second") == second
    assert ends(played, "first") == [first_ends]


def test_an_action_of_the_same_domain_ends_the_running_one_in_whatever_maneuver(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(
        maneuvers(event(speed(40.0, "linear", over=10.0), name="first", trigger=after(1.0)), name="a"),
        maneuvers(event(speed(10.0), name="second", trigger=after(2.0)), name="b"),
        maneuvers(event(lane_change(to_lane(-2)), name="third", trigger=after(1.5)), name="c"),
    )
    assert ends(played, "first") == [2.0]
    assert ends(played, "third") == [5.5]
    assert entity(played).speed[-1] == 10.0


# ---- repeats ---------------------------------------------------------------------------------------------------------
def test_an_event_runs_as_often_as_it_may_and_ignores_its_trigger_while_it_runs(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(
        maneuvers(event(speed(30.0, "linear", over=1.0), trigger=after(1.0), count=3)), last=10.0
    )
    assert starts(played, "event") == [1.0, 2.0, 3.0]


def test_an_edge_is_needed_anew_for_each_run(tmp_path: Path) -> None:
    pulse = when(time_is(1.0, edge="rising"))
    played = Stage(tmp_path).play(maneuvers(event(speed(30.0), trigger=pulse, count=3)))
    assert starts(played, "event") == [1.0]


def test_a_group_runs_again_with_all_its_events(tmp_path: Path) -> None:
    a = event(speed(30.0, "linear", over=1.0), name="a", trigger=after(1.0))
    b = event(lane_change(by_lanes(1), over=2.0), name="b", trigger=when(state_of("a", "completeState")))
    played = Stage(tmp_path).play(maneuvers(a, b, count=2), start={"Ego": teleport(on_lane(2, 900.0)) + speed(20.0)})
    assert starts(played, "a") == [1.0, 4.0]
    assert starts(played, "b") == [2.0, 5.0]


def test_a_delayed_edge_fires_once_that_much_later(tmp_path: Path) -> None:
    trigger = when(time_is(1.0, edge="rising", delay=2.5))
    played = Stage(tmp_path).play(maneuvers(event(speed(30.0), trigger=trigger, count=5)))
    assert starts(played, "event") == [3.5]


def test_the_look_of_the_frame_without_length_counts_as_the_first(tmp_path: Path) -> None:
    """Time 0 is looked at twice: a rising edge at time 0 is impossible, one in the next frame is not."""
    rising = when(time_is(0.0, "greaterThan", edge="rising"))
    played = Stage(tmp_path).play(maneuvers(event(speed(30.0), trigger=rising)))
    assert starts(played, "event") == [0.02]


def test_several_actors_have_an_action_each(tmp_path: Path) -> None:
    start = {name: teleport(on_lane(-1, s)) + speed(20.0) for name, s in (("Ego", 10.0), ("Other", 60.0))}
    group = maneuvers(event(lane_change(to_lane(-2)), trigger=after(1.0)), actors=("Ego", "Other"))
    played = Stage(tmp_path).play(group, start=start)
    assert start_of(played, "event-0") == pytest.approx(1.0)
    assert len([a for a in played.motion.actions if a.path[-1:] == ("event-0",)]) == 2
    for name in start:
        assert entity(played, name).lane[-1] == -2


def test_actions_step_in_the_order_of_the_file(tmp_path: Path) -> None:
    """A lane change before a brake uses the frame's old speed for its way, after it the new one."""

    def way(*actions: str) -> float:
        played = Stage(tmp_path).play(maneuvers(event(*actions, trigger=after(1.0))), last=2.0)
        motion = entity(played)
        return float(motion.x[row(motion, 1.02)] - motion.x[row(motion, 1.0)])

    change, brake = lane_change(to_lane(-2)), speed(10.0, "linear", over=1.0)
    assert way(change, brake) == pytest.approx(20.0 * 0.02, abs=1e-6)
    assert way(brake, change) == pytest.approx(19.8 * 0.02, abs=1e-6)


def test_a_group_that_runs_again_forgets_what_its_conditions_saw(tmp_path: Path) -> None:
    """The delay counts from the first look after the restart: 2 s after 0.02 s, then after the frame after the end."""
    late = event(speed(30.0), name="late", trigger=when(time_is(0.0, "greaterThan", delay=2.0)))
    played = Stage(tmp_path).play(maneuvers(late, count=3))
    assert starts(played, "late") == [2.02, 4.04, 6.06]
