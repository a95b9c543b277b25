"""When conditions become true: times worked out by hand."""

from __future__ import annotations

from math import sin
from pathlib import Path

import pytest

from tests.kit.stage import (
    STRAIGHT,
    WIDTH,
    Stage,
    Trigger,
    after,
    by_entity,
    by_value,
    entity,
    event,
    facing,
    follow,
    in_world,
    lane_change,
    line,
    maneuvers,
    map_of,
    on_lane,
    polyline,
    private_action,
    road,
    speed,
    start_of,
    teleport,
    time_is,
    to_lane,
    when,
)

TWO = {"Ego": teleport(on_lane(-1, 10.0)) + speed(20.0), "Lead": teleport(on_lane(-1, 110.0)) + speed(10.0)}
NEXT_TO = {"Ego": teleport(on_lane(-2, 10.0)) + speed(20.0), "Lead": teleport(on_lane(-1, 110.0)) + speed(10.0)}
APART = {"Ego": teleport(on_lane(-1, 10.0)) + speed(10.0), "Lead": teleport(on_lane(-1, 110.0)) + speed(20.0)}
FRAME = 0.0201


def fires(
    folder: Path,
    trigger: Trigger,
    *,
    start: dict[str, str] | None = None,
    others: tuple[str, ...] = (),
    roads: str | None = STRAIGHT,
    **how: object,
) -> float | None:
    """When an event with this trigger starts; None: never. [s]"""
    marker = maneuvers(event(by_name(), name="marker", trigger=trigger), name="marker")
    played = Stage(folder, roads).play(*others, marker, start=start or TWO, last=20.0, **how)  # type: ignore[arg-type]
    try:
        return round(start_of(played, "marker-0"), 6)
    except StopIteration:
        return None


def by_name() -> str:
    return '<UserDefinedAction><CustomCommandAction type="marker">x</CustomCommandAction></UserDefinedAction>'


# ---- of the entity alone ---------------------------------------------------------------------------------------------
BRAKING = maneuvers(event(speed(0.0, "linear", over=4.0), trigger=after(1.0)), name="brake")
"""From 20 m/s at 1 s to a stop at 5 s."""


def test_speed(tmp_path: Path) -> None:
    trigger = when(by_entity('<SpeedCondition value="10" rule="lessThan"/>'))
    assert fires(tmp_path, trigger, others=(BRAKING,)) == pytest.approx(3.02)


@pytest.mark.parametrize(("direction", "expected"), [("longitudinal", 3.02), ("lateral", 0.0)])
def test_speed_along_an_axis(tmp_path: Path, direction: str, expected: float) -> None:
    condition = f'<SpeedCondition value="10" rule="lessThan" direction="{direction}"/>'
    assert fires(tmp_path, when(by_entity(condition)), others=(BRAKING,)) == pytest.approx(expected)


def test_acceleration(tmp_path: Path) -> None:
    condition = '<AccelerationCondition value="-4" rule="lessThan" direction="longitudinal"/>'
    assert fires(tmp_path, when(by_entity(condition)), others=(BRAKING,)) == pytest.approx(1.02)


def test_stand_still_counts_from_the_row_in_which_it_began(tmp_path: Path) -> None:
    trigger = when(by_entity('<StandStillCondition duration="2"/>'))
    assert fires(tmp_path, trigger, others=(BRAKING,)) == pytest.approx(7.02)


def test_travelled_distance(tmp_path: Path) -> None:
    trigger = when(by_entity('<TraveledDistanceCondition value="50.1"/>'))
    assert fires(tmp_path, trigger) == pytest.approx(2.52)


def test_end_of_road(tmp_path: Path) -> None:
    trigger = when(by_entity('<EndOfRoadCondition duration="1"/>'))
    start = {"Ego": teleport(on_lane(-1, 950.0)) + speed(20.0)}
    assert fires(tmp_path, trigger, start=start) == pytest.approx(3.5, abs=0.05)


