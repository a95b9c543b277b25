"""One scenario told in several ways: in a mirror, on roads drawn from their other end, elsewhere on the map."""

from __future__ import annotations

import shutil
from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree

from tests.kit import stage
from tests.kit.places import VALID, wrapped
from tests.kit.retold_roads import mirrored, moved, turned_round
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.workflows.conversion.load import Played, play_scenario
from xosc_lateral.world.motion.nominal import EntityMotion, NominalMotion

ALONG_T = {
    "LanePosition": ("laneId", "offset"),
    "RelativeLanePosition": ("dLane", "offset"),
    "RoadPosition": ("t",),
    "RelativeRoadPosition": ("dt",),
    "FromRoadCoordinates": ("t",),
    "FromLaneCoordinates": ("laneId", "laneOffset"),
    "AbsoluteTargetLane": ("value",),
    "AbsoluteTargetLaneOffset": ("value",),
    "RelativeTargetLaneOffset": ("value",),
    "LaneChangeAction": ("targetLaneOffset",),
}
"""Attributes that count along the t-axis of a road, or are ids of its lanes."""
TO_THE_LEFT = {
    "WorldPosition": ("y", "h", "r"),
    "RelativeWorldPosition": ("dy",),
    "RelativeObjectPosition": ("dy",),
    "RelativeTargetLane": ("value",),
    "Orientation": ("h", "r"),
    "Center": ("y",),
    "TrajectoryPosition": ("t",),
    "Clothoid": ("curvature", "curvatureDot", "curvaturePrime"),
    "ClothoidSplineSegment": ("curvatureStart", "curvatureEnd", "hOffset"),
}
"""Attributes that count to the left of a vehicle or a path, or along y."""
SIDES = {"leftToReferencedEntity": "rightToReferencedEntity", "rightToReferencedEntity": "leftToReferencedEntity"}


def _negate(root: Any, table: dict[str, tuple[str, ...]]) -> None:
    for element in root.iter(*table):
        for name in table[element.tag]:
            if element.get(name) is not None:
                element.set(name, _negative(element.get(name)))


def _negative(text: str) -> str:
    """Of a number, a parameter or an expression; a lane's id stays a whole number."""
    if text.startswith("$"):
        return f"${{-1 * ({text[2:-1] if text.startswith('${') else text})}}"
    return text[1:] if text.startswith("-") else f"-{text}"


def in_the_mirror(root: Any) -> None:
    _negate(root, ALONG_T | TO_THE_LEFT)
    for action in root.iter("LateralDistanceAction"):
        action.set("displacement", SIDES.get(action.get("displacement"), "any"))
    for lanes in root.iter("RelativeLaneRange"):
        ends = {"to": lanes.attrib.pop("from", None), "from": lanes.attrib.pop("to", None)}
        for name, lane in ends.items():
            if lane is not None:
                lanes.set(name, _negative(lane))


def on_turned_roads(root: Any, lengths: dict[str, float]) -> None:
    """Lanes, offsets and s as the other end counts them; what is relative to a vehicle stays."""
    assert not list(root.iter("RelativeLanePosition", "RelativeRoadPosition"))
    _negate(root, ALONG_T)
    for place in root.iter("LanePosition", "RoadPosition"):
        place.set("s", repr(lengths[place.get("roadId")] - float(place.get("s"))))


def told_again(played: Played, folder: Path, change_road: Any, change_scenario: Any) -> NominalMotion:
    """The same files, changed and played."""
    folder.mkdir()
    for path, change in ((played.scenario.path, change_scenario), (played.scenario.road_file, change_road)):
        tree = etree.parse(str(path))
        change(tree.getroot())
        tree.write(str(folder / path.name))
    return play_scenario(folder / played.scenario.path.name).motion


def the_same(one: NominalMotion, other: NominalMotion) -> list[tuple[EntityMotion, EntityMotion]]:
    """Entities of both, once it is sure that the same happened at the same times."""
    assert other.end_time == one.end_time and other.ended_by == one.ended_by
    assert [(a.path, a.start, a.end) for a in other.actions] == [(a.path, a.start, a.end) for a in one.actions]
    return list(zip(one.entities, other.entities, strict=True))


# ---- scenarios -------------------------------------------------------------------------------------------------------
def bends(folder: Path) -> Played:
    """Bends to either side; a lane change, offsets, a swerve beside another, oncoming traffic, a drive along points."""
    road = (VALID / "arcs.xodr").read_text(encoding="utf-8")
    ego = stage.maneuvers(
        stage.event(stage.lane_change(stage.to_lane(-2), over=3.0), name="change", trigger=stage.after(1.0)),
        stage.event(
            stage.lane_offset('<AbsoluteTargetLaneOffset value="0.4"/>', acceleration=1.0),
            name="aside",
            trigger=stage.when(stage.state_of("change", "completeState")),
        ),
    )
    beside = stage.maneuvers(
        stage.event(
            stage.lane_change(stage.by_lanes(0), shape="cubic", over=2.5, offset=-0.3),
            name="join",
            trigger=stage.after(2.0),
        ),
        actors=("Beside",),
        name="beside",
    )
    oncoming = stage.maneuvers(
        stage.event(
            stage.lane_offset('<AbsoluteTargetLaneOffset value="-0.5"/>'), name="swerve", trigger=stage.after(1.5)
        ),
        actors=("Oncoming",),
        name="oncoming",
    )
    return stage.Stage(folder, road).play(
        ego,
        beside,
        oncoming,
        start={
            "Ego": stage.teleport(stage.on_lane(-1, 20.0, road="1", offset=0.2)) + stage.speed(15.0),
            "Beside": stage.teleport(stage.on_lane(-2, 45.0, road="1")) + stage.speed(14.0),
            "Oncoming": stage.teleport(stage.on_lane(1, 150.0, road="1", offset=-0.2)) + stage.speed(12.0),
        },
        last=7.0,
    )


