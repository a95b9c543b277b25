"""Range of vision: rays against an independent geometry library, and the closed form on a straight road."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import xosc_lateral as xl
from tests.kit.lane_tracks import WIDTH, scene, track
from xosc_lateral.cli import main
from xosc_lateral.extras.detect.sight import Boxes, moments_of, points_seen, visible_share

SCHEMA = Path(__file__).parents[3] / "docs" / "schemas" / "detect-sight.json"
LENGTH, AHEAD = 4.6, 1.4  # of the kit's vehicles; their middle before the reference point


def some_boxes(rng: np.random.Generator, n: int = 7) -> Boxes:
    """Boxes that do not overlap, before the origin."""
    x = 12.0 * (1.0 + np.arange(n)) + rng.uniform(-2, 2, n)
    return Boxes(x, rng.uniform(-4, 4, n), rng.uniform(-0.5, 0.5, n), rng.uniform(3.5, 6, n), rng.uniform(1.5, 2.5, n))


@pytest.mark.parametrize("seed", range(6))
def test_what_is_seen_is_what_an_independent_library_sees(seed):
    geometry = pytest.importorskip("shapely")
    rng = np.random.default_rng(seed)
    boxes, origin = some_boxes(rng), np.array([0.0, rng.uniform(-1, 1)])
    polygons = [geometry.Polygon(corners) for corners in boxes.corners()]
    start = geometry.Point(origin)
    for target, polygon in enumerate(polygons):
        away = np.array(polygon.exterior.coords)[:-1] - origin
        bearing = np.arctan2(away[:, 1], away[:, 0])
        rays = np.linspace(bearing.min(), bearing.max(), 402)[1:-1]
        others = geometry.union_all([one for k, one in enumerate(polygons) if k != target])
        free = 0
        for ray in rays.tolist():
            line = geometry.LineString([origin, origin + 300.0 * np.array([np.cos(ray), np.sin(ray)])])
            hit, before = line.intersection(polygon), line.intersection(others)
            free += before.is_empty or start.distance(hit) < start.distance(before)
        assert visible_share(origin, boxes, target) == pytest.approx(free / len(rays), abs=0.02)
    points = np.column_stack([rng.uniform(5, 100, 50), rng.uniform(-4, 4, 50)])
    every = geometry.union_all(polygons)
    expected = [not geometry.LineString([origin, point]).intersects(every) for point in points]
    assert points_seen(origin, points, boxes).tolist() == expected


def row_of_cars(lateral, gaps) -> list:
    """Moments of the last of three cars on a straight, `lateral` from the lane's centre. [m]"""
    places = np.cumsum([0.0, *(LENGTH + gap for gap in gaps)])
    cars = [track(np.full(60, y), name=f"c{k}", x=x) for k, (y, x) in enumerate(zip(lateral, places, strict=True))]
    return [one for one in moments_of(scene(*cars)) if one.cluster == "c0"]


@pytest.mark.parametrize(
    "lateral", [(0.0, 0.0, 0.0), (0.3, -0.3, 0.5), (-0.4, 0.2, 0.9), (0.2, 0.1, 0.0), (0.5, -0.5, 0.5)]
)
def test_on_a_straight_the_second_car_is_seen_where_its_side_is_outside_the_first_ones_shadow(lateral):
    gaps = 20.0, 25.0
    eye, first, second = lateral
    shadow = []  # of the first car, at the second one's rear, on either side
    for side in (1.0, -1.0):
        edge = side * (first - eye) + 0.5 * WIDTH
        corner = gaps[0] if edge > 0.0 else gaps[0] + LENGTH
        far = gaps[0] + LENGTH + gaps[1] + (0.0 if side * (second - eye) + 0.5 * WIDTH > 0.0 else LENGTH)
        shadow.append(side * (second - eye) + 0.5 * WIDTH > edge * far / corner)
    found = row_of_cars(lateral, gaps)
    assert len(found) > 3 and {one.share > 0.0 for one in found} == {any(shadow)}
    assert found[0].gap == pytest.approx(gaps[0]) and found[0].distance == pytest.approx(sum(gaps) + LENGTH)


def test_in_the_lane_s_middle_one_sees_the_lane_up_to_the_car_ahead():
    assert {one.lane for one in row_of_cars((0.0, 0.0, 0.0), (30.0, 30.0))} == {30.0}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    xl.write_template("dense-traffic", tmp_path)
    return tmp_path


def test_in_a_scenario_with_bends_lifelike_traffic_shows_more_of_the_second_car(folder, capsys):
    words = "detect dense-traffic.xosc --sight --ego none --variants 1 -o sight.csv --report sight.html --json"
    assert main(words.split()) == 0
    answer = json.loads(capsys.readouterr().out)
    Draft202012Validator(json.loads(SCHEMA.read_text())).validate(answer)
    seen = {(row["source"], row["sensor"][:5]): row["width_seen"] for row in answer["sight"]}
    assert 0.0 < seen["dense-traffic", "LiDAR"] < 0.7 * seen["dense-traffic, motorway", "LiDAR"]
    assert "<svg" in Path("sight.html").read_text() and len(Path("sight.csv").read_text().splitlines()) == 5


def test_where_nobody_drives_behind_two_others_it_says_so(folder, capsys):
    xl.write_template("braking-leader", folder)
    assert main(["detect", "braking-leader.xosc", "--sight", "--ego", "none"]) == 1
    assert "no vehicle has two others ahead in its lane" in capsys.readouterr().err