def test_off_road(tmp_path: Path) -> None:
    aside = maneuvers(event(lane_change(to_lane(-2), "linear", over=10.0, offset=-7.0), trigger=after(1.0)))
    found = fires(tmp_path, when(by_entity('<OffroadCondition duration="0"/>')), others=(aside,))
    beyond = 1.0 + 10.0 * 1.5 * WIDTH / (WIDTH + 7.0)
    assert found == pytest.approx(beyond, abs=2.5 * FRAME)


def test_reaching_a_position(tmp_path: Path) -> None:
    inside = f'<ReachPositionCondition tolerance="3"><Position>{on_lane(-1, 60.0)}</Position></ReachPositionCondition>'
    assert fires(tmp_path, when(by_entity(inside))) == pytest.approx((50.0 - 3.0) / 20.0, abs=FRAME)


def test_angles(tmp_path: Path) -> None:
    turning = maneuvers(event(lane_change(to_lane(-2)), trigger=after(1.0)))
    condition = '<AngleCondition angleType="heading" angle="-0.06" angleTolerance="0.01" coordinateSystem="lane"/>'
    found = fires(tmp_path, when(by_entity(condition)), others=(turning,), minor=3)
    assert found is not None
    assert 1.5 < found < 3.0


# ---- between entities ------------------------------------------------------------------------------------------------
def distance_condition(kind: str, value: float, *, freespace: bool = False, system: str = "entity") -> str:
    return (
        f'<RelativeDistanceCondition entityRef="Lead" relativeDistanceType="{kind}" value="{value}" rule="lessThan" '
        f'freespace="{str(freespace).lower()}" coordinateSystem="{system}"/>'
    )


@pytest.mark.parametrize(
    ("kind", "freespace", "system", "expected"),
    [
        ("longitudinal", False, "entity", 8.0),
        ("longitudinal", True, "entity", 7.5),
        ("longitudinal", False, "road", 8.0),
        ("longitudinal", True, "road", 7.5),
        ("longitudinal", False, "lane", 8.0),
        ("euclidianDistance", False, "entity", (100.0 - (20.0**2 - WIDTH**2) ** 0.5) / 10.0),
        ("euclidianDistance", True, "entity", (100.0 - 5.0 - (20.0**2 - (WIDTH - 2.0) ** 2) ** 0.5) / 10.0),
    ],
)
def test_distances(tmp_path: Path, kind: str, freespace: bool, system: str, expected: float) -> None:
    """Closing at 10 m/s from 100 m ahead in the next lane: when is it 20 m?"""
    trigger = when(by_entity(distance_condition(kind, 20.0, freespace=freespace, system=system)))
    assert fires(tmp_path, trigger, start=NEXT_TO) == pytest.approx(expected, abs=FRAME)


@pytest.mark.parametrize(("freespace", "value"), [(False, WIDTH), (True, WIDTH - 2.0)])
def test_lateral_distance(tmp_path: Path, freespace: bool, value: float) -> None:
    for margin, expected in ((0.01, 0.0), (-0.01, None)):
        trigger = when(by_entity(distance_condition("lateral", value + margin, freespace=freespace)))
        assert fires(tmp_path, trigger, start=NEXT_TO) == expected


def test_the_entity_frame_turns_with_the_entity(tmp_path: Path) -> None:
    """100 m ahead along the road lies 100 sin(0.5) to the right of a car that is turned to the left by 0.5."""
    turned = {**TWO, "Ego": teleport(on_lane(-1, 10.0, orientation=facing(0.5))) + speed(10.0)}
    for margin, expected in ((0.01, 0.0), (-0.01, None)):
        trigger = when(by_entity(distance_condition("lateral", 100.0 * sin(0.5) + margin)))
        assert fires(tmp_path, trigger, start=turned) == expected


def test_distance_to_a_position(tmp_path: Path) -> None:
    inside = (
        '<DistanceCondition value="20" rule="lessThan" freespace="false" coordinateSystem="road" '
        f'relativeDistanceType="longitudinal"><Position>{on_lane(-2, 110.0)}</Position></DistanceCondition>'
    )
    assert fires(tmp_path, when(by_entity(inside))) == pytest.approx(4.0, abs=FRAME)


