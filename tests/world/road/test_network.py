"""The road network against the reference road manager, an independent package and closed forms; its signs."""

from __future__ import annotations

import csv
import gzip
import warnings
from collections import defaultdict
from math import atan, cos, pi, sin, sqrt, tan

import numpy as np
import pytest

from tests.kit.places import VALID, hand_written, random_places, wrapped
from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.files.opendrive.reader import parse_opendrive, read_opendrive
from xosc_lateral.world.road.piecewise import PiecewiseCubic, Surface

NAMES = sorted(path.stem for path in VALID.glob("*.xodr"))

# In these rows the reference holds the lane offset (0 or 3.5 m) of the place that it looked up just before.
STALE = {158.945, 161.850, 284.351, 429.422, 57.476, 426.253}


@pytest.fixture(scope="module")
def reference(shared):
    """Lane positions evaluated by the reference road manager, by road file."""
    rows = defaultdict(list)
    with gzip.open(shared / "corpus" / "reference" / "roads.csv.gz", "rt") as file:
        for row in csv.DictReader(file):
            if not (row["road_file"].endswith("two_plus_one.xodr") and float(row["s"]) in STALE):
                rows[row["road_file"]].append(row)
    return {shared / "corpus" / name: own for name, own in rows.items()}


def test_places_agree_with_the_reference_road_manager_to_a_millimetre(reference):
    count = 0
    for path, rows in reference.items():
        network = read_opendrive(path)
        road = np.array([network.index_of(row["road"]) for row in rows])
        lane = np.array([int(row["lane"]) for row in rows])
        s, offset_t, width, x, y, z, heading, pitch, roll = (
            np.array([float(row[name]) for row in rows])
            for name in ("s", "offset_t", "width", "x", "y", "z", "h", "pitch", "roll")
        )
        poses = network.lane_to_world(road, lane, s, offset_t * network.travel_directions(road, lane))
        assert np.hypot(poses.x - x, poses.y - y).max() < 1e-4, path.name
        assert np.abs(poses.z - z).max() < 1e-5, path.name
        assert np.abs(wrapped(poses.heading - heading)).max() < 1e-5, path.name
        assert np.abs(wrapped(poses.pitch - pitch)).max() < 1e-5, path.name
        assert np.abs(wrapped(poses.roll - roll)).max() < 1e-5, path.name
        assert np.abs(network.lane_width(road, lane, s) - width).max() < 1e-5, path.name
        count += len(rows)
    assert count == 2314 - len(STALE)


