"""Lane changes, lane offsets and lateral distances against closed forms."""

from __future__ import annotations

from math import asin, cos, pi, sin, sqrt
from pathlib import Path

import numpy as np
import pytest

from tests.kit.stage import (
    CURVES,
    STRAIGHT,
    WIDTH,
    Stage,
    after,
    by_lanes,
    car,
    entity,
    event,
    in_world,
    lane_change,
    lane_offset,
    lanes,
    lateral,
    lateral_rows,
    line,
    maneuvers,
    map_of,
    on_lane,
    road,
    row,
    section,
    speed,
    teleport,
    to_lane,
)
from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.workflows.conversion.load import Played
from xosc_lateral.world.motion.nominal import Activity, EntityMotion

LEFT_HAND = map_of(road("1", line(), 1000.0, rule="LHT"))
FOUR = map_of(road("1", line(), 1000.0, sections=section(lanes(4, 3, 2, 1), lanes(-1, -2, -3, -4))))


def jumps(motion: EntityMotion) -> list[float]:
    """Times of the rows, from the second on, that the motion does not lead to."""
    return [float(motion.time[k]) for k in np.flatnonzero(motion.activity & Activity.TELEPORTED) if k > 0]


def end_of(played: Played) -> float | None:
    return next(a.end for a in played.motion.actions if a.path[-1:] == ("event-0",))


# ---- lane changes ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("shape", CURVES)
def test_a_lane_change_in_time_follows_its_curve(tmp_path: Path, shape: str) -> None:
    played = Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-2), shape), trigger=after(1.0))))
    motion = entity(played)
    u = np.clip((motion.time - 1.0) / 4.0, 0.0, 1.0)
    y = -0.5 * WIDTH - WIDTH * np.array([CURVES[shape](x) for x in u])
    np.testing.assert_allclose(motion.y, y, atol=1e-9)
    assert end_of(played) == pytest.approx(5.0)
    running = lateral_rows(motion)
    assert (running[0], running[-1]) == (pytest.approx(1.02), pytest.approx(5.0))


def test_the_way_of_a_lane_change_is_as_long_as_the_speed_says(tmp_path: Path) -> None:
    """ds of a frame = sqrt((v dt)^2 - (slope dt)^2), the slope being that at the frame's start."""
    played = Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-2)), trigger=after(1.0))))
    motion = entity(played)
    t = motion.time[:-1]
    u = np.clip((t - 1.0) / 4.0, 0.0, 1.0)
    slope = np.where((t > 0.99) & (t < 4.99), 0.5 * WIDTH * pi / 4.0 * np.sin(pi * u), 0.0)
    np.testing.assert_allclose(np.diff(motion.x), 0.02 * np.sqrt(20.0**2 - slope**2), atol=1e-7)


def test_the_heading_of_a_lane_change_is_that_of_its_path(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-2)), trigger=after(1.0))))
    motion = entity(played)
    k = row(motion, 3.02)
    assert motion.heading_relative[k] == pytest.approx(-asin(0.5 * WIDTH * pi / 4.0 / 20.0), rel=1e-6)
    assert motion.heading_relative[row(motion, 1.02)] == pytest.approx(0.0, abs=1e-9)
    assert motion.heading_relative[-1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("shape", "duration"), [("linear", WIDTH / 2.0), ("cubic", 1.5 * WIDTH / 2.0), ("sinusoidal", pi * WIDTH / 4.0)]
)
def test_a_rate_is_the_largest_lateral_speed(tmp_path: Path, shape: str, duration: float) -> None:
    played = Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-2), shape, "rate", 2.0), trigger=after(1.0))))
    assert end_of(played) == pytest.approx(1.0 + duration, abs=0.021)
    assert np.abs(np.diff(entity(played).y)).max() / 0.02 == pytest.approx(2.0, rel=2e-3)


def test_a_distance_is_measured_along_the_lane(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(
        maneuvers(event(lane_change(to_lane(-2), "sinusoidal", "distance", 60.0), trigger=after(1.0)))
    )
    motion = entity(played)
    end = end_of(played)
    assert end is not None
    driven = motion.x[row(motion, end)] - motion.x[row(motion, 1.0)]
    assert driven == pytest.approx(60.0, abs=0.42)
    k = row(motion, 2.5)
    u = (motion.x[k] - motion.x[row(motion, 1.0)]) / 60.0
    assert motion.y[k] == pytest.approx(-0.5 * WIDTH - WIDTH * 0.5 * (1.0 - cos(pi * u)), abs=0.01)


def test_a_step_is_a_jump(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-2), "step", over=0.0), trigger=after(1.0))))
    motion = entity(played)
    assert motion.y[row(motion, 1.0)] == pytest.approx(-0.5 * WIDTH)
    assert motion.y[row(motion, 1.02)] == pytest.approx(-1.5 * WIDTH)
    assert jumps(motion) == pytest.approx([1.02])