@pytest.mark.parametrize(("freespace", "expected"), [(False, 6.0), (True, 5.5)])
def test_time_headway(tmp_path: Path, freespace: bool, expected: float) -> None:
    inside = (
        f'<TimeHeadwayCondition entityRef="Lead" value="2" rule="lessThan" freespace="{str(freespace).lower()}" '
        'coordinateSystem="entity" relativeDistanceType="longitudinal"/>'
    )
    assert fires(tmp_path, when(by_entity(inside))) == pytest.approx(expected, abs=FRAME)


def test_time_headway_is_not_defined_behind_or_at_rest(tmp_path: Path) -> None:
    inside = '<TimeHeadwayCondition entityRef="{}" value="1000" rule="lessThan" freespace="false"/>'
    assert fires(tmp_path, when(by_entity(inside.format("Ego"), "Lead")), start=APART) is None
    resting = APART | {"Ego": teleport(on_lane(-1, 10.0))}
    assert fires(tmp_path, when(by_entity(inside.format("Lead"))), start=resting) is None


def test_time_to_collision(tmp_path: Path) -> None:
    inside = (
        '<TimeToCollisionCondition value="3" rule="lessThan" freespace="false" coordinateSystem="entity" '
        'relativeDistanceType="longitudinal"><TimeToCollisionConditionTarget><EntityRef entityRef="Lead"/>'
        "</TimeToCollisionConditionTarget></TimeToCollisionCondition>"
    )
    assert fires(tmp_path, when(by_entity(inside))) == pytest.approx(7.0, abs=FRAME)


def test_time_to_collision_is_not_defined_while_they_move_apart(tmp_path: Path) -> None:
    inside = (
        '<TimeToCollisionCondition value="1000" rule="lessThan" freespace="false"><TimeToCollisionConditionTarget>'
        '<EntityRef entityRef="Lead"/></TimeToCollisionConditionTarget></TimeToCollisionCondition>'
    )
    assert fires(tmp_path, when(by_entity(inside)), start=APART) is None


@pytest.mark.parametrize(("ahead", "told"), [(30.0, "does not hold at 0 s; in esmini"), (200.0, "")])
def test_what_the_first_frame_of_the_reference_player_takes_otherwise_is_said(
    tmp_path: Path, ahead: float, told: str
) -> None:
    """There nobody has a velocity yet: a car that drives 30 m ahead at the same speed is 1.5 s away, as if it stood."""
    start = {
        "Ego": teleport(on_lane(-1, 10.0)) + speed(20.0),
        "Lead": teleport(on_lane(-1, 10.0 + ahead)) + speed(20.0),
    }
    inside = (
        '<TimeToCollisionCondition value="3" rule="lessThan" freespace="false"><TimeToCollisionConditionTarget>'
        '<EntityRef entityRef="Lead"/></TimeToCollisionConditionTarget></TimeToCollisionCondition>'
    )
    marker = maneuvers(event(by_name(), trigger=when(by_entity(inside))))
    notes = [note for note in Stage(tmp_path).play(marker, start=start, last=1.0).motion.notes if note.entity == "Ego"]
    assert [note.what.startswith(told) for note in notes] == [True] * bool(told)


def test_relative_speed(tmp_path: Path) -> None:
    trigger = when(by_entity('<RelativeSpeedCondition entityRef="Lead" value="0" rule="lessThan"/>'))
    assert fires(tmp_path, trigger, others=(BRAKING,)) == pytest.approx(3.02)


def test_collision(tmp_path: Path) -> None:
    trigger = when(by_entity('<CollisionCondition><EntityRef entityRef="Lead"/></CollisionCondition>'))
    assert fires(tmp_path, trigger) == pytest.approx(9.5, abs=FRAME)
    assert fires(tmp_path, trigger, start=NEXT_TO) is None


def test_who_is_named_touches_itself_and_its_own_kind_does_not(tmp_path: Path) -> None:
    named, of_kind = '<EntityRef entityRef="Ego"/>', '<ByType type="vehicle"/>'
    found = [
        fires(tmp_path, when(by_entity(f"<CollisionCondition>{target}</CollisionCondition>")), start=NEXT_TO)
        for target in (named, of_kind)
    ]
    assert found == [0.0, None]


