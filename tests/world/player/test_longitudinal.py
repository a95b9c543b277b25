"""Speed actions, profiles, distances and synchronisation against closed forms."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest

from tests.kit.stage import (
    CURVES,
    Stage,
    after,
    car,
    entity,
    event,
    in_world,
    longitudinal,
    maneuvers,
    on_lane,
    private_action,
    row,
    speed,
    speed_to,
    teleport,
)
from xosc_lateral.base.errors import FormatError
from xosc_lateral.workflows.conversion.load import Played

TWO = {"Ego": teleport(on_lane(-1, 10.0)) + speed(20.0), "Lead": teleport(on_lane(-1, 100.0)) + speed(15.0)}


def action_times(played: Played, name: str = "event-0") -> tuple[float, float | None]:
    found = next(a for a in played.motion.actions if a.path[-1:] == (name,))
    return round(found.start, 6), None if found.end is None else round(found.end, 6)


@pytest.mark.parametrize("shape", CURVES)
def test_a_speed_follows_its_curve_from_the_frame_of_the_start(tmp_path: Path, shape: str) -> None:
    played = Stage(tmp_path).play(maneuvers(event(speed(30.0, shape, over=4.0), trigger=after(1.0))))
    motion = entity(played)
    u = np.clip((motion.time - 1.0) / 4.0, 0.0, 1.0)
    np.testing.assert_allclose(motion.speed, np.array([20.0 + 10.0 * CURVES[shape](x) for x in u]), atol=1e-9)
    assert action_times(played) == (1.0, 5.0)


@pytest.mark.parametrize(("shape", "duration"), [("linear", 5.0), ("cubic", 7.5), ("sinusoidal", 2.5 * pi)])
def test_a_rate_is_the_largest_acceleration(tmp_path: Path, shape: str, duration: float) -> None:
    played = Stage(tmp_path).play(maneuvers(event(speed(30.0, shape, "rate", 2.0), trigger=after(1.0))), last=12.0)
    motion = entity(played)
    assert np.diff(motion.speed).max() / 0.02 == pytest.approx(2.0, rel=1e-3)
    _, end = action_times(played)
    assert end == pytest.approx(1.0 + duration, abs=0.02)


@pytest.mark.parametrize("final", [30.0, 5.0])
def test_a_speed_reached_over_a_distance(tmp_path: Path, final: float) -> None:
    action = speed(final, "linear", "distance", 100.0)
    played = Stage(tmp_path).play(maneuvers(event(action, trigger=after(1.0))), last=20.0)
    motion = entity(played)
    start, end = action_times(played)
    assert end == pytest.approx(1.0 + 200.0 / (20.0 + final), abs=0.021)
    driven = motion.x[row(motion, end or 0.0)] - motion.x[row(motion, start)]
    assert driven == pytest.approx(100.0, abs=0.5)


def test_the_vehicle_limits_acceleration_and_speed(tmp_path: Path) -> None:
    weak = car("Ego", top_speed=25.0, acceleration=1.0)
    played = Stage(tmp_path).play(
        maneuvers(event(speed(60.0, "linear", over=1.0), trigger=after(1.0))), entities=(weak,)
    )
    motion = entity(played)
    assert motion.speed.max() == pytest.approx(25.0)
    assert np.diff(motion.speed).max() == pytest.approx(0.02, abs=1e-6)


@pytest.mark.parametrize(("kind", "value", "expected"), [("delta", 3.0, 18.0), ("factor", 2.0, 30.0)])
def test_a_relative_speed_is_reached(tmp_path: Path, kind: str, value: float, expected: float) -> None:
    target = f'<RelativeTargetSpeed entityRef="Lead" value="{value}" speedTargetValueType="{kind}" continuous="false"/>'
    played = Stage(tmp_path).play(
        maneuvers(event(speed_to(target, "linear", "time", 2.0), trigger=after(1.0))), start=TWO
    )
    assert entity(played).speed[-1] == pytest.approx(expected)
    assert action_times(played) == (1.0, 3.0)


def test_a_continuous_relative_speed_follows_its_target(tmp_path: Path) -> None:
    target = '<RelativeTargetSpeed entityRef="Lead" value="0" speedTargetValueType="delta" continuous="true"/>'
    played = Stage(tmp_path).play(
        maneuvers(event(speed_to(target, "linear", "time", 2.0), trigger=after(1.0)), name="a"),
        maneuvers(event(speed(5.0, "linear", over=2.0), name="slow", trigger=after(5.0)), actors=("Lead",), name="b"),
        start=TWO,
    )
    ego, lead = entity(played), entity(played, "Lead")
    later = ego.time > 3.1
    np.testing.assert_allclose(ego.speed[later], lead.speed[later], atol=0.11)
    assert action_times(played)[1] == 10.0


def test_a_speed_profile_of_constant_accelerations(tmp_path: Path) -> None:
    entries = '<SpeedProfileEntry time="2" speed="30"/><SpeedProfileEntry time="4" speed="10"/>'
    profile = longitudinal(f'<SpeedProfileAction followingMode="position">{entries}</SpeedProfileAction>')
    played = Stage(tmp_path).play(maneuvers(event(profile, trigger=after(1.0))), last=10.0)
    motion = entity(played)
    expected = np.interp(motion.time, [1.0, 3.0, 7.0], [20.0, 30.0, 10.0])
    np.testing.assert_allclose(motion.speed, expected, atol=0.11)
    assert motion.speed[-1] == pytest.approx(10.0)


def test_a_speed_profile_with_limited_jerk(tmp_path: Path) -> None:
    limits = (
        '<DynamicConstraints maxAcceleration="4" maxDeceleration="4" maxAccelerationRate="3" maxDecelerationRate="3"/>'
    )
    entries = '<SpeedProfileEntry time="5" speed="30"/><SpeedProfileEntry time="5" speed="30"/>'
    profile = longitudinal(f'<SpeedProfileAction followingMode="follow">{limits}{entries}</SpeedProfileAction>')
    played = Stage(tmp_path).play(maneuvers(event(profile, trigger=after(1.0))), last=14.0)
    motion = entity(played)
    acceleration = np.diff(motion.speed) / 0.02
    assert motion.speed[-1] == pytest.approx(30.0, abs=0.05)
    assert np.abs(acceleration).max() <= 4.0 + 1e-6
    assert np.abs(np.diff(acceleration)).max() / 0.02 <= 3.0 + 1e-3


def test_a_speed_profile_whose_time_is_too_short_takes_what_its_limits_need(tmp_path: Path) -> None:
    limits = '<DynamicConstraints maxAcceleration="4" maxDeceleration="4"/>'
    entries = '<SpeedProfileEntry time="1" speed="30"/>'
    profile = longitudinal(f'<SpeedProfileAction followingMode="position">{limits}{entries}</SpeedProfileAction>')
    motion = entity(Stage(tmp_path).play(maneuvers(event(profile, trigger=after(1.0))), last=6.0))
    np.testing.assert_allclose(motion.speed, np.interp(motion.time, [1.0, 3.5], [20.0, 30.0]), atol=0.09)


def test_a_speed_profile_beside_another_vehicle_takes_its_speed_as_it_is_and_says_so(tmp_path: Path) -> None:
    entries = '<SpeedProfileEntry time="2" speed="3"/>'
    action = f'<SpeedProfileAction entityRef="Lead" followingMode="position">{entries}</SpeedProfileAction>'
    brakes = maneuvers(event(longitudinal(action), trigger=after(1.0)))
    played = Stage(tmp_path).play(brakes, start=TWO, last=6.0)
    assert entity(played).speed[-1] == pytest.approx(18.0)
    (note,) = played.motion.notes
    assert note.what == "speeds are relative to that of 'Lead' as it is now: 15.00 m/s (at 1.00 s)" and note.line


def test_a_limit_that_is_missing_is_the_players_and_is_said(tmp_path: Path) -> None:
    lacking = car("Ego").replace(' maxDeceleration="10.0"', "").replace('maxAcceleration="10.0"', 'maxAcceleration="4"')
    played = Stage(tmp_path).play(entities=(lacking,), last=1.0)
    performance = played.scenario.entities[0].performance
    assert (performance.max_acceleration, performance.max_deceleration) == (4.0, 10.0)
    assert [note.what for note in played.motion.notes] == ["maxDeceleration is missing: 10 m/s2 is taken"]
    backwards = car("Ego").replace('maxDeceleration="10.0"', 'maxDeceleration="-1e308"')
    with pytest.raises(FormatError, match=r"Performance of Vehicle 'car': maxDeceleration -1e\+308, expected"):
        Stage(tmp_path).play(entities=(backwards,), last=1.0)


def test_a_distance_without_limits_is_taken_at_once(tmp_path: Path) -> None:
    keep = longitudinal(
        '<LongitudinalDistanceAction entityRef="Lead" continuous="true" freespace="false" distance="30" '
        'coordinateSystem="road" displacement="trailingReferencedEntity"/>'
    )
    played = Stage(tmp_path).play(maneuvers(event(keep, trigger=after(1.0))), start=TWO)
    ego, lead = entity(played), entity(played, "Lead")
    later = ego.time > 1.03
    np.testing.assert_allclose((lead.x - ego.x)[later], 30.0, atol=0.31)
    np.testing.assert_allclose(ego.speed[later], 15.0)


def test_a_distance_with_limits_is_approached_and_kept(tmp_path: Path) -> None:
    limits = '<DynamicConstraints maxAcceleration="3" maxDeceleration="4" maxSpeed="40"/>'
    keep = longitudinal(
        '<LongitudinalDistanceAction entityRef="Lead" continuous="true" freespace="true" distance="30" '
        f'displacement="trailingReferencedEntity">{limits}</LongitudinalDistanceAction>'
    )
    played = Stage(tmp_path).play(maneuvers(event(keep, trigger=after(1.0))), start=TWO, last=40.0)
    ego, lead = entity(played), entity(played, "Lead")
    assert lead.x[-1] - ego.x[-1] - 5.0 == pytest.approx(30.0, abs=0.1)
    assert np.abs(np.diff(ego.speed)).max() <= 0.08 + 1e-9


def test_a_time_gap_counts_the_speed_of_the_other(tmp_path: Path) -> None:
    limits = '<DynamicConstraints maxAcceleration="3" maxDeceleration="4" maxSpeed="40"/>'
    keep = longitudinal(
        '<LongitudinalDistanceAction entityRef="Lead" continuous="false" freespace="false" timeGap="2" '
        f'displacement="trailingReferencedEntity">{limits}</LongitudinalDistanceAction>'
    )
    played = Stage(tmp_path).play(maneuvers(event(keep, trigger=after(1.0))), start=TWO, last=40.0)
    end = action_times(played)[1]
    assert end is not None
    ego, lead = entity(played), entity(played, "Lead")
    k = row(ego, end)
    assert lead.x[k] - ego.x[k] == pytest.approx(30.0, abs=0.25)


def synchronised(final: str) -> str:
    meet = "<{0}>" + on_lane(-1, 400.0) + "</{0}>"
    return private_action(
        '<SynchronizeAction masterEntityRef="Lead">'
        f"{meet.format('TargetPositionMaster')}{meet.format('TargetPosition')}{final}</SynchronizeAction>"
    )


def test_both_arrive_at_once(tmp_path: Path) -> None:
    start = {"Ego": teleport(on_lane(-2, 50.0)) + speed(10.0), "Lead": teleport(on_lane(-1, 200.0)) + speed(15.0)}
    final = '<FinalSpeed><AbsoluteSpeed value="20"/></FinalSpeed>'
    played = Stage(tmp_path).play(maneuvers(event(synchronised(final), trigger=after(1.0))), start=start, last=20.0)
    ego, lead = entity(played), entity(played, "Lead")
    there = row(lead, float(np.interp(400.0, lead.x, lead.time)))
    assert ego.x[there] == pytest.approx(400.0, abs=1.0)
    assert ego.speed[there + 3] == pytest.approx(20.0, abs=0.3)


def test_both_arrive_at_once_without_a_final_speed(tmp_path: Path) -> None:
    start = {"Ego": teleport(on_lane(-2, 50.0)) + speed(20.0), "Lead": teleport(on_lane(-1, 200.0)) + speed(10.0)}
    played = Stage(tmp_path).play(maneuvers(event(synchronised(""), trigger=after(1.0))), start=start, last=25.0)
    ego, lead = entity(played), entity(played, "Lead")
    there = row(lead, float(np.interp(400.0, lead.x, lead.time)))
    assert ego.x[there] == pytest.approx(400.0, abs=1.0)
    # 330 m in 19 s with one acceleration all the time
    braking = 2.0 * (330.0 / 19.0 - 20.0) / 19.0
    on_the_way = (ego.time > 1.2) & (ego.time < 18.0)
    np.testing.assert_allclose(ego.speed[on_the_way], 20.0 + braking * (ego.time[on_the_way] - 1.0), atol=0.05)


def test_a_standing_master_is_waited_for(tmp_path: Path) -> None:
    start = {"Ego": teleport(on_lane(-2, 50.0)) + speed(20.0), "Lead": teleport(in_world(200.0, -1.75)) + speed(0.0)}
    final = '<FinalSpeed><AbsoluteSpeed value="20"/></FinalSpeed>'
    played = Stage(tmp_path).play(maneuvers(event(synchronised(final), trigger=after(1.0))), start=start)
    ego = entity(played)
    assert ego.speed[-1] == 0.0
    assert ego.x[-1] < 400.0


@pytest.mark.parametrize(("master", "place"), [(0.0, 200.0), (15.0, 450.0)])
def test_nobody_drives_to_meet_a_master_that_stands_or_has_passed(tmp_path: Path, master: float, place: float) -> None:
    start = {"Ego": teleport(on_lane(-2, 50.0)) + speed(20.0), "Lead": teleport(on_lane(-1, place)) + speed(master)}
    ego = entity(Stage(tmp_path).play(maneuvers(event(synchronised(""), trigger=after(1.0))), start=start))
    assert ego.speed[-1] == 0.0


def test_driving_backwards(tmp_path: Path) -> None:
    start = {"Ego": teleport(on_lane(-1, 500.0)) + speed(-5.0)}
    motion = entity(Stage(tmp_path).play(start=start))
    np.testing.assert_allclose(motion.x, 500.0 - 5.0 * motion.time, atol=1e-6)
    np.testing.assert_allclose(motion.heading, 0.0, atol=1e-12)
