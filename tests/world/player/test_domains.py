"""Which actions end each other, and when a vehicle at a road's end stands: as the reference player has it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.kit.stage import (
    Stage,
    after,
    entity,
    event,
    lane_offset,
    lateral,
    line,
    longitudinal,
    maneuvers,
    map_of,
    on_lane,
    private_action,
    road,
    row,
    speed,
    start_of,
    teleport,
)

BESIDE = lateral(
    '<LateralDistanceAction entityRef="Lead" distance="3" continuous="true" freespace="false" '
    'coordinateSystem="road" displacement="leftToReferencedEntity"/>'
)
TWO = {"Ego": teleport(on_lane(-2, 10.0)) + speed(20.0), "Lead": teleport(on_lane(-2, 40.0)) + speed(20.0)}


def _end_of(played: object, name: str) -> float:
    return next(a.end for a in played.motion.actions if a.path and a.path[-1] == name)  # type: ignore[attr-defined]


def test_a_speed_action_ends_a_lateral_distance_and_a_lane_offset_does_not(tmp_path: Path) -> None:
    beside = event(BESIDE, name="beside", trigger=after(1.0))
    aside = event(lane_offset('<AbsoluteTargetLaneOffset value="0.5"/>'), name="aside", trigger=after(2.0))
    faster = event(speed(25.0, "linear", "time", 2.0), name="faster", trigger=after(4.0))
    played = Stage(tmp_path).play(maneuvers(beside, aside, faster), start=TWO)
    assert _end_of(played, "beside-0") == pytest.approx(start_of(played, "faster-0"))


def test_a_lane_offset_beside_an_entity_goes_on_from_where_the_vehicle_is(tmp_path: Path) -> None:
    beside = event(BESIDE.replace('"road"', '"entity"'), name="beside", trigger=after(1.0))
    aside = event(lane_offset('<AbsoluteTargetLaneOffset value="0.5"/>', shape="step"), trigger=after(2.0))
    motion = entity(Stage(tmp_path).play(maneuvers(beside, aside), start=TWO))
    before, after_it = row(motion, 2.0), row(motion, 2.02)
    assert motion.offset[after_it] == pytest.approx(0.5)
    assert motion.x[after_it] - motion.x[before] == pytest.approx(0.4)


def test_acquiring_a_position_ends_what_drives_the_speed(tmp_path: Path) -> None:
    acquire = private_action(
        f"<RoutingAction><AcquirePositionAction><Position>{on_lane(-1, 500.0)}</Position></AcquirePositionAction>"
        "</RoutingAction>"
    )
    faster = event(speed(40.0, "linear", "time", 5.0), name="faster", trigger=after(1.0))
    there = event(acquire, name="there", trigger=after(2.0))
    played = Stage(tmp_path).play(maneuvers(faster, there))
    motion = entity(played)
    assert motion.speed[-1] == pytest.approx(motion.speed[row(motion, 2.0)])
    assert motion.speed[-1] < 30.0


def test_a_vehicle_stops_at_the_end_of_the_road_two_frames_after_it_came_there_whoever_moves_it(tmp_path: Path) -> None:
    stage = Stage(tmp_path, map_of(road("1", line(length=99.9), 99.9)))
    keep = longitudinal(
        '<LongitudinalDistanceAction entityRef="Lead" continuous="true" freespace="false" distance="20" '
        'displacement="leadingReferencedEntity"/>'
    )
    fast = {"Ego": teleport(on_lane(-1, 10.0)) + speed(20.0)}
    with_other = fast | {"Lead": teleport(on_lane(-2, 10.0)) + speed(20.0)}
    alone = entity(stage.play(start=fast))
    kept = entity(stage.play(maneuvers(event(keep)), start=with_other))
    for motion in (alone, kept):
        arrived = int((motion.x > 99.9 - 1e-6).argmax())
        assert motion.speed[arrived + 1] > 0.0
        assert motion.speed[arrived + 2] == 0.0


def test_a_step_of_speed_is_over_at_once_even_with_a_time(tmp_path: Path) -> None:
    step = event(speed(25.0, "step", "time", 4.8), name="step", trigger=after(1.0))
    played = Stage(tmp_path).play(maneuvers(step))
    assert _end_of(played, "step-0") == pytest.approx(start_of(played, "step-0"), abs=0.021)


def test_any_side_is_decided_by_free_space_and_once(tmp_path: Path) -> None:
    """Alongside there is no free space either way: the reference player then trails."""
    keep = longitudinal(
        '<LongitudinalDistanceAction entityRef="Lead" continuous="true" freespace="true" distance="10" '
        'displacement="any"><DynamicConstraints maxAcceleration="3" maxDeceleration="3" maxSpeed="50"/>'
        "</LongitudinalDistanceAction>"
    )
    alongside = {"Ego": teleport(on_lane(-1, 12.0)) + speed(20.0), "Lead": teleport(on_lane(-2, 10.0)) + speed(20.0)}
    motion = entity(Stage(tmp_path).play(maneuvers(event(keep)), start=alongside))
    assert motion.speed[row(motion, 1.0)] < 20.0


def test_who_comes_to_the_end_of_the_road_with_a_whole_step_stands_two_frames_later(tmp_path: Path) -> None:
    stage = Stage(tmp_path, map_of(road("1", line(length=100.0), 100.0)))
    motion = entity(stage.play(start={"Ego": teleport(on_lane(-1, 10.0)) + speed(20.0)}))
    arrived = int((motion.x > 100.0 - 1e-6).argmax())
    assert motion.x[arrived - 1] == pytest.approx(99.6)
    assert motion.speed[arrived + 1] > 0.0
    assert motion.speed[arrived + 2] == 0.0