def test_clearance_of_the_lane_beside(tmp_path: Path) -> None:
    inside = (
        '<RelativeClearanceCondition distanceForward="30" distanceBackward="20" freeSpace="false" '
        'oppositeLanes="false">'
        '<RelativeLaneRange from="1" to="1"/></RelativeClearanceCondition>'
    )
    found = fires(tmp_path, when(by_entity(inside, edge="rising")), start=NEXT_TO, minor=3)
    assert found == pytest.approx((100.0 + 20.0) / 10.0, abs=FRAME)


def test_any_and_all_of_several_entities(tmp_path: Path) -> None:
    condition = '<TraveledDistanceCondition value="50.1"/>'
    assert fires(tmp_path, when(by_entity(condition, "Ego", "Lead", rule="any"))) == pytest.approx(2.52)
    assert fires(tmp_path, when(by_entity(condition, "Ego", "Lead", rule="all"))) == pytest.approx(5.02)


# ---- by value --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("rule", "expected"),
    [("greaterThan", 2.02), ("greaterOrEqual", 2.0), ("equalTo", 2.0), ("lessThan", 0.0), ("notEqualTo", 0.0)],
)
def test_rules_have_a_tolerance(tmp_path: Path, rule: str, expected: float) -> None:
    assert fires(tmp_path, when(time_is(2.0, rule))) == pytest.approx(expected)


def test_simulation_time_above_zero_holds_from_the_second_row(tmp_path: Path) -> None:
    assert fires(tmp_path, when(time_is(0.0, "greaterThan"))) == pytest.approx(0.02)


GLOBAL = "<GlobalAction>{}</GlobalAction>"


def test_parameters_that_an_action_sets(tmp_path: Path) -> None:
    declared = (
        '<ParameterDeclarations><ParameterDeclaration name="go" parameterType="string" value="no"/>'
        "</ParameterDeclarations>"
    )
    action = GLOBAL.format('<ParameterAction parameterRef="go"><SetAction value="yes"/></ParameterAction>')
    found = fires(
        tmp_path,
        when(by_value('<ParameterCondition parameterRef="go" value="yes" rule="equalTo"/>')),
        others=(maneuvers(event(action, trigger=after(3.0)), name="set"),),
        declared=declared,
        minor=1,
    )
    assert found == pytest.approx(3.0, abs=FRAME)


@pytest.mark.parametrize(
    ("action", "goal"),
    [
        ('<SetAction value="7"/>', "7"),
        ('<ModifyAction><Rule><AddValue value="2.5"/></Rule></ModifyAction>', "4"),
        ('<ModifyAction><Rule><MultiplyByValue value="4"/></Rule></ModifyAction>', "6"),
    ],
)
def test_variables_that_an_action_changes(tmp_path: Path, action: str, goal: str) -> None:
    declared = (
        '<VariableDeclarations><VariableDeclaration name="level" variableType="double" value="1.5"/>'
        "</VariableDeclarations>"
    )
    change = GLOBAL.format(f'<VariableAction variableRef="level">{action}</VariableAction>')
    found = fires(
        tmp_path,
        when(by_value(f'<VariableCondition variableRef="level" value="{goal}" rule="greaterOrEqual"/>')),
        others=(maneuvers(event(change, trigger=after(3.0)), name="set"),),
        declared=declared,
        minor=2,
    )
    assert found == pytest.approx(3.0, abs=FRAME)


SIGNALS = (
    '<TrafficSignals><TrafficSignalController name="first">{}</TrafficSignalController>'
    '<TrafficSignalController name="second" delay="2" reference="first">{}</TrafficSignalController></TrafficSignals>'
)


def phase(name: str, duration: float, state: str, signal: str) -> str:
    show = f'<TrafficSignalState trafficSignalId="{signal}" state="{state}"/>'
    return f'<Phase name="{name}" duration="{duration}">{show}</Phase>'


LIGHTS = SIGNALS.format(
    phase("stop", 3.0, "red", "s1") + phase("go", 5.0, "green", "s1"),
    phase("stop", 4.0, "red", "s2") + phase("go", 4.0, "green", "s2"),
)


