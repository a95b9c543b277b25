"""Converting scenarios in which controllers of the player drive."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

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
from tests.workflows.conversion.test_vehicle_under_test import CHANGE, _of
from tests.world.scenario.test_controllers import activation, object_controller
from tests.world.scenario.test_under_test import at, event, headway, stories
from xosc_lateral.cli import main
from xosc_lateral.extras.live.call import live_esmini
from xosc_lateral.workflows.conversion.load import play_scenario

LONGITUDINAL = {"longitudinal": "true", "lateral": "false"}
BOTH = {"longitudinal": "true", "lateral": "true"}
needs_esmini = pytest.mark.skipif("ESMINI_LIBRARY" not in os.environ, reason="ESMINI_LIBRARY names no library")


def scenario(
    folder: Path, controller: str, flags: dict[str, str], *, events: str = "", start: bool = True, minor: int = 2
) -> Path:
    """Car has a controller, A brakes when it is near, B changes lanes by the clock.

    An entity named Ego would be under test by its name alone.
    """
    places = {"Car": ("50", "30"), "A": ("130", "25"), "B": ("300", "25")}
    text = scenario_text(
        minor=minor,
        entities="".join(entity(name, controller=controller if name == "Car" else "") for name in places),
        init="".join(
            private(name, teleport(s), speed_action(v), *([activation(**flags)] if name == "Car" and start else []))
            for name, (s, v) in places.items()
        ),
        stories=stories(
            ("Car", event("own", at(1.0), speed_action("31")) + events),
            ("A", event("brake", headway("Car", "A"), speed_action("20"))),
            ("B", event("clock", at(3.0), CHANGE)),
        ),
        stop=time_condition(12),
    )
    return write_scenario(folder, text)


def test_a_car_with_acc_keeps_it_and_its_place_in_the_lane_and_who_depends_on_it_stays_reactive(tmp_path: Path) -> None:
    """A path beside what moves the car along would put it a frame ahead."""
    path = scenario(tmp_path, object_controller("ACCController"), LONGITUDINAL)
    made = xl.convert(path, tmp_path / "out.xosc", seed=2)
    assert made.modes == {"A": "lane-offset", "B": "trajectory"}
    assert "Car: as in the scenario (driven by controller 'ACCController': along the road)" in str(made)
    assert made.ego == () and not made.is_replay and made.warnings == ()
    assert "'Car' is left to controller 'ACCController': along the road" in str(made)
    said = made.to_dict()["controllers"]
    assert said == {"Car": {"controllers": ["'ACCController'"], "drives": "along the road"}}
    assert b"ACCController" in _of(path, "Car")[0] and _of(path, "Car")[0] == _of(made.output or path, "Car")[0]
    assert b'ActivateControllerAction longitudinal="true"' in made.data


@pytest.mark.parametrize("name", ["ALKSController", "our driver", "NaturalDriver"])
def test_a_car_that_a_controller_steers_stays_as_it_is(tmp_path: Path, name: str) -> None:
    flags = LONGITUDINAL if name == "NaturalDriver" else BOTH
    made = xl.convert(scenario(tmp_path, object_controller(name), flags), tmp_path / "out.xosc", seed=2)
    assert made.modes == {"A": "lane-offset", "B": "trajectory"}
    assert f"Car: as in the scenario (driven by controller '{name}': along and across the road)" in str(made)


def test_before_a_controller_steers_and_after_it_the_car_moves_as_any_other(tmp_path: Path) -> None:
    off = {"longitudinal": "false", "lateral": "false"}
    switches = event("on", at(4.0), activation(**BOTH)) + event("off", at(8.0), activation(**off))
    path = scenario(tmp_path, object_controller("our driver"), {}, events=switches, start=False)
    rows = [row for row in xl.segments(path).to_dict()["segments"] if row["entity"] == "Car"]
    assert [row["why"] for row in rows] == ["", "steered by a controller", ""]
    assert [row["start"] for row in rows] == pytest.approx([0.0, 4.0, 8.0], abs=0.05)
    assert "'Car' is driven by controller 'our driver': along and across the road" in str(xl.segments(path))
    assert any("'our driver' along and across the road from 4.02 s on" in note for note in xl.play(path).notes)
    xl.convert(path, tmp_path / "out.xosc", seed=2)
    own = play_scenario(tmp_path / "out.xosc").motion.entities[0]
    spread = [np.ptp(own.offset[(own.time > a) & (own.time < b)]) for a, b in ((0, 4), (4.1, 8), (8.5, 12))]
    assert spread[0] > 0.005 and spread[1] < 1e-9 and spread[2] > 0.005


def test_a_dummy_that_nothing_activates_changes_nothing(tmp_path: Path) -> None:
    path = scenario(tmp_path, object_controller("dummy"), {}, start=False)
    made = xl.convert(path, tmp_path / "out.xosc")
    assert made.is_replay and set(made.modes.values()) == {"trajectory"}
    assert [line for line in made.warnings if "controller 'dummy', which was never active" in line]


def test_a_replay_of_whoever_a_controller_drives_says_so_once_and_strict_refuses(tmp_path: Path) -> None:
    path = scenario(tmp_path, object_controller("ACCController"), LONGITUDINAL)
    for options in ({"ego": "none"}, {"mode": "trajectory"}):
        made = xl.convert(path, tmp_path / "out.xosc", **options, force=True)
        assert made.is_replay and set(made.modes) == {"Car", "A", "B"}
        (line,) = made.warnings
        assert "'Car' follows a trajectory: controller 'ACCController': along the road" in line
    words = ["convert", str(path), "-o", str(tmp_path / "out.xosc"), "--ego", "none", "-q"]
    assert (main(words), main([*words, "--strict"])) == (0, 1)


def test_a_replay_moves_a_car_also_where_a_controller_would_steer(tmp_path: Path) -> None:
    made = xl.convert(scenario(tmp_path, object_controller("our driver"), BOTH), ego="none")
    assert made.modes["Car"] == "trajectory"


def test_for_carla_a_driven_car_is_left_as_it_is(tmp_path: Path) -> None:
    path = scenario(tmp_path, object_controller("ACCController"), LONGITUDINAL, minor=0)
    made = xl.convert(path, tmp_path / "out.xosc", player="carla")
    assert "Car" not in made.modes and made.modes["B"] == "trajectory"
    assert "Car: as in the scenario (driven by controller 'ACCController': along the road)" in str(made)


@needs_esmini
def test_in_esmini_a_car_with_acc_drives_as_in_the_source_and_live_leaves_it_alone(tmp_path: Path) -> None:
    path = scenario(tmp_path, object_controller("ACCController"), LONGITUDINAL)
    xl.convert(path, tmp_path / "out.xosc", seed=2)
    runs = []
    for file in (path, tmp_path / "out.xosc"):
        # Everybody counts as under test, so that nobody of ours drives: esmini's own run of the file.
        frame = live_esmini(file, os.environ["ESMINI_LIBRARY"], ego=["Car", "A", "B"], duration=11.0).to_frame()
        runs.append(frame[frame.name == "Car"])
    assert np.ptp(runs[0].speed) > 3.0  # it follows A, which the default driver would not
    assert np.abs(runs[0].s.to_numpy() - runs[1].s.to_numpy()).max() < 0.02
    alone = live_esmini(path, os.environ["ESMINI_LIBRARY"], duration=5.0).to_frame()
    assert set(alone[alone.steered].name) == {"A", "B"}
