"""Converting a scenario in which a system drives one of the vehicles."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from msgspec import structs

import xosc_lateral as xl
from tests.kit.scenario_files import (
    entity,
    private,
    scenario_text,
    speed_action,
    teleport,
    time_condition,
    write_scenario,
)
from tests.world.scenario.test_under_test import at, controller, event, headway, state, stories
from xosc_lateral.cli import main
from xosc_lateral.workflows.batch.manifest import read_manifest
from xosc_lateral.workflows.conversion.ego_drives import with_speeds
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.player.player import play

CHANGE = (
    '<PrivateAction><LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="sinusoidal" '
    'dynamicsDimension="time" value="3"/><LaneChangeTarget><AbsoluteTargetLane value="-2"/></LaneChangeTarget>'
    "</LaneChangeAction></LateralAction></PrivateAction>"
)
SWERVE = (
    '<PrivateAction><LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics '
    'dynamicsShape="sinusoidal" maxLateralAcc="0.05"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="0.4"/>'
    "</LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"
)
TRAVELLED = (
    '<ConditionGroup><Condition name="far" delay="0" conditionEdge="none"><ByEntityCondition><TriggeringEntities '
    'triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/></TriggeringEntities><EntityCondition>'
    '<TraveledDistanceCondition value="250"/></EntityCondition></ByEntityCondition></Condition></ConditionGroup>'
)
EXTERNAL = controller("esminiController", "ExternalController")


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """A brakes when Ego is near it, B drives by the clock, C by nothing at all."""
    names = ("Ego", "A", "B", "C")
    places = dict(zip(names, ("50", "110", "300", "400"), strict=True))
    text = scenario_text(
        entities="".join(entity(name, controller=EXTERNAL if name == "Ego" else "") for name in names),
        init="".join(
            private(name, teleport(places[name]), speed_action("30" if name == "Ego" else "25")) for name in names
        ),
        stories=stories(
            ("Ego", event("own", at(1.0), speed_action("31"))),
            ("A", event("brake", headway("Ego", "A"), speed_action("20"))),
            ("B", event("clock", at(3.0), CHANGE)),
        ),
        stop=time_condition(12),
    )
    return write_scenario(tmp_path, text)


def _of(path: Path, name: str) -> list[bytes]:
    """What a file says of an entity."""
    root = etree.parse(str(path)).getroot()
    parts = root.xpath(
        "//ScenarioObject[@name=$n] | //Private[@entityRef=$n]"
        " | //ManeuverGroup[Actors/EntityRef/@entityRef=$n][not(starts-with(@name, 'xosc-lateral'))]",
        n=name,
    )
    return [etree.tostring(part, with_tail=False) for part in parts]


def test_a_vehicle_under_test_is_left_byte_for_byte_and_each_other_written_by_what_moves_it(
    scenario: Path, tmp_path: Path
) -> None:
    made = xl.convert(scenario, tmp_path / "out.xosc", seed=2)
    assert made.ego == ("Ego",)
    assert made.modes == {"A": "lane-offset", "B": "trajectory", "C": "trajectory"}
    assert _of(tmp_path / "out.xosc", "Ego") == _of(scenario, "Ego")
    assert not made.is_replay
    assert "under test, left as written: Ego" in str(made)
    text = (tmp_path / "out.xosc").read_text()
    assert text.count("<Timing ") == 2 and text.count("<None/>") == 1  # B, C; A brakes: a path without times
    assert "<TimeHeadwayCondition" in text and "<LaneChangeAction>" not in text
    again = {one.name: one for one in play_scenario(tmp_path / "out.xosc").motion.entities}
    for name in ("B", "C"):
        path = made.movement.entity(name).trajectory
        n = min(len(path.time), len(again[name].time))
        assert np.hypot(again[name].x[:n] - path.x[:n], again[name].y[:n] - path.y[:n]).max() < 0.05


def test_without_a_vehicle_under_test_everything_is_replayed_and_that_is_said(scenario: Path) -> None:
    made = xl.convert(scenario, ego="none")
    assert made.ego == () and made.is_replay
    assert set(made.modes.values()) == {"trajectory"}
    assert "no vehicle under test: everything is replayed" in str(made)


def test_triggers_and_motion_of_whoever_was_not_chosen_stay(scenario: Path, tmp_path: Path) -> None:
    for mode in ("auto", "trajectory"):
        made = xl.convert(scenario, tmp_path / "out.xosc", only=["C"], mode=mode, ego="none", force=True)
        assert made.modes == {"C": "trajectory"}
        for name in ("Ego", "A", "B"):
            assert _of(tmp_path / "out.xosc", name) == _of(scenario, name)


def test_a_trajectory_that_freezes_a_trigger_says_which_and_strict_refuses(scenario: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.xosc"
    made = xl.convert(scenario, output, mode="trajectory")
    assert [line for line in made.warnings if "depends on a vehicle under test" in line and "'brake when'" in line]
    words = ["convert", str(scenario), "-o", str(output), "--mode", "trajectory", "-q"]
    assert (main(words), main([*words, "--strict"])) == (0, 1)


def test_a_vehicle_whose_maneuvers_others_wait_for_keeps_them(tmp_path: Path) -> None:
    text = scenario_text(
        entities=entity("Ego", controller=EXTERNAL) + entity("B"),
        init=private("Ego") + private("B", teleport("200"), speed_action("25")),
        stories=stories(
            ("Ego", event("own", state("clock", "completeState"), speed_action("31"))),
            ("B", event("clock", at(3.0), CHANGE)),
        ),
    )
    path = write_scenario(tmp_path, text)
    assert xl.convert(path, tmp_path / "auto.xosc").modes == {"B": "lane-offset"}
    frozen = xl.convert(path, tmp_path / "trajectory.xosc", mode="trajectory")
    assert any("waited for 'clock'" in line for line in frozen.warnings)
    starts = [one.start for one in play_scenario(path).motion.actions if one.path[-2:-1] == ("own",)]
    again = play_scenario(tmp_path / "trajectory.xosc").motion
    assert len(starts) == 1
    assert [one.start for one in again.actions if one.path[-2:-1] == ("own",)] == pytest.approx(starts, abs=0.05)


def test_lane_offsets_go_on_for_as_long_as_the_segment_lasts(scenario: Path, tmp_path: Path) -> None:
    xl.convert(scenario, tmp_path / "out.xosc", mode="lane-offset", seed=1)
    played = play_scenario(tmp_path / "out.xosc")
    endless = replace(played.scenario, storyboard=structs.replace(played.scenario.storyboard, stop_trigger=None))
    slower = with_speeds(endless, played.motion, ["Ego"], ((1.0, 0.8, 3.0),))
    motion = play(slower, played.network, step=0.02, time_limit=22.0)
    for one in motion.entities:
        for start in () if one.name == "Ego" else (12, 17):
            rows = (one.time >= start) & (one.time < start + 5)
            assert np.ptp(one.offset[rows]) > 0.005, (one.name, start)
        assert one.name != "Ego" or np.ptp(one.offset) < 1e-9


@pytest.mark.parametrize("player", ["standard", "carla"])
def test_a_longer_run_is_not_one_that_was_cut_off_and_a_replay_ends_when_it_did(tmp_path: Path, player: str) -> None:
    text = scenario_text(
        entities=entity("Ego", controller=EXTERNAL) + entity("A"),
        init=private("Ego", teleport("50"), speed_action("30")) + private("A", teleport("110"), speed_action("25")),
        stories=stories(("A", event("late", at(100.0), speed_action("20")))),
        stop=TRAVELLED,
    )
    path = write_scenario(tmp_path, text)
    nominal = xl.play(path)
    assert nominal.ended_by == "stop trigger"
    made = xl.convert(path, tmp_path / "out.xosc", seed=1, player=player)
    assert made.cut_off is None and not any("time limit" in line for line in (*made.warnings, str(made.to_dict())))
    if player == "carla":
        ends = re.findall(
            r'<SimulationTimeCondition value="([^"]+)"', (tmp_path / "out.xosc").read_text().split("</Story>")[-1]
        )
        assert [float(end) for end in ends] == [pytest.approx(nominal.end_time, abs=0.02)]
    else:
        assert made.end_time == pytest.approx(1.3 * nominal.end_time, abs=0.02)


def test_an_own_action_that_lasts_longer_from_beside_the_middle_is_explained_and_said(tmp_path: Path) -> None:
    """An own lane offset action lasts as long as the way to its target asks for; what waits for its end moves by that.

    By its acceleration: as the root of the way. Nothing is left out for it.
    """
    text = scenario_text(
        entities=entity("Ego", controller=EXTERNAL) + entity("A"),
        init=private("Ego") + private("A", teleport("200"), speed_action("25")),
        stories=stories(
            ("A", event("swerve", at(4.0), SWERVE) + event("then", state("swerve", "completeState"), CHANGE))
        ),
        stop=time_condition(25),
    )
    path = write_scenario(tmp_path, text)
    made = xl.convert(path, tmp_path / "out.xosc", mode="lane-offset", profile="motorway", seed=5)
    assert made.modes == {"A": "lane-offset"}
    swerve, then = (next(one for one in made.shifts if one.event == name) for name in ("swerve", "then"))
    run = play_scenario(tmp_path / "out.xosc").motion
    start = next(one.start for one in run.actions if one.path[-2:-1] == ("swerve",))
    own = next(one for one in run.entities if one.name == "A")
    way = 0.4 - own.offset[np.searchsorted(own.time, start)]
    assert swerve.end == pytest.approx(swerve.duration * (np.sqrt(way / 0.4) - 1.0), abs=0.05)
    assert then.start == pytest.approx(swerve.end, abs=0.05)
    assert abs(swerve.unexplained_end) <= 0.05 and abs(then.unexplained_start) <= 0.05
    assert abs(swerve.end) > 0.05
    assert made.to_dict()["shifts"][0]["event"] == "swerve"
    # Also where nothing is written.
    again = xl.convert(path, mode="lane-offset", profile="motorway", seed=5)
    assert again.shifts == made.shifts and again.data == (tmp_path / "out.xosc").read_bytes()


def _near(tmp_path: Path, speed: str, *events: str) -> Path:
    """A changes to the right when Ego comes near it from behind."""
    text = scenario_text(
        entities=entity("Ego", controller=EXTERNAL) + entity("A"),
        init=private("Ego", teleport("50"), speed_action(speed)) + private("A", teleport("110"), speed_action("27")),
        stories=stories(("A", event("change", headway("Ego", "A"), CHANGE) + "".join(events))),
        stop=time_condition(25),
    )
    return write_scenario(tmp_path, text)


def _driven(source: Path, output: Path, factor: float) -> NominalMotion:
    played = play_scenario(output)
    faster = with_speeds(played.scenario, play_scenario(source).motion, ["Ego"], ((1.0, factor, 3.0),))
    return play(faster, played.network, step=0.01)


def test_a_lane_change_that_the_nominal_run_does_not_come_to_is_given_away_by_no_calm_and_movement_follows_it(
    tmp_path: Path,
) -> None:
    path = _near(tmp_path, "25")
    assert not [one for one in play_scenario(path).motion.actions if one.path[-2:-1] == ("change",)]
    assert xl.convert(path, tmp_path / "out.xosc", seed=2).modes == {"A": "lane-offset"}
    motion = _driven(path, tmp_path / "out.xosc", 1.2)
    (change,) = [one for one in motion.actions if one.path[-2:-1] == ("change",)]
    own = next(one for one in motion.entities if one.name == "A")
    before, after = own.time < change.start - 0.005, own.time > change.end + 0.2
    speed = np.gradient(own.offset, own.time)
    calm = [np.sqrt(np.mean(speed[before & (own.time > begin)] ** 2)) for begin in (0.2, change.start - 5.0)]
    assert calm[1] > 0.5 * calm[0] > 0.01
    for start in (change.end + 0.2, change.end + 6.0):
        assert np.ptp(own.offset[after & (own.time > start) & (own.time < start + 5.0)]) > 0.005
    assert set(own.lane[after].tolist()) == {-2}


def test_a_lane_change_that_is_given_up_for_another_leaves_that_to_its_end(tmp_path: Path) -> None:
    back = event("back", state("change", "startTransition"), CHANGE.replace('value="-2"', 'value="-1"'))
    path = _near(tmp_path, "30", back.replace('name="back when" delay="0"', 'name="back when" delay="1.5"'))
    made = xl.convert(path, tmp_path / "out.xosc", seed=1)
    assert made.modes == {"A": "lane-offset"} and not [line for line in made.warnings if "offsets" in line]
    for factor in (1.0, 1.2):
        runs = [_driven(path, one, factor) for one in (path, tmp_path / "out.xosc")]
        spans = [
            {one.path[-2]: (one.start, one.end) for one in run.actions if one.path[-2:-1] in (("change",), ("back",))}
            for run in runs
        ]
        assert spans[0].keys() == spans[1].keys() == {"change", "back"}
        for name, span in spans[0].items():
            assert spans[1][name] == pytest.approx(span, abs=0.05), (factor, name)
        assert [run.entities[1].lane[-1] for run in runs] == [-1, -1]


def test_a_name_that_some_scenarios_of_a_folder_lack_applies_where_it_exists(
    scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    for name in ("road.xodr", "made.xosc"):
        (folder / name).write_bytes((tmp_path / name).read_bytes())
    other = re.sub(r'"C"', '"D"', (folder / "made.xosc").read_text())
    (folder / "other.xosc").write_text(other)
    words = ["convert", str(folder), "-o", str(tmp_path / "out"), "-q"]
    assert main([*words, "--enrich", "C"]) == 0
    rows = {row.scenario: row for row in read_manifest(tmp_path / "out" / "manifest.parquet")}
    assert rows["made.xosc"].enriched == ("C",) and rows["other.xosc"].enriched == ()
    assert rows["made.xosc"].only == ("C",) and rows["made.xosc"].ego == ("Ego",)
    assert (rows["made.xosc"].mode, rows["other.xosc"].mode) == ("trajectory", "")
    assert main([*words, "--enrich", "Nobody"]) == 1
    assert "no scenario has such an entity" in capsys.readouterr().err


def test_a_table_and_a_configuration_name_vehicles_under_test(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = tmp_path / "table.csv"
    table.write_text("scenario,ego,seed\nmade.xosc,none,1\nmade.xosc,B;Ego,2\n")
    assert main(["convert", str(table), "-o", str(tmp_path / "out"), "-q"]) == 0
    assert sorted(row.ego for row in read_manifest(tmp_path / "out" / "manifest.parquet")) == [(), ("Ego", "B")]
    (tmp_path / "xosc-lateral").mkdir()
    (tmp_path / "xosc-lateral" / "config.toml").write_text('ego = ["A"]\n')
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert xl.convert(scenario).ego == ("Ego", "A")


def test_a_vehicle_under_test_can_not_be_enriched_and_none_stands_alone(
    scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["convert", str(scenario), "-o", str(tmp_path / "out.xosc")]
    assert main([*words, "--enrich", "Ego"]) == 1
    assert "--ego none" in capsys.readouterr().err
    assert main([*words, "--ego", "none", "--ego", "A"]) == 2


@pytest.mark.pages
def test_who_is_called_ego_is_left_as_it_is_and_said(
    scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = scenario.read_text()
    scenario.write_text(text.replace(EXTERNAL, "").replace('"Ego"', '"VUT"'))
    converted = xl.convert(scenario, tmp_path / "out.xosc")
    assert converted.ego == ("VUT",) and _of(tmp_path / "out.xosc", "VUT") == _of(scenario, "VUT")
    assert "under test, left as written: VUT (by its name)" in str(converted)
    assert "VUT" in xl.convert(scenario, ego="none").enriched
    assert xl.convert(scenario, ego=["A"]).ego == ("A",), "who names one means this one"
    scenario.write_text(text.replace('"C"', '"hero"'))
    assert main(["convert", str(scenario), "-o", str(tmp_path / "two.xosc"), "--strict"]) == 1
    assert "'hero' is called like a vehicle under test, but 'Ego' (controller" in capsys.readouterr().out
    assert main(["convert", str(scenario), "-o", str(tmp_path / "two.xosc"), "--ego", "Ego"]) == 0
    assert "is called like" not in capsys.readouterr().out


def test_a_folder_sums_up_who_is_under_test(scenario: Path, tmp_path: Path) -> None:
    text = scenario.read_text().replace(EXTERNAL, "")
    for k, name in enumerate(("Ego", "Ego", "hero", "Nobody")):
        scenario.with_name(f"case{k}.xosc").write_text(text.replace('"Ego"', f'"{name}"'))
    scenario.unlink()
    batch = xl.convert_many(scenario.parent, tmp_path / "out", workers=0)
    assert "under test, left as written: Ego in 2, hero in 1, nobody in 1" in str(batch)


def _moves_on(path: Path, name: str, *moments: int) -> list[bool]:
    """Whether a vehicle moves sideways in the 4 s from each moment on when a scenario is played."""
    vehicle = next(entity for entity in play_scenario(path).motion.entities if entity.name == name)
    windows = [(vehicle.time >= moment) & (vehicle.time < moment + 4.0) for moment in moments]
    return [bool(np.ptp(vehicle.offset[rows]) > 0.01) for rows in windows]


def test_movement_goes_on_after_a_lane_change_that_is_stopped_half_way(tmp_path: Path) -> None:
    stopping = event("stopping", at(4.5), speed_action("24")).replace("parallel", "override")
    text = scenario_text(
        entities=entity("Ego", controller=EXTERNAL) + entity("A"),
        init=private("Ego") + private("A", teleport("200"), speed_action("25")),
        stories=stories(("A", event("change", at(3.0), CHANGE) + stopping)),
        stop=time_condition(25),
    )
    path = write_scenario(tmp_path, text)
    run = play_scenario(path).motion
    assert next(one.end for one in run.actions if one.path[-2:-1] == ("change",)) == pytest.approx(4.5, abs=0.05)
    xl.convert(path, tmp_path / "out.xosc", mode="lane-offset", seed=1)
    assert _moves_on(path, "A", 6, 12, 20) == [False, False, False]
    assert _moves_on(tmp_path / "out.xosc", "A", 6, 12, 20) == [True, True, True]


def test_a_vehicle_that_is_added_later_moves_from_then_on(tmp_path: Path) -> None:
    adding = (
        '<GlobalAction><EntityAction entityRef="Late"><AddEntityAction><Position><LanePosition roadId="1" laneId="-2" '
        's="150"/></Position></AddEntityAction></EntityAction></GlobalAction>'
    )
    text = scenario_text(
        entities=entity("Ego", controller=EXTERNAL) + entity("Late"),
        init=private("Ego"),
        stories=stories(
            ("Late", event("add", at(3.0), adding) + event("go", state("add", "completeState"), speed_action("25")))
        ),
        stop=time_condition(25),
    )
    path = write_scenario(tmp_path, text)
    made = xl.convert(path, tmp_path / "out.xosc", mode="lane-offset", seed=1)
    assert made.modes == {"Late": "lane-offset"}
    assert _moves_on(tmp_path / "out.xosc", "Late", 6, 12, 20) == [True, True, True]


def test_a_vehicle_that_steadily_is_slow_moves_although_its_speed_may_change(tmp_path: Path) -> None:
    text = scenario_text(
        entities=entity("Ego", controller=EXTERNAL) + entity("A"),
        init=private("Ego") + private("A", teleport("200"), speed_action("12")),
        stories=stories(
            ("A", event("change", at(3.0), CHANGE) + event("late", headway("Ego", "A"), speed_action("12")))
        ),
        stop=time_condition(25),
    )
    xl.convert(write_scenario(tmp_path, text), tmp_path / "out.xosc", mode="lane-offset", seed=1)
    assert _moves_on(tmp_path / "out.xosc", "A", 8, 14, 20) == [True, True, True]


FIELD = Path(__file__).resolve().parents[4] / "shared" / "cases" / "field"


@pytest.mark.skipif(not FIELD.is_dir(), reason="no shared cases")
@pytest.mark.parametrize(
    ("case", "told"),
    [
        ("event_of_ego_added_is_not_said/lat_fire_more", "event 'brake' of 'Ego' at 0.02 s is new with the offsets"),
        ("left_as_written_rides_on_converted/load1", "'bike' is up to 10.9"),
    ],
)
def test_what_only_an_output_does_and_who_rides_on_others_is_told_with_its_run(case: str, told: str) -> None:
    lines = [line for line in xl.convert(FIELD / f"{case}.xosc", seed=1).warnings if told in line]
    assert len(lines) == 1 and lines[0].endswith("(run: nominal)")