@pytest.mark.parametrize(("signal", "expected"), [("s1", 3.0), ("s2", 6.0)])
def test_signals_go_through_their_phases(tmp_path: Path, signal: str, expected: float) -> None:
    trigger = when(by_value(f'<TrafficSignalCondition name="{signal}" state="green"/>'))
    assert fires(tmp_path, trigger, signals=LIGHTS) == pytest.approx(expected, abs=FRAME)


def test_phases_of_a_controller(tmp_path: Path) -> None:
    trigger = when(
        by_value('<TrafficSignalControllerCondition trafficSignalControllerRef="first" phase="stop"/>', edge="rising")
    )
    assert fires(tmp_path, trigger, signals=LIGHTS) == pytest.approx(8.0, abs=FRAME)


def test_a_controller_is_sent_to_a_phase(tmp_path: Path) -> None:
    send = GLOBAL.format(
        "<InfrastructureAction><TrafficSignalAction>"
        '<TrafficSignalControllerAction trafficSignalControllerRef="first" phase="go"/>'
        "</TrafficSignalAction></InfrastructureAction>"
    )
    found = fires(
        tmp_path,
        when(by_value('<TrafficSignalCondition name="s1" state="green"/>')),
        others=(maneuvers(event(send, trigger=after(1.0)), name="send"),),
        signals=LIGHTS,
    )
    assert found == pytest.approx(1.0, abs=FRAME)


def test_a_signal_is_set_by_an_action(tmp_path: Path) -> None:
    show = GLOBAL.format(
        '<InfrastructureAction><TrafficSignalAction><TrafficSignalStateAction name="s9" state="amber"/>'
        "</TrafficSignalAction></InfrastructureAction>"
    )
    found = fires(
        tmp_path,
        when(by_value('<TrafficSignalCondition name="s9" state="amber"/>')),
        others=(maneuvers(event(show, trigger=after(1.5)), name="set"),),
    )
    assert found == pytest.approx(1.5, abs=FRAME)


def test_time_of_day(tmp_path: Path) -> None:
    environment = GLOBAL.format(
        '<EnvironmentAction><Environment name="e"><TimeOfDay animation="true" dateTime="2024-05-01T12:00:00"/>'
        "</Environment></EnvironmentAction>"
    )
    found = fires(
        tmp_path,
        when(by_value('<TimeOfDayCondition rule="greaterOrEqual" dateTime="2024-05-01T12:00:05"/>')),
        global_init=environment,
    )
    assert found == pytest.approx(5.0, abs=FRAME)


def test_what_only_a_simulator_knows_is_false_and_named(tmp_path: Path) -> None:
    trigger = when(by_value('<UserDefinedValueCondition name="weather" value="x" rule="equalTo"/>'))
    played = Stage(tmp_path).play(maneuvers(event(speed(1.0), trigger=trigger)))
    assert entity(played).speed[-1] == 20.0
    assert any("weather" in note.what for note in played.motion.notes)


def test_entities_without_roads_measure_in_the_plane(tmp_path: Path) -> None:
    """Nothing moves without a road, but a distance can be asked for."""
    start = {"Ego": teleport(in_world(0.0, 0.0, 0.0)), "Lead": teleport(in_world(15.0, 0.0, 0.0))}
    trigger = when(by_entity(distance_condition("longitudinal", 20.0)))
    assert fires(tmp_path, trigger, start=start, roads=None) == 0.0


# ---- what is accepted is honoured or named ---------------------------------------------------------------------------
BEND = polyline((None, in_world(110.0, 0.0)), (None, in_world(160.0, 0.0)), (None, in_world(160.0, 50.0)))
ALONG = maneuvers(event(follow(BEND), trigger=after(1.0)), name="along")


def angle(system: str, kind: str = "heading", value: float = 0.0) -> str:
    return f'<AngleCondition angleType="{kind}" angle="{value}" angleTolerance="0.01" coordinateSystem="{system}"/>'


@pytest.mark.parametrize(
    ("system", "expected"),
    [
        ("trajectory", 1.0),  # the heading is that of the path from the moment at which it is entered
        ("world", 0.0),
        ("entity", 0.0),  # nobody is turned against himself
        ("road", 0.0),
    ],
)
def test_an_angle_is_measured_in_its_coordinate_system(tmp_path: Path, system: str, expected: float) -> None:
    assert fires(tmp_path, when(by_entity(angle(system))), others=(ALONG,), minor=3) == expected


