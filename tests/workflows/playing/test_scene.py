"""What the player is given: packed small, and the same motion as the result's."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

import xosc_lateral as xl
from tests.kit.enriched import converted, made_enriched
from tests.kit.motion import drive, entity, together, two_roads
from xosc_lateral.workflows.conversion.page import conversion_page
from xosc_lateral.workflows.conversion.result import Enriched
from xosc_lateral.workflows.playing.scene import packed, scene_of
from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.road.geometry import simplify


def unpack(column: dict) -> np.ndarray:
    """The values of a column: what the page's script does."""
    return column["r"] * np.cumsum(column["d"])


@pytest.fixture(scope="module")
def enriched(tmp_path_factory):
    return made_enriched(tmp_path_factory.mktemp("road"))


def enriched_scene(made: Enriched) -> str:
    return scene_of(made.motion, made.network, made.entities)


@pytest.fixture(scope="module")
def scene(enriched):
    return json.loads(enriched_scene(enriched))


@pytest.mark.parametrize("size", [0, 1, 2, 500])
@pytest.mark.parametrize("spread", [1e-4, 0.5, 1e5])
def test_packed_columns_come_back_to_half_the_resolution(size, spread):
    values = np.random.default_rng(1).normal(scale=spread, size=size)
    np.testing.assert_allclose(unpack(packed(values, 1e-3)), values, atol=0.5001e-3)


def test_a_simplified_line_stays_within_the_tolerance():
    angle = np.linspace(0.0, np.pi, 4000)
    x, y = 300.0 * np.cos(angle), 300.0 * np.sin(angle)
    kept = simplify(x, y, 0.01)
    assert len(kept) < 300  # an arc of 942 m allows chords of 4.9 m
    middle = 0.5 * np.hypot(x[kept][1:] + x[kept][:-1], y[kept][1:] + y[kept][:-1])
    assert (300.0 - middle).max() < 0.011


def test_the_scene_holds_the_motion_of_the_result(enriched, scene):
    ego, result = scene["entities"][0], enriched.entity("Ego")
    origin = np.round([result.motion.x[0], result.motion.y[0]])
    np.testing.assert_allclose(unpack(ego["nominal"]["x"]) + origin[0], result.motion.x[::5], atol=1e-3)
    np.testing.assert_allclose(unpack(ego["enriched"]["y"]) + origin[1], result.trajectory.y[::5], atol=1e-3)
    np.testing.assert_allclose(unpack(ego["added"]), result.deviation[::5], atol=1e-3)
    assert (ego["length"], ego["width"], ego["ahead"]) == (5.0, 2.0, 1.4)
    assert "enriched" not in scene["entities"][2]
    assert [tuple(change[1:]) for change in ego["lanes"]] == [("a", -2), ("b", -2)]


def test_lanes_have_their_width(scene):
    driving = [shape for shape in scene["lanes"] if shape["type"] == "driving"]
    widths = set()
    for shape in driving:
        x, y = unpack(shape["x"]), unpack(shape["y"])
        widths.add(round(float(np.hypot(x[0] - x[-1], y[0] - y[-1])), 2))
    assert widths == {3.5}


def test_absence_and_being_placed_anew_are_told(tmp_path):
    network = two_roads(tmp_path)
    activity = np.full(501, int(Activity.ACTIVE), dtype=np.uint8)
    activity[:100] = 0
    activity[300] |= int(Activity.TELEPORTED)
    motion = together(drive(network, entity("Late"), lane=-2, activity=activity))
    (late,) = json.loads(scene_of(motion, network))["entities"]
    assert late["present"] == [[20, 100]]
    assert late["jumps"] == [60]


def test_the_course_is_the_lane_s_and_not_the_car_s(enriched, scene):
    """The van changes lanes on the straight; at the end it drives 18 s on, along the arc of 400 m."""
    van, motion = scene["entities"][1], enriched.entity("Van").motion
    course = unpack(van["course"])
    here = motion.x[::5] < 499.0
    np.testing.assert_allclose(course[here], 0.0, atol=1e-4)
    on_arc = motion.x[::5] > 501.0
    tangent = np.arctan2(motion.x[::5] - 500.0, 400.0 - motion.y[::5])
    np.testing.assert_allclose(course[on_arc], tangent[on_arc], atol=1e-3)


