"""What a run tells of itself: notes, errors, rows, determinism."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.kit.stage import (
    STRAIGHT,
    WIDTH,
    Stage,
    after,
    by_lanes,
    car,
    entity,
    event,
    lane_change,
    lane_offset,
    maneuvers,
    map_of,
    on_lane,
    private_action,
    road,
    speed,
    teleport,
    to_lane,
)
from xosc_lateral.base.errors import PlaybackError, XoscLateralError
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.player.player import play

HILL = map_of(
    road(
        "1",
        '<geometry s="0" x="0" y="0" hdg="0.3" length="1000"><line/></geometry>',
        1000.0,
        rest='<elevationProfile><elevation s="0" a="5" b="0.05" c="0" d="0"/></elevationProfile>',
    )
)


def test_rows_have_one_time_for_all_from_zero_in_equal_steps(tmp_path: Path) -> None:
    start = {name: teleport(on_lane(-1, s)) + speed(20.0) for name, s in (("Ego", 10.0), ("Other", 60.0))}
    motion = Stage(tmp_path).play(start=start, last=2.0, step=0.05).motion
    for rows in motion.entities:
        np.testing.assert_allclose(rows.time, 0.05 * np.arange(41), atol=1e-12)
        assert len(rows.x) == len(rows.lane) == len(rows.activity) == 41
    assert motion.end_time == pytest.approx(2.0)
    assert motion.step == 0.05


def test_world_and_road_coordinates_are_the_same_place(tmp_path: Path) -> None:
    played = Stage(tmp_path, HILL).play(
        maneuvers(
            event(lane_change(by_lanes(1)), name="change", trigger=after(1.0)),
            event(
                lane_offset('<AbsoluteTargetLaneOffset value="0.5"/>', acceleration=4.0), name="o", trigger=after(6.0)
            ),
        ),
        start={"Ego": teleport(on_lane(2, 900.0)) + speed(20.0)},
    )
    motion = entity(played)
    x, y, z, heading, pitch, roll = played.network.lane_to_world(motion.road, motion.lane, motion.s, motion.offset)
    for mine, theirs in ((motion.x, x), (motion.y, y), (motion.z, z)):
        np.testing.assert_allclose(mine, theirs, atol=1e-9)
    lane_frame = Rotation.from_euler("ZYX", np.column_stack([heading, pitch, roll]))
    turned = lane_frame * Rotation.from_euler("Z", motion.heading_relative[:, None])
    mine = Rotation.from_euler("ZYX", np.column_stack([motion.heading, motion.pitch, motion.roll]))
    np.testing.assert_allclose(mine.as_matrix(), turned.as_matrix(), atol=1e-9)
    assert motion.z[0] > motion.z[-1]


def test_the_first_row_is_flagged_as_a_jump_and_only_it(tmp_path: Path) -> None:
    motion = entity(Stage(tmp_path).play())
    assert motion.activity[0] & Activity.TELEPORTED
    assert not (motion.activity[1:] & Activity.TELEPORTED).any()


def test_a_teleport_on_the_way_is_flagged(tmp_path: Path) -> None:
    motion = entity(Stage(tmp_path).play(maneuvers(event(teleport(on_lane(1, 500.0)), trigger=after(1.0)))))
    jump = np.flatnonzero(motion.activity & Activity.TELEPORTED)
    assert jump.tolist() == [0, 51]
    assert motion.y[51] == pytest.approx(0.5 * WIDTH)


def test_the_actions_of_a_run_are_in_order_of_start_with_actor_and_path(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(
        maneuvers(
            event(speed(10.0, "linear", over=2.0), name="b", trigger=after(3.0)),
            event(lane_change(to_lane(-2)), name="a", trigger=after(1.0)),
        )
    )
    told = [(a.path, a.actor, round(a.start, 6), round(a.end or 0.0, 6)) for a in played.motion.actions]
    there = ("story", "act", "group", "group-maneuver")
    assert told == [
        (("Init",), "Ego", 0.0, 0.0),
        (("Init",), "Ego", 0.0, 0.0),
        ((*there, "a", "a-0"), "Ego", 1.0, 5.0),
        ((*there, "b", "b-0"), "Ego", 3.0, 5.0),
    ]


def test_playing_twice_gives_the_same(tmp_path: Path) -> None:
    Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-2)), trigger=after(1.0))))
    scenario = read_scenario(tmp_path / "scenario.xosc")
    network = read_opendrive(tmp_path / "roads.xodr")
    a, b = (play(scenario, network) for _ in range(2))
    for field in ("x", "y", "z", "heading", "speed", "s", "offset", "lane", "activity"):
        np.testing.assert_array_equal(getattr(a.entities[0], field), getattr(b.entities[0], field))
    assert a.notes == b.notes


def test_a_finer_step_gives_the_same_motion(tmp_path: Path) -> None:
    stage = Stage(tmp_path)
    change = maneuvers(event(lane_change(to_lane(-2)), trigger=after(1.0)))
    coarse, fine = entity(stage.play(change, step=0.02)), entity(stage.play(change, step=0.002))
    np.testing.assert_allclose(fine.y[::10][: len(coarse.y)], coarse.y, atol=1e-6)
    np.testing.assert_allclose(fine.x[::10][: len(coarse.x)], coarse.x, atol=2e-3)


@pytest.mark.parametrize(("step", "limit"), [(0.0, 1.0), (-0.1, 1.0), (float("nan"), 1.0), (0.02, -1.0)])
def test_steps_and_limits_that_make_no_sense_are_refused(tmp_path: Path, step: float, limit: float) -> None:
    Stage(tmp_path).play(last=0.1)
    scenario = read_scenario(tmp_path / "scenario.xosc")
    with pytest.raises(ValueError, match="step"):
        play(scenario, read_opendrive(tmp_path / "roads.xodr"), step=step, time_limit=limit)


def test_a_time_limit_of_zero_gives_the_first_row(tmp_path: Path) -> None:
    motion = entity(Stage(tmp_path).play(time_limit=0.0))
    assert motion.time.tolist() == [0.0]


def test_a_scenario_without_entities_is_refused(tmp_path: Path) -> None:
    with pytest.raises(PlaybackError, match="no entities"):
        Stage(tmp_path).play(start={}, entities=())


def test_an_unknown_entity_is_named_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(XoscLateralError, match="Nobody"):
        Stage(tmp_path).play(maneuvers(event(speed(1.0), trigger=after(1.0)), actors=("Nobody",)))


def test_notes_have_file_and_line(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-9)), trigger=after(1.0))))
    note = next(n for n in played.motion.notes if "lane -9" in n.what)
    assert note.path.endswith("scenario.xosc")
    assert f"{note.path}:{note.line}" in str(note)


def test_pedestrians_and_things_play_along(tmp_path: Path) -> None:
    box = '<BoundingBox><Center x="0" y="0" z="0.9"/><Dimensions width="0.5" length="0.6" height="1.8"/></BoundingBox>'
    walker = (
        '<ScenarioObject name="Walker"><Pedestrian name="p" mass="70" pedestrianCategory="pedestrian" model="m">'
        f"{box}<Properties/></Pedestrian></ScenarioObject>"
    )
    barrier = (
        '<ScenarioObject name="Thing"><MiscObject name="m" mass="70" miscObjectCategory="barrier">'
        f"{box}<Properties/></MiscObject></ScenarioObject>"
    )
    played = Stage(tmp_path, STRAIGHT).play(
        start={
            "Ego": teleport(on_lane(-1, 10.0)) + speed(20.0),
            "Walker": teleport(on_lane(-2, 40.0)) + speed(1.5),
            "Thing": teleport(on_lane(-2, 80.0)),
        },
        entities=(car("Ego"), walker, barrier),
    )
    walking = entity(played, "Walker")
    assert walking.x[-1] == pytest.approx(40.0 + 1.5 * walking.time[-1])
    assert entity(played, "Thing").x[-1] == pytest.approx(80.0)


def test_an_action_that_cannot_be_played_is_named_not_skipped_in_silence(tmp_path: Path) -> None:
    animation = private_action(
        '<AppearanceAction><AnimationAction loop="true"><AnimationType><ComponentAnimation><UserDefinedComponent '
        'userDefinedComponentType="x"/></ComponentAnimation></AnimationType></AnimationAction></AppearanceAction>'
    )
    played = Stage(tmp_path).play(maneuvers(event(animation, trigger=after(1.0))))
    known = {a.path[-1] for a in played.motion.actions if a.path}
    assert "event-0" in known or any("Animation" in note.what for note in played.motion.notes)