def test_an_angle_to_a_trajectory_needs_one(tmp_path: Path) -> None:
    assert fires(tmp_path, when(by_entity(angle("trajectory"))), minor=3) is None


def test_pitch_relative_to_a_trajectory_is_named(tmp_path: Path) -> None:
    trigger = when(by_entity(angle("trajectory", "pitch")))
    played = Stage(tmp_path).play(maneuvers(event(by_name(), trigger=trigger)), start=TWO, minor=3)
    assert any("pitch relative to a trajectory" in note.what for note in played.motion.notes)


@pytest.mark.parametrize(("system", "expected"), [("world", 8.0), ("trajectory", 8.0)])
def test_distances_in_the_world_and_along_a_trajectory(tmp_path: Path, system: str, expected: float) -> None:
    inside = distance_condition("longitudinal", 20.0, system=system)
    straight = polyline((None, in_world(10.0, -1.75)), (None, in_world(900.0, -1.75)))
    along = maneuvers(event(follow(straight), trigger=after(0.0)), name="along")
    others = (along,) if system == "trajectory" else ()
    assert fires(tmp_path, when(by_entity(inside)), others=others) == pytest.approx(expected, abs=FRAME)


def test_an_orientation_has_to_be_reached_too(tmp_path: Path) -> None:
    def reached(heading: float) -> float | None:
        place = on_lane(-1, 60.0, orientation=facing(heading))
        inside = f'<ReachPositionCondition tolerance="3"><Position>{place}</Position></ReachPositionCondition>'
        return fires(tmp_path, when(by_entity(inside)))

    assert reached(0.04) == pytest.approx((50.0 - 3.0) / 20.0, abs=FRAME)
    assert reached(0.06) is None


def test_another_way_than_the_shortest_is_named(tmp_path: Path) -> None:
    inside = distance_condition("longitudinal", 20.0, system="road").replace("/>", ' routingAlgorithm="fastest"/>')
    trigger = when(by_entity(inside))
    played = Stage(tmp_path).play(maneuvers(event(by_name(), trigger=trigger)), start=TWO)
    assert any("routingAlgorithm 'fastest'" in note.what for note in played.motion.notes)


def test_the_end_of_a_route_is_no_end_of_the_road(tmp_path: Path) -> None:
    way = "".join(
        f'<Waypoint routeStrategy="shortest"><Position>{on_lane(-1, s)}</Position></Waypoint>' for s in (5.0, 60.0)
    )
    assign = f'<RoutingAction><AssignRouteAction><Route name="r" closed="false">{way}</Route></AssignRouteAction>'
    start = {"Ego": TWO["Ego"] + private_action(f"{assign}</RoutingAction>"), "Lead": TWO["Lead"]}
    assert fires(tmp_path, when(by_entity('<EndOfRoadCondition duration="0"/>')), start=start) is None


def test_travelled_distance_is_that_in_the_plane(tmp_path: Path) -> None:
    """3-4-5: up a grade of 3/4, 20 m/s along s are 20 m/s in the plane."""
    grade = '<elevationProfile><elevation s="0" a="0" b="0.75" c="0" d="0"/></elevationProfile>'
    steep = map_of(road("1", line(), 1000.0, rest=grade))
    inside = '<TraveledDistanceCondition value="100"/>'
    assert fires(tmp_path, when(by_entity(inside)), roads=steep) == pytest.approx(5.0, abs=FRAME)


def test_any_of_several_entities_is_enough_and_all_are_needed_where_all_is_said(tmp_path: Path) -> None:
    far = '<TraveledDistanceCondition value="100"/>'  # Ego is there after 5 s, Lead after 10
    for names in (("Ego", "Lead"), ("Lead", "Ego")):
        assert fires(tmp_path, when(by_entity(far, *names))) == pytest.approx(5.0, abs=FRAME)
        assert fires(tmp_path, when(by_entity(far, *names, rule="all"))) == pytest.approx(10.0, abs=FRAME)
    assert fires(tmp_path, when(by_entity(far, "Lead"))) == pytest.approx(10.0, abs=FRAME)