@pytest.mark.pages
@pytest.mark.parametrize("name", ["alks_road_different_curvatures", "e6mini", "curves", "jolengatan"])
def test_reference_lines_and_lane_edges_agree_with_an_independent_package(shared, name):
    from pyxodr.road_objects.network import RoadNetwork as IndependentNetwork

    (path,) = (shared / "corpus").rglob(f"{name}.xodr")
    network = read_opendrive(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        (road,) = IndependentNetwork(str(path), resolution=1.0).get_roads()
        edges = {lane.id: lane.boundary_line for lane in road.lane_sections[0].lanes if lane.id != 0}
    guess = np.linspace(0.0, network.roads[0].length, len(road.reference_line))
    # it samples every metre and joins the elements' last samples by straight lines
    found = network.path_to_lane(*road.reference_line.T, 0, guess, lane_types=None)
    assert np.abs(found.t).max() < 5e-3
    for lane, line in edges.items():
        found = network.path_to_lane(*line[:, :2].T, 0, guess, lane_types=None)
        outer = network.lane_centre_t(0, lane, found.s) + 0.5 * np.sign(lane) * network.lane_width(0, lane, found.s)
        assert np.abs(found.t - outer).max() < 5e-3


@pytest.mark.parametrize("name", NAMES)
def test_one_place_and_a_batch_of_places_are_evaluated_alike(name):
    network = hand_written(name)
    road, lane, s, offset = random_places(network, np.random.default_rng(1), 20, driving=False)
    batch = network.lane_to_world(road, lane, s, offset)
    profile = network.lane_centre_t(road, lane, s), network.lane_width(road, lane, s)
    curvature = network.curvature(road, s)
    along = network.road_to_world(road, s, offset)
    for i, place in enumerate(zip(road.tolist(), lane.tolist(), s.tolist(), offset.tolist(), strict=True)):
        one = network.pose_at(*place)
        assert np.allclose(one[:3], [field[i] for field in batch[:3]], atol=1e-9)
        assert np.abs(wrapped(np.array(one[3:]) - [field[i] for field in batch[3:]])).max() < 1e-10
        state = network.lane_state_at(*place[:3])
        assert (state.centre_t, state.width) == pytest.approx((profile[0][i], profile[1][i]), abs=1e-12)
        assert network.curvature_at(place[0], place[2]) == pytest.approx(curvature[i], rel=1e-9, abs=1e-15)
        assert network.road_pose_at(place[0], place[2], place[3]).x == pytest.approx(along.x[i], abs=1e-9)


def test_mixed_roads_and_one_road_at_a_time_give_the_same_numbers():
    network = hand_written("cubics")
    road, lane, s, offset = random_places(network, np.random.default_rng(2), 50, driving=False)
    mixed = network.lane_to_world(road, lane, s, offset)
    for index in np.unique(road):
        own = road == index
        alone = network.lane_to_world(int(index), lane[own], s[own], offset[own])
        for one, other in zip(alone, mixed, strict=True):
            assert np.array_equal(one, other[own])


def test_shapes_broadcast():
    network = hand_written("straight")
    poses = network.lane_to_world(0, np.array([[1], [-1], [-2]]), np.linspace(0.0, 1000.0, 5), 0.2)
    assert poses.x.shape == (3, 5)
    assert network.lane_to_world(0, -1, 5.0).x.shape == ()
    assert network.lane_to_world([], [], []).x.shape == (0,)


@pytest.mark.parametrize(("name", "right_lane_goes_along"), [("straight", True), ("left_hand", False)])
def test_left_offset_stays_left_of_travel_on_every_lane_in_right_and_left_hand_traffic(name, right_lane_goes_along):
    network = hand_written(name)
    assert network.travel_direction(0, -1) == (1 if right_lane_goes_along else -1)
    for lane in (1, -1, -2):
        centre, left = network.pose_at(0, lane, 300.0, 0.0), network.pose_at(0, lane, 300.0, 0.4)
        to_left = -sin(centre.heading), cos(centre.heading)
        assert (left.x - centre.x) * to_left[0] + (left.y - centre.y) * to_left[1] == pytest.approx(0.4, abs=1e-12)
        assert left.heading == pytest.approx(centre.heading)


def test_offset_and_t_turn_into_each_other_with_the_sign_of_travel():
    network = hand_written("straight")
    road, lane, s, offset = random_places(network, np.random.default_rng(3), 30)
    t = network.offset_to_t(road, lane, s, offset)
    assert np.allclose(
        network.travel_directions(road, lane) * (t - network.lane_centre_t(road, lane, s)), offset, atol=1e-12
    )
    assert network.offset_to_t(0, 1, 10.0, 0.5) == pytest.approx(1.75 - 0.5)
    assert network.offset_to_t(0, -1, 10.0, 0.5) == pytest.approx(-1.75 + 0.5)
    assert network.offset_from_offset_t(0, 1, 0.5) == -0.5
    assert network.offset_from_offset_t(0, -2, 0.5) == 0.5


def test_on_a_straight_road_everything_is_where_a_ruler_would_put_it():
    network = hand_written("straight")
    pose = network.pose_at(0, -2, 200.0, -0.1)
    t = -3.5 - 1.625 - 0.1
    assert (pose.x, pose.y) == pytest.approx((100.0 + (200.0 - t) / sqrt(2.0), -50.0 + (200.0 + t) / sqrt(2.0)))
    assert pose.heading == pytest.approx(pi / 4)
    assert network.pose_at(0, 1, 200.0).heading == pytest.approx(-3 * pi / 4)


def test_s_beyond_the_road_is_held_at_its_ends():
    network = hand_written("straight")
    assert network.pose_at(0, -1, 1e4) == network.pose_at(0, -1, 1000.0)
    poses = network.lane_to_world(0, -1, [-5.0, 0.0, 1000.0, 1e4])
    assert (poses.x[0], poses.x[3]) == (poses.x[1], poses.x[2])


def test_a_lane_widening_turns_its_heading_by_the_slope_of_its_centre():
    network = hand_written("sections")
    # lane -1 opens at 0.035 m/m: its centre runs off at half of that
    assert network.pose_at(0, -1, 150.0).heading == pytest.approx(-atan(0.0175), abs=1e-12)
    assert network.lane_state_at(0, -1, 150.0).slope == pytest.approx(-0.0175)


def test_borders_count_from_the_centre_lane_and_widths_win_over_them():
    network = hand_written("edges")
    for lane, s, outer, inner in ((2, 10.0, 6.0, 3.0), (2, 160.0, 7.6, 3.6), (-1, 250.0, -2.5, 1.0)):
        assert network.lane_centre_t(0, lane, s) == pytest.approx(0.5 * (outer + inner))
        assert network.lane_width(0, lane, s) == pytest.approx(abs(outer - inner))
    assert network.lane_width(0, -2, [25.0, 150.0, 299.0]) == pytest.approx([0.0, 3.5, 3.5])
    assert network.lane_width(0, -2, 100.0) == pytest.approx(0.00105 * 50**2 - 7e-6 * 50**3)
    assert network.lane_centre_t(0, 0, 150.0) == pytest.approx(0.5)


def test_superelevation_measures_t_in_the_leaning_surface():
    network = hand_written("leaning")
    pose = network.road_pose_at(network.index_of("bank"), 300.0, -5.0)
    height = 10.0 + 15.0 - 5.0 * sin(0.1) * cos(atan(0.05))
    assert (pose.y, pose.z) == pytest.approx((-5.0 * cos(0.1), height))
    assert pose.roll == pytest.approx(0.1)
    assert pose.pitch == pytest.approx(-atan(0.05))


@pytest.mark.parametrize("lane", [-2, -1, 1])
@pytest.mark.parametrize("s", [50.0, 150.0, 250.0])
def test_on_a_leaning_road_the_pose_points_along_the_track_that_is_driven(lane, s):
    network = hand_written("leaning")
    index = network.index_of("bank")
    way = network.travel_direction(index, lane)
    before, here, after = (network.pose_at(index, lane, s + way * ds) for ds in (-1e-3, 0.0, 1e-3))
    track = np.array(after[:3]) - np.array(before[:3])
    forward = [cos(here.pitch) * cos(here.heading), cos(here.pitch) * sin(here.heading), -sin(here.pitch)]
    assert track / np.linalg.norm(track) == pytest.approx(forward, abs=1e-6)


def test_crossfall_and_shape_lower_the_road_beside_its_reference_line():
    network = hand_written("leaning")
    roof, shape = network.index_of("roof"), network.index_of("shape")
    assert network.road_pose_at(roof, 10.0, -4.0).z == pytest.approx(-0.1)
    assert network.road_pose_at(roof, 10.0, 4.0).z == pytest.approx(-0.08)
    # at s = 400 m the right half falls inwards by 4 %; half way there by 2 %
    assert network.road_pose_at(shape, 200.0, -5.0).z == pytest.approx(0.1)
    assert network.road_pose_at(shape, 200.0, 5.0).z == pytest.approx(0.0)
    assert network.lean(roof, [-1, 1], 10.0)[0] == pytest.approx([100 * 0.025, 100 * 0.02])
    assert network.lean(shape, -1, 200.0)[0] == pytest.approx(-2.0)


def test_crossfall_and_grade_are_seen_in_travel_direction():
    network = hand_written("leaning")
    bank = network.index_of("bank")
    crossfall, grade = network.lean(bank, [-1, 1], 300.0)
    assert crossfall == pytest.approx([100 * tan(0.1), -100 * tan(0.1)])
    assert grade == pytest.approx([5.0, -5.0])


def test_a_kerb_lifts_its_lane_and_rises_linearly_between_records():
    network = hand_written("leaning")
    kerb = network.index_of("kerb")
    assert network.pose_at(kerb, -1, 10.0).z == 0.0
    assert network.pose_at(kerb, -2, 0.0, 1.0).z == pytest.approx(0.02)
    assert network.pose_at(kerb, -2, 0.0, -1.0).z == pytest.approx(0.12)
    assert network.pose_at(kerb, -2, 25.0, 0.0).z == pytest.approx(0.11)
    assert network.pose_at(kerb, -2, 80.0, 0.0).z == pytest.approx(0.15)


def test_an_unknown_road_or_lane_is_named():
    network = hand_written("straight")
    with pytest.raises(PlaybackError, match=r"straight\.xodr: there is no road '8' \(roads: 7\)"):
        network.index_of("8")
    with pytest.raises(PlaybackError, match=r"road '7' has no lane -3 at s=5\.000 m \(lanes there: 1, -1, -2\)"):
        network.lane_to_world(0, [-1, -3], [1.0, 5.0])
    with pytest.raises(PlaybackError, match=r"road '7' has no lane 9 at s=5\.000 m"):
        network.lane_to_world(0, 9, 5.0)
    with pytest.raises(PlaybackError, match=r"road '7' has no lane 9 at s=5\.000 m"):
        network.pose_at(0, 9, 5.0)


def test_a_place_off_the_road_or_nowhere_does_not_pass_quietly():
    network = hand_written("straight")
    with pytest.raises(ValueError, match="road index -1"):
        network.lane_to_world([0, -1], -1, 5.0)
    with pytest.raises(ValueError, match="must be finite, found nan"):
        network.lane_to_world(0, -1, [1.0, np.nan])
    with pytest.raises(ValueError, match="is not a coordinate"):
        network.world_to_lane([0.0, np.inf], 0.0)


def test_a_lean_on_a_grade_leads_along_s_and_finds_back():
    """Ry(pitch) Rx(roll) (0, t, 0): t sin(pitch) sin(roll) ahead, t cos(roll) aside, t cos(pitch) sin(roll) up."""
    grade, lean, t = -1.0, 0.5, -6.0
    surface = Surface(
        elevation=PiecewiseCubic((0.0,), ((0.0, grade, 0.0, 0.0),)),
        superelevation=PiecewiseCubic((0.0,), ((lean, 0.0, 0.0, 0.0),)),
    )
    pitch = -atan(grade)
    height, _, _, shrink, _, lead = surface.at(10.0, t)
    assert lead == pytest.approx(t * sin(pitch) * sin(lean))
    assert t * shrink == pytest.approx(t * cos(lean))
    assert height == pytest.approx(10.0 * grade + t * cos(pitch) * sin(lean))
    assert surface.lead_at(10.0, t * shrink) == pytest.approx(lead)


ROUGH = """<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="1" length="200" junction="-1">
<planView><geometry s="0" x="3" y="-2" hdg="0" length="200"><line/></geometry></planView>
<elevationProfile><elevation s="0" a="4" b="-0.06" c="2e-3" d="2e-6"/></elevationProfile>
<lateralProfile><superelevation s="0" a="-0.1" b="2e-3" c="-3e-6" d="0"/></lateralProfile>
<lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center>
<right><lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
<lane id="-2" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>"""


def _in_space(s: float, t: float) -> np.ndarray:
    """The leaning line is turned about the climbing one: along that (1, 0, grade), across it (-grade, 0, 1)."""
    height, grade = 4 - 0.06 * s + 2e-3 * s**2 + 2e-6 * s**3, -0.06 + 4e-3 * s + 6e-6 * s**2
    lean, size = -0.1 + 2e-3 * s - 3e-6 * s**2, np.hypot(1.0, grade)
    upwards = np.array([-grade, 0.0, 1.0]) / size
    return np.array([3.0 + s, -2.0, height]) + t * (cos(lean) * np.array([0.0, 1.0, 0.0]) + sin(lean) * upwards)


@pytest.mark.parametrize("s", [0.7, 35.0, 50.0, 120.0, 199.0])
@pytest.mark.parametrize("offset", [-1.2, 0.0, 0.9])
@pytest.mark.parametrize("lane", [-1, -2])
def test_a_place_on_a_banked_climbing_road_is_where_geometry_says_and_is_found_again(s, offset, lane):
    """Grade and bank change along the road, and the bank turns from one side to the other on it."""
    network, t = parse_opendrive(ROUGH.encode(), "rough.xodr"), 3.5 * (lane + 0.5) + offset
    pose = network.pose_at(0, lane, s, offset)
    np.testing.assert_allclose((pose.x, pose.y, pose.z), _in_space(s, t), atol=1e-9)
    track = (_in_space(s + 1e-4, t) - _in_space(s - 1e-4, t)) / 2e-4
    forward = cos(pose.pitch) * cos(pose.heading), cos(pose.pitch) * sin(pose.heading), -sin(pose.pitch)
    np.testing.assert_allclose(forward, track / np.linalg.norm(track), atol=1e-6)
    for near in (None, (0, s + 4.0)):
        place = network.world_to_lane_at(pose.x, pose.y, near=near)
        assert (place.lane, place.s, place.t) == (lane, pytest.approx(s, abs=1e-4), pytest.approx(t, abs=1e-4))


@pytest.mark.parametrize("name", ["straight", "arcs", "cubics"])
def test_a_stretch_is_all_of_one_element_of_the_reference_line(name: str) -> None:
    for road in hand_written(name).roads:
        ends = [-np.inf, *road.starts[1:], np.inf]
        for number, element in enumerate(road.elements):
            for s in np.linspace(road.starts[number], min(ends[number + 1], road.length) - 1e-6, 5):
                low, high, held, start, _ = road.stretch_of(-1, float(s))
                assert (low, high, start) == (ends[number], ends[number + 1], road.starts[number])
                assert held is element


def test_a_network_has_few_enough_attributes_for_its_methods_to_be_found_fast():
    """From 30 on, CPython (3.11 to 3.13) calls methods of an object at half the speed, and the player lives on them."""
    assert len(vars(hand_written("straight"))) < 30