def test_against_the_reference_line_the_course_is_the_way_that_is_driven(tmp_path):
    network = two_roads(tmp_path)
    motion = drive(network, entity("Back"), lane=1, start=50.0)
    (one,) = json.loads(scene_of(together(motion), network))["entities"]
    np.testing.assert_allclose(np.cos(unpack(one["course"]) - motion.heading[::5]), 1.0, atol=1e-6)


def test_ten_cars_for_a_minute_stay_under_a_megabyte(tmp_path):
    """The limit of the whole page's data; the nominal motion doubles as the enriched one."""
    base = made_enriched(tmp_path)
    network = base.network
    starts = [(-1 - k % 3, 30.0 * k) for k in range(10)]
    cars = [
        drive(network, entity(f"Car{k}"), lane=lane, start=start, speed=11.0, duration=60.0)
        for k, (lane, start) in enumerate(starts)
    ]
    wander = np.random.default_rng(1).normal(scale=0.3, size=len(cars[0].time))
    results = tuple(
        replace(
            base.entity("Ego"),
            motion=car,
            deviation=wander,
            trajectory=car.having(x=car.x + wander, y=car.y + wander),
        )
        for car in cars
    )
    made = enriched_scene(replace(base, motion=together(*cars), entities=results))
    assert len(made.encode()) < 1_000_000


def test_the_scripts_are_small_and_load_nothing():
    static = files("xosc_lateral.files.pages").joinpath("static")
    scripts = [path.read_text(encoding="utf-8") for path in static.iterdir() if path.name.endswith(".js")]
    assert sum(len(script.encode()) for script in scripts) < 60_000
    assert not any(word in script for script in scripts for word in ("fetch(", "XMLHttpRequest", "import(", "https://"))


def test_a_name_cannot_end_the_script_that_holds_it(tmp_path):
    network = two_roads(tmp_path)
    scene = scene_of(together(drive(network, entity("</script><img src=x>"))), network)
    assert "</script" not in scene
    assert json.loads(scene)["entities"][0]["name"] == "</script><img src=x>"


def test_a_page_with_no_present_entity_has_an_empty_player(enriched):
    alone = enriched.entity("Slow")
    gone = replace(alone, motion=alone.motion.having(activity=np.zeros_like(alone.motion.activity)))
    nobody = replace(enriched, motion=together(gone.motion), entities=(gone,), gaps_before=(), gaps_after=())
    assert json.loads(enriched_scene(nobody))["entities"] == []
    assert "Player" in conversion_page(converted(nobody))


def test_a_converted_scenario_is_shown_with_its_source_for_as_long_as_that_is_what_it_was_made_from(tmp_path):
    scenario, _ = xl.write_template("cut-in", tmp_path)
    made = xl.convert(scenario, tmp_path / "out" / "lifelike.xosc", seed=1, parameters={"ego_speed": 28})
    frame = made.to_frame().set_index("name")

    def shown() -> dict[str, dict]:
        page = xl.play(made.output).page()
        scene = json.loads(page.split('id="scene">')[1].split("</script>")[0])
        return {one["name"]: one for one in scene["entities"]}

    vehicles = shown()
    assert [name for name, one in vehicles.items() if "enriched" in one] == ["CutIn", "Truck"]
    for name in ("CutIn", "Truck"):
        added, told = unpack(vehicles[name]["added"]), frame.loc[name, "deviation"].to_numpy()[::5]
        assert np.abs(added - told[: len(added)]).max() < 0.02
    scenario.write_text(scenario.read_text() + "<!-- edited -->")
    assert not any("enriched" in one for one in shown().values())
    scenario.unlink()
    assert not any("enriched" in one for one in shown().values())