def test_a_lane_change_that_takes_its_time_is_no_jump(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-2), over=2.0), trigger=after(1.0))))
    assert jumps(entity(played)) == []


@pytest.mark.parametrize(("offset", "times"), [(1.0, [1.02]), (0.04, [])])
def test_a_lane_offset_at_once_is_a_jump_unless_it_is_tiny(tmp_path: Path, offset: float, times: list[float]) -> None:
    change = lane_offset(f'<AbsoluteTargetLaneOffset value="{offset}"/>', shape="step")
    motion = entity(Stage(tmp_path).play(maneuvers(event(change, trigger=after(1.0)))))
    assert motion.offset[row(motion, 1.02)] == pytest.approx(offset)
    assert jumps(motion) == pytest.approx(times)


def test_over_several_lanes_the_lane_is_the_one_under_the_entity(tmp_path: Path) -> None:
    played = Stage(tmp_path, FOUR).play(maneuvers(event(lane_change(to_lane(-4), over=6.0), trigger=after(1.0))))
    motion = entity(played)
    inside = np.abs(motion.y / WIDTH - np.round(motion.y / WIDTH)) > 1e-9  # at an edge it is still in the lane before
    np.testing.assert_array_equal(motion.lane[inside], np.floor(motion.y[inside] / WIDTH).astype(int))
    assert sorted(set(motion.lane.tolist())) == [-4, -3, -2, -1]
    np.testing.assert_allclose(motion.y, -WIDTH * (np.abs(motion.lane) - 0.5) + motion.offset, atol=1e-9)


@pytest.mark.parametrize(("roads", "lane", "target"), [(FOUR, 2, 1), (LEFT_HAND, -1, -2)])
def test_against_s_left_is_still_left(tmp_path: Path, roads: str, lane: int, target: int) -> None:
    """Lanes and offsets count to the left of travel."""
    start = {"Ego": teleport(on_lane(lane, 900.0)) + speed(20.0)}
    played = Stage(tmp_path, roads).play(maneuvers(event(lane_change(by_lanes(1)), trigger=after(1.0))), start=start)
    motion = entity(played)
    assert motion.lane[-1] == target
    assert motion.x[-1] < 900.0
    np.testing.assert_allclose(np.cos(motion.heading[[0, -1]]), -1.0, atol=1e-9)
    changing = (motion.time > 1.1) & (motion.time < 2.9)
    assert (motion.offset[changing] > 0.0).all()
    assert (motion.offset[(motion.time > 3.1) & (motion.time < 4.9)] < 0.0).all()


def test_a_lane_into_oncoming_traffic_skips_the_middle(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(maneuvers(event(lane_change(by_lanes(2)), trigger=after(1.0))))
    motion = entity(played)
    assert motion.lane[-1] == 2
    assert motion.y[-1] == pytest.approx(1.5 * WIDTH)
    assert motion.x[-1] > 190.0


def test_the_target_offset_is_where_it_ends(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-2), offset=0.4), trigger=after(1.0))))
    assert entity(played).y[-1] == pytest.approx(-1.5 * WIDTH + 0.4)


def test_who_stands_turned_is_straight_from_the_begin_of_a_lane_change_on(tmp_path: Path) -> None:
    """As in the reference player, though nothing moves yet, and another action may take over in the same frame."""
    start = {"Ego": teleport(in_world(10.0, -0.5 * WIDTH, 0.1)) + speed(0.0)}
    played = Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-2)), trigger=after(1.0))), start=start, last=2.0)
    ego = entity(played)
    assert ego.heading[row(ego, 0.9)] == pytest.approx(0.1) and ego.heading[-1] == 0.0


def test_a_lane_that_is_not_there_is_named(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-7)), trigger=after(1.0))))
    (note,) = (note for note in played.motion.notes if "no lane -7" in note.what)
    assert note.line and note.entity == "Ego" and note.what.endswith("(at 1.00 s)")
    assert entity(played).y[-1] == pytest.approx(-0.5 * WIDTH)


