"""Lane changes of vehicles that react, led across as drivers take them."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from msgspec import structs
from scipy.stats import beta

import xosc_lateral as xl
from tests.kit.scenario_files import entity, private, scenario_text, speed_action, teleport, write_scenario
from tests.workflows.conversion.test_vehicle_under_test import EXTERNAL
from tests.world.motion.test_crossings import WIDTH, at_end, change, scenario
from tests.world.scenario.test_under_test import event, headway, state, stories
from xosc_lateral.workflows.conversion.ego_drives import with_speeds
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.world.motion.segments import ALPHA, BETA
from xosc_lateral.world.player.player import play

REAL = os.environ.get("ESMINI_LIBRARY")
TRIGGER = headway("Ego", "A").replace('value="1"', 'value="0.9"')
OVER = (
    '<ConditionGroup><Condition name="over" delay="9" conditionEdge="none">'
    f"{state('change', 'completeState')}</Condition></ConditionGroup>"
)
XSD = Path(__file__).resolve().parents[2] / "data/xsd"


def test_a_car_that_an_ego_calls_takes_the_way_of_drivers(tmp_path: Path) -> None:
    path = scenario(tmp_path, trigger=TRIGGER)
    (begin,) = (one.start for one in play_scenario(path).motion.actions if "change" in one.path)
    made = xl.convert(path, tmp_path / "out.xosc", seed=2)
    assert made.modes == {"A": "lane-offset"} and not made.warnings
    assert [line for line in made.notes if "lane change of 'A' at" in line and "is its driver's" in line]
    played = play_scenario(tmp_path / "out.xosc")
    (action,) = (one for one in played.motion.actions if "change" in one.path)
    assert action.start == pytest.approx(begin, abs=0.05) and begin > 3.0
    assert action.end - action.start == pytest.approx(5.0, abs=0.05)  # whoever waits for its end is not kept waiting
    # a sinusoid of 5 s is at a tenth and at nine tenths of its way when the bell is
    tenths, bell = 5.0 / np.pi * np.arccos([0.8, -0.8]), beta(ALPHA, BETA)
    duration = np.ptp(tenths) / np.ptp(bell.ppf([0.1, 0.9]))
    car = next(one for one in played.motion.entities if one.name == "A")
    right = -car.offset + WIDTH * (car.lane[0] - car.lane)
    rows = (car.time > begin) & (car.time < begin + 5.0)
    done = bell.cdf((car.time[rows] - begin - tenths[0]) / duration + bell.ppf(0.1))
    beside = right[rows] - right[rows][0] - WIDTH * done  # what moves the driver in his lane goes on
    assert 0.02 < np.ptp(beside) < 0.6
    assert np.abs(np.diff(beside)).max() < 0.3 * played.motion.step  # [m]: 0.3 m/s
    ends = [end_of(tmp_path, seed) for seed in range(4)]
    assert 0.05 < np.std(ends) < 0.6


def end_of(folder: Path, seed: int) -> float:
    """How far left of the middle of its new lane A is when its lane change is over, with another driver. [m]"""
    xl.convert(folder / "made.xosc", folder / f"{seed}.xosc", seed=seed)
    motion = play_scenario(folder / f"{seed}.xosc").motion
    (action,) = (one for one in motion.actions if "change" in one.path)
    car = next(one for one in motion.entities if one.name == "A")
    return float(np.interp(action.end, car.time, car.offset))


@pytest.mark.parametrize("factor", [0.97, 1.2])
def test_whenever_the_ego_calls_it_ends_in_the_same_lane_and_moves_on_about_its_middle(
    tmp_path: Path, factor: float
) -> None:
    path = scenario(tmp_path, trigger=TRIGGER)
    xl.convert(path, tmp_path / "out.xosc", seed=2)
    played = play_scenario(tmp_path / "out.xosc")
    endless = replace(played.scenario, storyboard=structs.replace(played.scenario.storyboard, stop_trigger=None))
    motion = play(with_speeds(endless, played.motion, ["Ego"], ((1.0, factor, 3.0),)), played.network, time_limit=40.0)
    car = next(one for one in motion.entities if one.name == "A")
    assert car.lane[-1] == -2
    behind = car.time > car.time[np.argmax(car.lane == -2)] + 8.0
    assert np.abs(car.offset[behind]).max() < 0.8 and np.ptp(car.offset[behind]) > 0.02


@pytest.mark.parametrize("version", ["1.0", "1.2"])
def test_the_output_is_valid_and_keeps_event_and_trigger(tmp_path: Path, version: str) -> None:
    path = scenario(tmp_path, trigger=TRIGGER)
    xl.convert(path, tmp_path / "out.xosc", seed=2, version=version)
    root = etree.parse(str(tmp_path / "out.xosc"))
    etree.XMLSchema(etree.parse(str(XSD / f"OpenSCENARIO-{version}.0.xsd"))).assertValid(root)
    (event,) = root.iterfind(".//Event[@name='change']")
    assert event.find(".//FollowTrajectoryAction") is not None and event.find(".//LaneChangeAction") is None
    assert event.find("StartTrigger//TimeHeadwayCondition") is not None


def test_who_waits_for_its_end_is_not_kept_waiting(tmp_path: Path) -> None:
    path = scenario(tmp_path, trigger=TRIGGER)
    path.write_text(path.read_text().replace("<StopTrigger>", f"<StopTrigger>{OVER}"))
    made = xl.convert(path, tmp_path / "out.xosc", seed=2)
    assert not made.warnings and "FollowTrajectoryAction" in (tmp_path / "out.xosc").read_text()
    ends = [play_scenario(one).motion.end_time for one in (path, tmp_path / "out.xosc")]
    assert ends[1] == pytest.approx(ends[0], abs=0.05)


@pytest.mark.pages
def test_what_is_not_known_before_keeps_the_written_way_and_ends_where_its_driver_is(tmp_path: Path) -> None:
    path = scenario(tmp_path, trigger=TRIGGER)
    text = path.read_text()
    assert '<AbsoluteTargetLane value="-2"/>' in text
    path.write_text(
        text.replace('<AbsoluteTargetLane value="-2"/>', '<RelativeTargetLane entityRef="Ego" value="-1"/>')
    )
    made = xl.convert(path, tmp_path / "out.xosc", seed=2)
    assert [line for line in made.notes if "of 'A' at" in line and "that of 'Ego'" in line]
    (kept,) = etree.parse(str(tmp_path / "out.xosc")).iterfind(".//Event[@name='change']//LaneChangeAction")
    assert 0.005 < abs(float(kept.get("targetLaneOffset"))) < 1.0
    ends = [end_of(tmp_path, seed) for seed in range(4)]
    assert 0.05 < np.std(ends) < 0.6


@pytest.mark.skipif(not REAL, reason="ESMINI_LIBRARY names no library of esmini")
def test_esmini_plays_it_as_the_source(tmp_path: Path) -> None:
    path = scenario(tmp_path, trigger=TRIGGER)
    made = xl.convert(path, tmp_path / "out.xosc", seed=2, player_library=REAL)
    assert "RoutingAction" in (tmp_path / "out.xosc").read_text() and not made.warnings


def test_the_lane_of_who_stays_in_one_is_known_before(tmp_path: Path) -> None:
    path = scenario(tmp_path, trigger=TRIGGER)
    text = path.read_text().replace(
        '<AbsoluteTargetLane value="-2"/>', '<RelativeTargetLane entityRef="Stays" value="0"/>'
    )
    stays = private("Stays", teleport("600", "-2"), speed_action("0"))
    text = text.replace("</Entities>", f"{entity('Stays')}</Entities>").replace(
        "</Actions></Init>", f"{stays}</Actions></Init>"
    )
    path.write_text(text)
    made = xl.convert(path, tmp_path / "out.xosc", seed=2)
    assert [line for line in made.notes if "lane change of 'A' at" in line and "is its driver's" in line]


def test_a_lane_change_by_a_rate_keeps_it_in_proportion_to_its_way(tmp_path: Path) -> None:
    path = scenario(tmp_path, trigger=TRIGGER)
    text = path.read_text().replace(
        '<AbsoluteTargetLane value="-2"/>', '<RelativeTargetLane entityRef="Ego" value="-1"/>'
    )
    path.write_text(text.replace('dynamicsDimension="time" value="5"', 'dynamicsDimension="rate" value="1.5"'))
    made = xl.convert(path, tmp_path / "out.xosc", seed=2)
    assert not [line for line in made.notes if "lane changes of 'A'" in line]
    (kept,) = etree.parse(str(tmp_path / "out.xosc")).iterfind(".//Event[@name='change']//LaneChangeActionDynamics")
    assert kept.get("dynamicsDimension") == "rate" and 1.0 < float(kept.get("value")) < 2.0
    lasts = []
    for each in (path, tmp_path / "out.xosc"):
        (action,) = (one for one in play_scenario(each).motion.actions if "change" in one.path)
        lasts.append(action.end - action.start)
    assert lasts[1] == pytest.approx(lasts[0], abs=0.05)


@pytest.mark.pages
def test_only_the_vehicle_whose_way_moves_an_event_keeps_the_written_one(tmp_path: Path) -> None:
    waits = (  # B brakes when A is nearly in its lane, where the bell comes at another time
        "<ByEntityCondition><TriggeringEntities "
        'triggeringEntitiesRule="any"><EntityRef entityRef="B"/></TriggeringEntities><EntityCondition>'
        '<RelativeDistanceCondition entityRef="A" relativeDistanceType="lateral" value="0.4" freespace="false" '
        'rule="lessThan"/></EntityCondition></ByEntityCondition>'
    )
    text = scenario_text(
        entities=entity("Ego", controller=EXTERNAL) + entity("A") + entity("B") + entity("C"),
        init="".join(private(name, teleport(s, lane), speed_action(v))
                     for name, s, lane, v in (("Ego", "20", "-1", "30"), ("A", "60", "-1", "28"),
                                              ("B", "90", "-2", "28"), ("C", "160", "-1", "28"))),
        stories=stories(
            ("A", event("change", TRIGGER, change("sinusoidal", "5"))),
            ("B", event("brake", waits, speed_action("20"))),
            ("C", event("aside", TRIGGER, change("sinusoidal", "5"))),
        ),
        stop=at_end(),
    )  # fmt: skip
    path = write_scenario(tmp_path, text)
    made = xl.convert(path, tmp_path / "out.xosc", seed=2)
    assert [line for line in made.notes if "lane change of 'C'" in line and "its driver's" in line]
    assert [
        line for line in made.notes if "lane changes of 'A'" in line and "with offsets, event 'brake' of 'B' at" in line
    ]
