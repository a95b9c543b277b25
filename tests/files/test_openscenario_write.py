"""The writers: what is in the file, and that it plays as it was meant to."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree
from msgspec import structs

from tests.kit.scenario_files import (
    action,
    declarations,
    entity,
    event,
    made,
    parameter,
    private,
    scenario_text,
    speed_action,
    story,
    teleport,
    time_condition,
    write_scenario,
)
from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError, PlaybackError
from xosc_lateral.base.track import Track
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.files.openscenario.provenance import provenance_of
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.openscenario.write.draft import WrittenScenario
from xosc_lateral.files.openscenario.write.fit import write_converted
from xosc_lateral.files.openscenario.write.reactive import LateralActions
from xosc_lateral.world.motion.driver_clock import DriverClock
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.motion.offset_path import OffsetPath, approached, pieces_along, spacing_of
from xosc_lateral.world.motion.way import RoadPlace
from xosc_lateral.world.player.player import play
from xosc_lateral.world.scenario.position import Polyline, WorldPosition
from xosc_lateral.world.scenario.private_actions import FollowTrajectoryAction
from xosc_lateral.world.scenario.scenario import Scenario

XSD = Path(__file__).parents[1] / "data" / "xsd"
STEP = 0.02


@pytest.fixture(scope="session")
def schema() -> Callable[[int], etree.XMLSchema]:
    """Schema of version 1.x by its minor number."""
    files = {0: "1.0.0", 1: "1.1.1", 2: "1.2.0", 3: "1.3.0"}
    loaded: dict[int, etree.XMLSchema] = {}

    def get(minor: int) -> etree.XMLSchema:
        if minor not in loaded:
            loaded[minor] = etree.XMLSchema(etree.parse(str(XSD / f"OpenSCENARIO-{files[minor]}.xsd")))
        return loaded[minor]

    return get


def played(scenario: Scenario, limit: float = 20.0) -> NominalMotion:
    assert scenario.road_file is not None
    return play(scenario, read_opendrive(scenario.road_file), step=STEP, time_limit=limit)


def nominal(motion: NominalMotion) -> dict[str, Track]:
    return {e.name: e for e in motion.entities}


def provenance(scenario: Scenario) -> dict[str, Any]:
    files = [*scenario.input_files, *([scenario.road_file] if scenario.road_file else [])]
    return {"seed": 3, "inputs": {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}}


def converted(scenario: Scenario, output: Path, **overrides: Any) -> WrittenScenario:
    motion = overrides.pop("motion", None) or played(scenario)
    trajectories = overrides.pop("trajectories", None) or nominal(motion)
    return write_converted(
        scenario, motion, trajectories, output, provenance=provenance(scenario), summary="seed 3", **overrides
    )


def reactive(scenario: Scenario, motion: NominalMotion, paths: list[OffsetPath], output: Path) -> WrittenScenario:
    """Nobody on a trajectory: maneuvers stay, and paths are added."""
    return write_converted(scenario, motion, {}, output, paths=paths, provenance=provenance(scenario), summary="seed 3")


def vertices(scenario: Scenario) -> list[np.ndarray]:
    """Per trajectory: columns time, x, y, heading."""
    found = []
    for story_read in scenario.storyboard.stories:
        for act in story_read.acts:
            for group in act.maneuver_groups:
                for item in (a for m in group.maneuvers for e in m.events for a in e.actions):
                    if isinstance(item.content, FollowTrajectoryAction):
                        assert isinstance(item.content.trajectory.shape, Polyline)
                        rows = [(v.time, v.position) for v in item.content.trajectory.shape.vertices]
                        found.append(
                            np.array([(t, p.x, p.y, p.h) for t, p in rows if isinstance(p, WorldPosition)], dtype=float)
                        )
    return found


LIGHT = (
    "<PrivateAction><AppearanceAction><LightStateAction><LightType>"
    '<VehicleLight vehicleLightType="brakeLights"/></LightType><LightState mode="on"/>'
    "</LightStateAction></AppearanceAction></PrivateAction>"
)
VISIBLE = '<PrivateAction><VisibilityAction graphics="true" sensors="false" traffic="true"/></PrivateAction>'
CUSTOM = '<UserDefinedAction><CustomCommandAction type="x">do it</CustomCommandAction></UserDefinedAction>'
STOP_AND_GO = story(
    event("stop", action("stop", speed_action("0")), time=2.01),
    event("go", action("go", speed_action("12")), time=5.01),
)


@pytest.mark.parametrize("minor", [0, 1, 2, 3])
def test_output_is_valid_against_the_schema_of_its_version(
    tmp_path: Path, minor: int, schema: Callable[[int], etree.XMLSchema]
) -> None:
    scenario = read_scenario(write_scenario(tmp_path, scenario_text(minor=minor, stories=STOP_AND_GO)))
    schema(minor).assertValid(etree.parse(str(scenario.path)))
    converted(scenario, tmp_path / "out.xosc")
    schema(minor).assertValid(etree.parse(str(tmp_path / "out.xosc")))
    assert read_scenario(tmp_path / "out.xosc").header.version == (1, minor)


@pytest.mark.parametrize("minor", [0, 3])
def test_a_car_that_only_stands_gets_no_trajectory_and_a_valid_file(
    tmp_path: Path, minor: int, schema: Callable[[int], etree.XMLSchema]
) -> None:
    standing = private("Ego", teleport(), speed_action("0"))
    stories = story(event("light", action("custom", CUSTOM), time=99))
    scenario = read_scenario(write_scenario(tmp_path, scenario_text(minor=minor, init=standing, stories=stories)))
    converted(scenario, tmp_path / "out.xosc")
    schema(minor).assertValid(etree.parse(str(tmp_path / "out.xosc")))
    assert vertices(read_scenario(tmp_path / "out.xosc")) == []


def test_played_output_is_where_the_input_was(tmp_path: Path) -> None:
    scenario = made(tmp_path, stories=STOP_AND_GO)
    before = played(scenario)
    converted(scenario, tmp_path / "out.xosc", motion=before)
    after = played(read_scenario(tmp_path / "out.xosc"))
    assert after.end_time == pytest.approx(before.end_time, abs=STEP / 2)
    error = np.hypot(after.entities[0].x - before.entities[0].x, after.entities[0].y - before.entities[0].y)
    # 1 cm where it drives; one row more at the sudden stop, which this scenario makes from 30 m/s.
    assert np.quantile(error, 0.99) < 0.01
    assert error.max() < 0.05


def test_vertices_are_apart_timed_and_end_at_the_stop(tmp_path: Path) -> None:
    scenario = made(tmp_path, stories=STOP_AND_GO)
    converted(scenario, tmp_path / "out.xosc")
    paths = vertices(read_scenario(tmp_path / "out.xosc"))
    assert len(paths) == 2
    for path in paths:
        assert np.hypot(np.diff(path[:, 1]), np.diff(path[:, 2])).min() >= 0.1
        assert np.diff(path[:, 0]).min() > 0
        assert np.isfinite(path).all()
    assert paths[0][-1, 0] == pytest.approx(2.02, abs=STEP + 1e-9)
    assert paths[1][0, 0] == pytest.approx(5.02, abs=STEP + 1e-9)
    # Where it stopped, it moves off.
    assert paths[1][0, 1:] == pytest.approx(paths[0][-1, 1:], abs=1e-4)


def test_what_is_no_motion_happens_at_the_same_time_in_the_same_order(tmp_path: Path) -> None:
    contents = [LIGHT, VISIBLE, CUSTOM, speed_action("31"), LIGHT]
    stories = story(*(event(f"e{n}", action(f"a{n}", text), time=1.0 + n) for n, text in enumerate(contents)))
    scenario = made(tmp_path, stories=stories, init=private("Ego", teleport(), speed_action(), LIGHT))
    before = played(scenario)
    converted(scenario, tmp_path / "out.xosc", motion=before)
    after = played(read_scenario(tmp_path / "out.xosc"))

    def happened(motion: NominalMotion) -> list[tuple[str, float]]:
        kinds = ("LightStateAction", "VisibilityAction", "UserDefinedAction")
        names = [(type(p.action.content).__name__, round(p.start, 6)) for p in motion.actions]
        return [(name, start) for name, start in names if name in kinds]

    assert len(happened(before)) == 5
    assert happened(after) == happened(before)


def test_kept_actions_get_local_parameters_filled_in_and_keep_global_ones(tmp_path: Path) -> None:
    light = LIGHT.replace('mode="on"', 'mode="$Mode"').replace('"brakeLights"', '"$Which"')
    scenario = made(
        tmp_path,
        parameters=declarations(parameter("Which", "brakeLights", "string")),
        stories=story(
            event("e", action("a", light)), maneuver_parameters=declarations(parameter("Mode", "flashing", "string"))
        ),
    )
    converted(scenario, tmp_path / "out.xosc")
    text = (tmp_path / "out.xosc").read_text()
    assert 'mode="flashing"' in text
    assert 'vehicleLightType="$Which"' in text


def test_comments_catalog_locations_vendor_parts_and_date_survive(tmp_path: Path) -> None:
    text = scenario_text(catalogs='<VehicleCatalog><Directory path="cars"/></VehicleCatalog>')
    text = text.replace("<Properties/>", '<Properties><Property name="tint" value="7"/></Properties>')
    text = text.replace("<Event ", "<!-- why it happens --><Event ")
    scenario = read_scenario(write_scenario(tmp_path, text))
    converted(scenario, tmp_path / "out.xosc")
    out = (tmp_path / "out.xosc").read_text()
    for kept in ("<!-- licence -->", "<!-- who drives -->", "<!-- why it happens -->", 'path="cars"', 'value="7"'):
        assert kept in out
    assert 'date="2024-01-01T00:00:00"' in out
    assert 'author="tests"' in out


def test_references_still_lead_there_from_another_folder(tmp_path: Path) -> None:
    catalogs = '<VehicleCatalog><Directory path="cars"/></VehicleCatalog>'
    scenario = made(tmp_path / "in", catalogs=catalogs)
    output = tmp_path / "far" / "away" / "from" / "it" / "out.xosc"
    output.parent.mkdir(parents=True)
    converted(scenario, output)
    again = read_scenario(output, allowed=[tmp_path / "in"])
    assert again.road_file is not None
    assert again.road_file.resolve() == (tmp_path / "in" / "road.xodr").resolve()
    assert again.catalog_locations["VehicleCatalog"].resolve() == (tmp_path / "in" / "cars").resolve()
    assert len(played(again).entities) == 1


def test_same_input_same_bytes(tmp_path: Path) -> None:
    scenario = made(tmp_path, stories=STOP_AND_GO)
    first = converted(scenario, tmp_path / "a.xosc")
    second = converted(read_scenario(scenario.path), tmp_path / "b.xosc")
    assert (tmp_path / "a.xosc").read_bytes() == (tmp_path / "b.xosc").read_bytes()
    assert first.sha256 == second.sha256 == hashlib.sha256((tmp_path / "a.xosc").read_bytes()).hexdigest()


def test_provenance_is_inside_and_a_second_conversion_is_refused(tmp_path: Path) -> None:
    scenario = made(tmp_path)
    converted(scenario, tmp_path / "out.xosc")
    root = etree.parse(str(tmp_path / "out.xosc")).getroot()
    assert provenance_of(root) == json.loads(json.dumps(provenance(scenario)))
    assert provenance_of(etree.fromstring(scenario.source)) is None
    again = read_scenario(tmp_path / "out.xosc")
    assert "seed 3" in again.header.description
    with pytest.raises(FormatError, match="was converted by xosc-lateral already"):
        converted(again, tmp_path / "again.xosc")
    assert not (tmp_path / "again.xosc").exists()


def test_provenance_with_dashes_stays_one_comment(tmp_path: Path) -> None:
    scenario = made(tmp_path)
    motion = played(scenario)
    wild = {"note": "a--b---c-", "inputs": {}}
    write_converted(scenario, motion, nominal(motion), tmp_path / "out.xosc", provenance=wild, summary="s")
    assert provenance_of(etree.parse(str(tmp_path / "out.xosc")).getroot()) == wild


def test_controllers_of_converted_entities_go_and_are_named(tmp_path: Path) -> None:
    controller = '<ObjectController><Controller name="pilot"><Properties/></Controller></ObjectController>'
    activate = '<PrivateAction><ActivateControllerAction lateral="true" longitudinal="true"/></PrivateAction>'
    scenario = made(
        tmp_path,
        entities=entity("Ego", controller=controller) + entity("B", controller=controller),
        init=private("Ego", teleport(), speed_action(), activate) + private("B", teleport("90"), speed_action()),
    )
    motion = played(scenario)
    trajectories = {"Ego": nominal(motion)["Ego"]}
    written = converted(scenario, tmp_path / "out.xosc", motion=motion, trajectories=trajectories)
    again = read_scenario(tmp_path / "out.xosc")
    assert again.entity("Ego").controllers == ()
    assert [found.name for found in again.entity("B").controllers] == ["pilot"]
    assert "ActivateControllerAction" not in (tmp_path / "out.xosc").read_text()
    (left_out,) = written.notes
    assert left_out.what == (
        "ObjectController left out ('Ego' follows a trajectory: "
        "controller 'pilot': along and across the road; now as the default driver would)"
    )
    assert written.converted == ("Ego",)


def test_a_teleport_becomes_a_teleport_and_a_new_trajectory(tmp_path: Path) -> None:
    scenario = made(tmp_path, stories=story(event("jump", action("jump", teleport("600", "-2")), time=3.01)))
    before = played(scenario)
    converted(scenario, tmp_path / "out.xosc", motion=before)
    after = played(read_scenario(tmp_path / "out.xosc"))
    assert np.abs(np.diff(before.entities[0].x)).max() > 400
    error = np.hypot(after.entities[0].x - before.entities[0].x, after.entities[0].y - before.entities[0].y)
    assert error.max() < 0.01


def test_stop_trigger_becomes_the_time_at_which_it_fired(tmp_path: Path) -> None:
    far = (
        '<ConditionGroup><Condition name="far" delay="0" conditionEdge="none"><ByEntityCondition><TriggeringEntities '
        'triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/></TriggeringEntities><EntityCondition>'
        '<TraveledDistanceCondition value="200"/></EntityCondition></ByEntityCondition></Condition></ConditionGroup>'
    )
    scenario = made(tmp_path, stop=far)
    before = played(scenario)
    converted(scenario, tmp_path / "out.xosc", motion=before)
    out = (tmp_path / "out.xosc").read_text()
    assert "TraveledDistanceCondition" not in out
    assert played(read_scenario(tmp_path / "out.xosc")).end_time == pytest.approx(before.end_time, abs=STEP / 2)


def test_a_stop_trigger_by_time_alone_stays_as_written(tmp_path: Path) -> None:
    scenario = made(tmp_path, stop=time_condition(4.321))
    converted(scenario, tmp_path / "out.xosc")
    assert '<SimulationTimeCondition value="4.321" rule="greaterThan"/>' in (tmp_path / "out.xosc").read_text()


def test_overridden_parameters_are_written_with_the_values_played(tmp_path: Path) -> None:
    text = scenario_text(
        parameters=declarations(parameter("Speed", "30"), parameter("Half", "${$Speed / 2}")),
        init=private("Ego", teleport(), speed_action("$Speed")),
    )
    scenario = read_scenario(write_scenario(tmp_path, text), {"Speed": "20"})
    converted(scenario, tmp_path / "out.xosc")
    again = read_scenario(tmp_path / "out.xosc")
    assert again.parameters["Speed"].value == "20"
    assert float(again.parameters["Half"].value) == 10.0


def test_a_trajectory_with_nan_is_a_wrong_call(tmp_path: Path) -> None:
    scenario = made(tmp_path)
    motion = played(scenario)
    trajectory = nominal(motion)["Ego"]
    broken = trajectory.having(x=np.where(trajectory.time > 1, np.nan, trajectory.x))
    with pytest.raises(ValueError, match="not finite"):
        converted(scenario, tmp_path / "out.xosc", motion=motion, trajectories={"Ego": broken})
    assert not (tmp_path / "out.xosc").exists()


def sine_path(entity_name: str, after: tuple[str, ...] | None = None, *, length: float = 1500.0) -> OffsetPath:
    """20 cm to each side every 200 m, from the left turn on."""
    distance = np.arange(0.0, length, 5.0)
    speed = np.full(len(distance), 25.0)
    clock = DriverClock(distance, speed, distance / speed)
    spacing = spacing_of(distance, speed, np.zeros(len(distance)), distance, clock)
    offset = approached(sine, clock, 0.0, 0.0) if after else sine
    pieces = tuple(pieces_along(offset, clock, spacing, [0.0, length], calm_end=False))
    return OffsetPath(entity_name, after, pieces, placed_t=None if after else 0.2, start=0.2)


def sine(distance: FloatArray) -> FloatArray:
    return np.asarray(0.2 * np.cos(2 * np.pi * distance / 200.0))


@pytest.mark.parametrize("minor", [0, 1, 2, 3])
def test_lane_offset_output_is_valid_and_keeps_the_maneuvers(
    tmp_path: Path, minor: int, schema: Callable[[int], etree.XMLSchema]
) -> None:
    scenario = read_scenario(write_scenario(tmp_path, scenario_text(minor=minor)))
    motion = played(scenario)
    reactive(scenario, motion, [sine_path("Ego")], tmp_path / "out.xosc")
    schema(minor).assertValid(etree.parse(str(tmp_path / "out.xosc")))
    again = read_scenario(tmp_path / "out.xosc")
    assert [found.name for found in again.storyboard.stories] == ["story", "xosc-lateral"]
    names = [element.get("name") for element in etree.parse(str(tmp_path / "out.xosc")).iter("Act", "ManeuverGroup")]
    assert len(set(names)) == len(names)


def test_offsets_come_out_when_the_lane_offset_scenario_is_played(tmp_path: Path) -> None:
    nothing = "<UserDefinedAction><CustomCommandAction type='nothing'/></UserDefinedAction>"
    stories, init = story(event("nothing", action("nothing", nothing))), private("Ego", teleport(), speed_action("14"))
    scenario = made(tmp_path, stop=time_condition(60), init=init, stories=stories)
    motion = played(scenario, 70.0)
    path = sine_path("Ego")
    reactive(scenario, motion, [path], tmp_path / "out.xosc")
    ego = played(read_scenario(tmp_path / "out.xosc"), 70.0).entities[0]
    # Lane -1 of a right-hand road: the direction of travel is that of s, so +t is left.
    assert ego.offset[0] == pytest.approx(0.2, abs=1e-4)
    driven = ego.s - ego.s[0] - 14.0 * 0.2
    assert np.abs(ego.offset - sine(driven))[driven > 60.0].max() < 0.003  # up to there it takes up its lateral speed
    assert np.abs(ego.s - motion.entities[0].s).max() < 0.02


def test_a_path_by_distance_stands_still_with_its_car_and_goes_on_with_it(tmp_path: Path) -> None:
    """Braking with 8 m/s2 to a stop, for 4 s, and on: no sliding, no turn that anybody sees."""

    def change(value: float, rate: float) -> str:
        return speed_action(str(value)).replace(
            'dynamicsShape="step" dynamicsDimension="time" value="0"',
            f'dynamicsShape="linear" dynamicsDimension="rate" value="{rate}"',
        )

    stories = story(
        event("brake", action("brake", change(0.0, 8.0)), time=5.0),
        event("go", action("go", change(25.0, 4.0)), time=12.0),
    )
    init = private("Ego", teleport(), speed_action("25"))
    scenario = made(tmp_path, stop=time_condition(35), init=init, stories=stories)
    motion = played(scenario, 40.0)
    reactive(scenario, motion, [sine_path("Ego")], tmp_path / "out.xosc")
    ego, nominal_ego = played(read_scenario(tmp_path / "out.xosc"), 40.0).entities[0], motion.entities[0]
    driven = ego.s - ego.s[0] - 0.2 * 25.0
    assert np.abs(ego.offset - sine(driven))[driven > 60.0].max() < 0.003  # up to there it takes up its lateral speed
    still = ego.speed == 0.0
    assert still.sum() > 100 and np.ptp(ego.offset[still]) < 1e-9
    assert np.abs(ego.heading_relative).max() < 0.010
    assert np.abs(ego.s - nominal_ego.s).max() < 0.02


def test_a_path_ends_before_a_place_that_none_leads_over_and_another_begins_behind(tmp_path: Path) -> None:
    """Also for whoever comes there from the other lane; and a run longer than a path goes on with the next."""
    init = private("Ego", teleport(), speed_action("25"))
    scenario = made(tmp_path, stop=time_condition(30), init=init)
    motion = played(scenario, 40.0)
    begin = float(motion.entities[0].s[0])
    first = structs.replace(sine_path("Ego"), ends=(RoadPlace("1", begin + 230.0, -1.75),))
    lanes = tuple(RoadPlace("1", begin + 300.0, t) for t in (-1.75, -5.25))
    second = structs.replace(sine_path("Ego"), placed_t=None, places=lanes)
    second = structs.replace(second, pieces=(second.pieces[0], second.pieces[0]))
    reactive(scenario, motion, [first, second], tmp_path / "out.xosc")
    ego = played(read_scenario(tmp_path / "out.xosc"), 40.0).entities[0]
    driven, moves = ego.s - ego.s[0], np.abs(np.gradient(ego.offset, ego.time)) > 1e-4
    assert moves[(driven > 20.0) & (driven < 80.0)].all()
    assert not moves[(driven > 218.0) & (driven < 297.0)].any()
    assert moves[(driven > 320.0) & (driven < 380.0)].all()


LANE_CHANGE = (
    "<PrivateAction><LateralAction><LaneChangeAction>"
    '<LaneChangeActionDynamics dynamicsShape="sinusoidal" dynamicsDimension="time" value="4"/>'
    '<LaneChangeTarget><AbsoluteTargetLane value="-2"/></LaneChangeTarget>'
    "</LaneChangeAction></LateralAction></PrivateAction>"
)


def test_a_lateral_action_without_a_name_is_referred_to_by_its_event(tmp_path: Path) -> None:
    text = scenario_text(stories=story(event("change", action("", LANE_CHANGE), time=8.0)), stop=time_condition(25))
    found = LateralActions.of(read_scenario(write_scenario(tmp_path, text))).by_entity
    assert [(one.kind, one.reference) for one in found["Ego"]] == [("event", "change")]


def test_a_lane_change_overrules_the_offsets_whenever_it_comes(tmp_path: Path) -> None:
    def text(moment: float) -> str:
        return scenario_text(
            stories=story(event("change", action("change", LANE_CHANGE), time=moment)), stop=time_condition(25)
        )

    scenario = read_scenario(write_scenario(tmp_path, text(8.01)))
    motion = played(scenario, 30.0)
    path = next(p.path for p in motion.actions if p.action.name == "change")
    paths = [sine_path("Ego"), sine_path("Ego", path)]
    reactive(scenario, motion, paths, tmp_path / "out.xosc")
    # The test drive makes the change come 3 s earlier than planned.
    output = tmp_path / "out.xosc"
    output.write_text(output.read_text().replace('value="8.01"', 'value="5.01"'))
    run = played(read_scenario(output), 30.0)
    ego = run.entities[0]
    assert [p.end for p in run.actions if p.action.name == "change"] == [pytest.approx(9.02, abs=0.05)]
    assert ego.lane[np.searchsorted(ego.time, 4.9)] == -1
    after = ego.time > 9.1
    assert set(ego.lane[after].tolist()) == {-2}
    # The second path starts with the end of the change, not at the planned time.
    for begin in (9.5, 17.0):
        rows = (ego.time >= begin) & (ego.time < begin + 8.0)
        assert np.ptp(ego.offset[rows]) > 0.2


def test_a_scenario_that_is_over_at_once_is_refused(tmp_path: Path) -> None:
    scenario = made(tmp_path, stop=time_condition(-1))
    with pytest.raises(PlaybackError, match=r"made.xosc:\d+: StopTrigger: the scenario is over at 0 s"):
        converted(scenario, tmp_path / "out.xosc")
    assert not (tmp_path / "out.xosc").exists()