def test_a_lane_change_over_a_section_border_keeps_its_course(tmp_path: Path) -> None:
    """The right lane is -2 up to 50 m and -3 after it, because a lane opens on the left."""
    after_border = section(
        lanes(1), lanes(-1, -2, -3, links={-1: (None, None), -2: (-1, None), -3: (-2, None)}), s=50.0
    )
    before = section(lanes(1), lanes(-1, -2, links={-1: (None, -2), -2: (None, -3)}))
    offset = '<laneOffset s="0" a="0" b="0" c="0" d="0"/>'
    roads = map_of(road("1", line(), 1000.0, sections=offset + before + after_border))
    played = Stage(tmp_path, roads).play(maneuvers(event(lane_change(to_lane(-2)), trigger=after(1.0))))
    motion = entity(played)
    assert motion.lane[-1] == -3
    assert motion.offset[-1] == pytest.approx(0.0, abs=1e-9)


def test_a_lane_change_follows_a_widening_lane(tmp_path: Path) -> None:
    wide = (
        '<lane id="-2" type="driving"><width sOffset="0" a="3.5" b="0.01" c="0" d="0"/></lane>'
        '<lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
    )
    roads = map_of(road("1", line(), 1000.0, sections=section(lanes(1), wide)))
    played = Stage(tmp_path, roads).play(maneuvers(event(lane_change(to_lane(-2)), trigger=after(1.0))))
    motion = entity(played)
    k = row(motion, 7.0)
    assert motion.y[k] == pytest.approx(-3.5 - 0.5 * (3.5 + 0.01 * motion.x[k]), abs=1e-9)


def test_the_heading_is_that_of_the_path_where_lanes_are_not_parallel(tmp_path: Path) -> None:
    wide = (
        '<lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
        '<lane id="-2" type="driving"><width sOffset="0" a="3.5" b="0.1" c="0" d="0"/></lane>'
    )
    roads = map_of(road("1", line(), 1000.0, sections=section(lanes(1), wide)))
    played = Stage(tmp_path, roads).play(maneuvers(event(lane_change(to_lane(-2)), trigger=after(1.0))))
    motion = entity(played)
    driven = np.arctan2(np.gradient(motion.y), np.gradient(motion.x))
    changing = slice(row(motion, 1.1), row(motion, 4.9))
    heading = (motion.heading[changing] + pi) % (2.0 * pi) - pi
    np.testing.assert_allclose(heading, driven[changing], atol=0.003)  # half a frame at the sharpest turn


# ---- lane offsets ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("shape", "factor"), [("cubic", sqrt(6.0)), ("linear", sqrt(6.0)), ("sinusoidal", pi / sqrt(2.0))]
)
def test_a_lane_offset_takes_the_time_its_lateral_acceleration_needs(tmp_path: Path, shape: str, factor: float) -> None:
    change = lane_offset('<AbsoluteTargetLaneOffset value="1"/>', shape=shape, acceleration=0.8)
    played = Stage(tmp_path).play(maneuvers(event(change, trigger=after(1.0))))
    motion = entity(played)
    duration = factor * sqrt(1.0 / 0.8)
    u = np.clip((motion.time - 1.02) / duration, 0.0, 1.0)
    np.testing.assert_allclose(motion.offset, np.array([CURVES[shape](x) for x in u]), atol=1e-9)
    np.testing.assert_allclose(np.diff(motion.x), 0.4, atol=1e-9)


def test_without_an_acceleration_it_is_half_a_metre_per_second_squared(tmp_path: Path) -> None:
    change = lane_offset('<AbsoluteTargetLaneOffset value="1"/>', shape="sinusoidal")
    motion = entity(Stage(tmp_path).play(maneuvers(event(change, trigger=after(1.0)))))
    half = float(np.interp(0.5, motion.offset, motion.time))
    assert half == pytest.approx(1.02 + 0.5 * pi, abs=1e-3)


def test_an_offset_to_the_left_of_another_entity(tmp_path: Path) -> None:
    start = {
        "Ego": teleport(on_lane(-1, 10.0)) + speed(20.0),
        "Other": teleport(on_lane(-2, 30.0, offset=0.5)) + speed(20.0),
    }
    change = lane_offset('<RelativeTargetLaneOffset entityRef="Other" value="1"/>', acceleration=5.0)
    played = Stage(tmp_path).play(maneuvers(event(change, trigger=after(1.0))), start=start)
    assert entity(played).y[-1] == pytest.approx(-1.5 * WIDTH + 0.5 + 1.0)