def crossing(folder: Path) -> Played:
    """Over a junction, onto a road that is drawn the other way."""
    road = (VALID / "junction.xodr").read_text(encoding="utf-8")
    return stage.Stage(folder, road).play(
        stage.maneuvers(stage.event(stage.speed(6.0, "linear", over=3.0), trigger=stage.after(1.0))),
        start={
            "Ego": stage.teleport(stage.on_lane(-1, 70.0, road="west")) + stage.speed(14.0),
            "South": stage.teleport(stage.on_lane(-1, 40.0, road="south", offset=0.3)) + stage.speed(12.0),
        },
        last=7.0,
    )


def cut_in(folder: Path) -> Played:
    from xosc_lateral.files.templates import find_template

    for name, text in find_template("cut-in").files({"start_gap": "20", "duration": "20"}).items():
        (folder / name).write_text(text, encoding="utf-8")
    return play_scenario(folder / "cut-in.xosc")


SCENARIOS = {"bends": bends, "crossing": crossing, "cut-in": cut_in}


@pytest.fixture(scope="module", params=list(SCENARIOS))
def played(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Played:
    return SCENARIOS[request.param](tmp_path_factory.mktemp(request.param))


# ---- tellings --------------------------------------------------------------------------------------------------------
def test_a_mirrored_scenario_is_played_as_the_mirror_of_it(played: Played, tmp_path: Path) -> None:
    there = told_again(played, tmp_path / "mirror", mirrored, in_the_mirror)
    for one, other in the_same(played.motion, there):
        np.testing.assert_allclose(other.x, one.x, atol=1e-6)
        np.testing.assert_allclose(other.y, -one.y, atol=1e-6)
        assert np.abs(wrapped(other.heading + one.heading)).max() < 1e-6
        np.testing.assert_allclose(other.offset, -one.offset, atol=1e-6)
        np.testing.assert_allclose(other.speed, one.speed, atol=1e-9)
        assert (other.lane == -one.lane).all() and (other.activity == one.activity).all()


def test_on_roads_drawn_from_their_other_end_everybody_drives_the_same_way(played: Played, tmp_path: Path) -> None:
    network = read_opendrive(played.scenario.road_file)
    lengths = {road.id: road.length for road in network.roads}
    there = told_again(
        played,
        tmp_path / "turned",
        lambda root: turned_round(root, network),
        lambda root: on_turned_roads(root, lengths),
    )
    for one, other in the_same(played.motion, there):
        np.testing.assert_allclose(other.x, one.x, atol=1e-5)
        np.testing.assert_allclose(other.y, one.y, atol=1e-5)
        assert np.abs(wrapped(other.heading - one.heading)).max() < 1e-4  # in one row on a seam
        np.testing.assert_allclose(other.offset, one.offset, atol=1e-5)
        assert (other.lane == -one.lane).mean() > 0.99  # on a seam either road is right


def test_a_scenario_is_played_alike_at_the_coordinates_of_a_map(played: Played, tmp_path: Path) -> None:
    x, y, turn = 5.5e5, -4.8e6, 0.7
    there = told_again(played, tmp_path / "moved", lambda root: moved(root, x, y, turn), lambda root: None)
    for one, other in the_same(played.motion, there):
        np.testing.assert_allclose(other.x, x + one.x * cos(turn) - one.y * sin(turn), atol=1e-5)
        np.testing.assert_allclose(other.y, y + one.x * sin(turn) + one.y * cos(turn), atol=1e-5)
        np.testing.assert_allclose(other.offset, one.offset, atol=1e-5)


PUBLIC = (
    "cut-in.xosc", "distance_test.xosc", "highway_merge.xosc", "keep_lateral_distance.xosc",
    "lane-change_clothoid_spline_based_trajectory.xosc", "lane_change_crest.xosc", "left-hand-traffic_by_heading.xosc",
    "ltap-od.xosc", "routing-test.xosc", "synchronize.xosc", "trajectory-test.xosc", "two_plus_one_road.xosc",
)  # fmt: skip


@pytest.mark.parametrize("name", PUBLIC)
def test_public_scenarios_are_played_as_their_mirrors(name: str, shared: Path, tmp_path: Path) -> None:
    """Routes, trajectories, relative positions, parameters: whatever people write."""
    (found,) = (shared / "corpus" / "esmini").rglob(name)
    played = play_scenario(found, time_limit=8.0)
    folder = tmp_path / "esmini"
    shutil.copytree(shared / "corpus" / "esmini", folder)
    here = folder / found.relative_to(shared / "corpus" / "esmini")
    road = folder / played.scenario.road_file.resolve().relative_to((shared / "corpus" / "esmini").resolve())
    catalogs = [(path, in_the_mirror) for path in (folder / "xosc" / "Catalogs").rglob("*.xosc")]
    for path, change in ((here, in_the_mirror), (road, mirrored), *catalogs):
        tree = etree.parse(str(path))
        change(tree.getroot())
        tree.write(str(path))
    for one, other in the_same(played.motion, play_scenario(here, time_limit=8.0).motion):
        np.testing.assert_allclose(other.x, one.x, atol=1e-3)
        np.testing.assert_allclose(other.y, -one.y, atol=1e-3)