@pytest.mark.parametrize("roads", [STRAIGHT, LEFT_HAND], ids=["right-hand", "left-hand"])
def test_offsets_of_the_file_count_along_t_and_those_of_the_rows_to_the_left_of_travel(
    tmp_path: Path, roads: str
) -> None:
    """A lane offset action of +1 comes out along +t in the reference player, whatever the direction of travel."""
    for lane in (-1, 1):
        change = lane_offset('<AbsoluteTargetLaneOffset value="1"/>', acceleration=5.0)
        start = {"Ego": teleport(on_lane(lane, 500.0)) + speed(20.0)}
        motion = entity(Stage(tmp_path, roads).play(maneuvers(event(change, trigger=after(1.0))), start=start))
        travel = np.sign(motion.x[-1] - motion.x[0])
        assert motion.y[-1] - motion.y[0] == pytest.approx(1.0, abs=1e-9)
        assert motion.offset[-1] == pytest.approx(travel * 1.0, abs=1e-9)


def test_a_heading_given_in_the_world_is_kept_on_a_banked_road(tmp_path: Path) -> None:
    """A car that is put down askew slides along its lane askew."""
    banked = '<lateralProfile><superelevation s="0" a="-1" b="0" c="0" d="0"/></lateralProfile>'
    stage = Stage(tmp_path, map_of(road("1", line(), 1000.0, rest=banked)))
    start = {"Ego": teleport(in_world(100.0, -1.75 * cos(1.0), 0.2)) + speed(20.0)}
    motion = entity(stage.play(start=start, last=1.0))
    np.testing.assert_allclose(motion.heading, 0.2, atol=1e-9)
    assert motion.x[-1] > 110.0


@pytest.mark.parametrize("bank", [0.1, -1.0])
@pytest.mark.parametrize("lane", [-2, 2])
def test_on_a_banked_road_heading_and_pitch_are_those_of_the_path_in_space(
    tmp_path: Path, bank: float, lane: int
) -> None:
    banked = f'<lateralProfile><superelevation s="0" a="{bank}" b="0" c="0" d="0"/></lateralProfile>'
    change = lane_change(by_lanes(1), over=2.0)
    start = {"Ego": teleport(on_lane(lane, 500.0)) + speed(20.0)}
    stage = Stage(tmp_path, map_of(road("1", line(), 1000.0, rest=banked)))
    motion = entity(stage.play(maneuvers(event(change, trigger=after(1.0))), start=start))
    between = slice(row(motion, 1.5), row(motion, 2.5))
    dx, dy, dz = (np.diff(values)[between] for values in (motion.x, motion.y, motion.z))
    after_frame = slice(between.start + 1, between.stop + 1)
    off = motion.heading[after_frame] - np.arctan2(dy, dx)
    np.testing.assert_allclose(np.angle(np.exp(1j * off)), 0.0, atol=2e-3)  # of up to 0.14; a frame late
    np.testing.assert_allclose(motion.pitch[after_frame], -np.arctan2(dz, np.hypot(dx, dy)), atol=2e-3)


# ---- lateral distance ------------------------------------------------------------------------------------------------
def test_a_lateral_distance_without_limits_is_taken_at_once(tmp_path: Path) -> None:
    start = {
        "Ego": teleport(on_lane(-2, 10.0)) + speed(20.0),
        "Other": teleport(on_lane(-1, 30.0)) + speed(20.0),
    }
    keep = lateral(
        '<LateralDistanceAction entityRef="Other" distance="3" freespace="false" continuous="true" '
        'coordinateSystem="entity" displacement="rightToReferencedEntity"/>'
    )
    played = Stage(tmp_path).play(maneuvers(event(keep, trigger=after(1.0))), start=start)
    motion = entity(played)
    assert motion.y[-1] == pytest.approx(-0.5 * WIDTH - 3.0, abs=1e-6)
    assert len(jumps(motion)) == 1
    assert sin(float(motion.heading[-1])) == pytest.approx(0.0, abs=1e-9)


def test_a_lateral_distance_with_limits_is_approached(tmp_path: Path) -> None:
    start = {
        "Ego": teleport(on_lane(-2, 10.0)) + speed(20.0),
        "Other": teleport(on_lane(-1, 30.0)) + speed(20.0),
    }
    limits = '<DynamicConstraints maxAcceleration="2" maxDeceleration="2" maxSpeed="5"/>'
    keep = lateral(
        '<LateralDistanceAction entityRef="Other" distance="1" freespace="true" continuous="true" '
        f'coordinateSystem="road" displacement="rightToReferencedEntity">{limits}</LateralDistanceAction>'
    )
    played = Stage(tmp_path).play(maneuvers(event(keep, trigger=after(1.0))), start=start, last=20.0)
    motion = entity(played)
    assert motion.y[-1] == pytest.approx(-0.5 * WIDTH - 3.0, abs=0.02)
    assert jumps(motion) == []
    assert np.abs(np.diff(motion.y)).max() <= 0.1 + 1e-9


# ---- lateral distances -----------------------------------------------------------------------------------------------
def beside(distance: float, side: str, *, system: str = "entity", limits: str = "", continuous: bool = True) -> str:
    return lateral(
        f'<LateralDistanceAction entityRef="Lead" distance="{distance}" freespace="false" coordinateSystem="{system}" '
        f'displacement="{side}ToReferencedEntity" continuous="{str(continuous).lower()}">{limits}'
        "</LateralDistanceAction>"
    )


def test_beside_an_entity_without_any_road(tmp_path: Path) -> None:
    """On the line 4 m to the left of the other's axis at once, and along it with what is left of the way."""
    start = {
        "Lead": teleport(in_world(0.0, 0.0, 0.0)),
        "Ego": teleport(in_world(-50.0, 3.5, 0.0)) + speed(60.0),
    }
    played = Stage(tmp_path, None).play(maneuvers(event(beside(4.0, "left"))), start=start, last=2.0)
    motion = entity(played)
    np.testing.assert_allclose(motion.y[1:], 4.0, atol=1e-9)
    assert motion.x[1] == pytest.approx(-50.0 + 1.2, abs=1e-9)  # placed in the frame without length, then ahead
    assert motion.x[2] - motion.x[1] == pytest.approx(1.2)


def test_beside_an_entity_with_a_limited_acceleration_it_turns_into_the_line(tmp_path: Path) -> None:
    start = {
        "Lead": teleport(in_world(0.0, 0.0, 0.0)) + speed(20.0),
        "Ego": teleport(in_world(0.0, -1.0, 0.0)) + speed(20.0),
    }
    limits = '<DynamicConstraints maxAcceleration="3"/>'
    played = Stage(tmp_path, None).play(maneuvers(event(beside(4.0, "right", limits=limits))), start=start, last=15.0)
    motion = entity(played)
    assert motion.y[-1] == pytest.approx(-4.0, abs=0.02)
    way = np.hypot(np.diff(motion.x), np.diff(motion.y))
    np.testing.assert_allclose(way, 0.4, atol=1e-9)
    assert np.abs(np.diff(np.unwrap(motion.heading))).max() * 20.0 / 0.02 < 1.5 * 3.0


@pytest.mark.parametrize("limit", [0.5, 1.0, 2.0])
def test_a_limited_lateral_speed_is_kept_and_nobody_runs_away(tmp_path: Path, limit: float) -> None:
    start = {
        "Lead": teleport(on_lane(-1, 60.0)) + speed(20.0),
        "Ego": teleport(on_lane(-1, 10.0)) + speed(20.0),
    }
    limits = f'<DynamicConstraints maxSpeed="{limit}"/>'
    played = Stage(tmp_path).play(
        maneuvers(event(beside(3.0, "left", system="road", limits=limits))), start=start, last=20.0
    )
    motion = entity(played)
    assert np.abs(np.diff(motion.y)).max() <= limit * 0.02 + 1e-9
    assert motion.y[-1] == pytest.approx(-0.5 * WIDTH + 3.0, abs=1e-6)


def test_motion_beyond_every_bound_is_an_error_with_entity_and_time(tmp_path: Path) -> None:
    with pytest.raises(PlaybackError, match=r"'Ego' leaves every plausible bound at 0\.02 s .*speed = 5000 m/s"):
        entities = (car("Ego", top_speed=1e6, acceleration=1e9),)
        Stage(tmp_path).play(start={"Ego": teleport(on_lane(-1, 10.0)) + speed(5000.0)}, entities=entities)


def test_a_lateral_distance_keeps_its_limit_of_jerk_and_uses_it(tmp_path: Path) -> None:
    start = {"Ego": teleport(on_lane(-2, 10.0)) + speed(20.0), "Lead": teleport(on_lane(-1, 30.0)) + speed(20.0)}
    limits = (
        '<DynamicConstraints maxAcceleration="2" maxDeceleration="2" maxSpeed="5" maxAccelerationRate="1" '
        'maxDecelerationRate="1"/>'
    )
    keep = beside(4.0, "right", system="road", limits=limits)
    played = Stage(tmp_path).play(maneuvers(event(keep, trigger=after(1.0))), start=start, last=12.0)
    motion = entity(played)
    jerk = np.diff(motion.y, 3)[60:] / played.motion.step**3
    assert 0.99 < np.abs(jerk).max() < 1.0 + 1e-3
