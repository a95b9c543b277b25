"""One road told in several ways: in a mirror, elsewhere, drawn from its other end. What drivers see has to follow."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from tests.kit.places import VALID, hand_written, random_places, wrapped
from tests.kit.retold_roads import mirrored, moved, retold, turned_round
from xosc_lateral.world.road.network import RoadNetwork

NAMES = sorted({path.stem for path in VALID.glob("*.xodr")} - {"odd"})
TURNABLE = [name for name in NAMES if name not in ("cubics", "sections")]
"""A cubic in x and y is none from its other end; sections of one side lie unlike from there."""


@dataclass(frozen=True)
class Retelling:
    """A network beside itself told otherwise, and the same places in both."""

    network: RoadNetwork
    other: RoadNetwork
    places: tuple[np.ndarray, ...]
    there: tuple[np.ndarray, ...]

    def both(self, name: str, count: int = 3):
        """What either answers to a question about the first of road, lane, s and offset."""
        return getattr(self.network, name)(*self.places[:count]), getattr(self.other, name)(*self.there[:count])


def in_the_mirror(name: str, folder: Path) -> Retelling:
    network = hand_written(name)
    road, lane, s, offset = random_places(network, np.random.default_rng(21), 12, driving=False)
    other = retold(VALID / f"{name}.xodr", folder, mirrored)
    return Retelling(network, other, (road, lane, s, offset), (road, -lane, s, -offset))


def from_the_other_end(name: str, folder: Path) -> Retelling:
    network = hand_written(name)
    road, lane, s, offset = random_places(network, np.random.default_rng(22), 12, driving=False)
    other = retold(VALID / f"{name}.xodr", folder, turned_round, network)
    length = np.array([own.length for own in network.roads])[road]
    return Retelling(network, other, (road, lane, s, offset), (road, -lane, length - s, offset))


# ---- the mirror ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", NAMES)
def test_in_a_mirror_left_hand_traffic_drives_where_right_hand_traffic_did(name, tmp_path):
    told = in_the_mirror(name, tmp_path)
    here, there = told.both("lane_to_world", 4)
    assert there.x == pytest.approx(here.x, abs=1e-9) and there.y == pytest.approx(-here.y, abs=1e-9)
    assert there.z == pytest.approx(here.z, abs=1e-9)
    assert np.abs(wrapped(there.heading + here.heading)).max() < 1e-9
    assert there.pitch == pytest.approx(here.pitch, abs=1e-9)
    assert there.roll == pytest.approx(-here.roll, abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_what_a_driver_sees_is_mirrored_with_the_road(name, tmp_path):
    told = in_the_mirror(name, tmp_path)
    here, there = told.both("travel_directions", 2)
    assert np.array_equal(there, here)
    (crossfall, grade), (other_crossfall, other_grade) = told.both("lean")
    assert other_grade == pytest.approx(grade, rel=1e-9, abs=1e-12)
    assert other_crossfall == pytest.approx(-crossfall, abs=1e-9)
    for same in ("lane_width", "speed_limit"):
        here, there = told.both(same)
        assert there == pytest.approx(here, rel=1e-9, abs=1e-12), same
    here, there = told.both("lane_centre_t")
    assert there == pytest.approx(-here, abs=1e-9)
    here, there = told.both("lane_curvature", 4)
    assert there == pytest.approx(-here, rel=1e-6, abs=1e-9)
    (index, count), (other_index, other_count) = told.both("lane_index")
    assert np.array_equal(other_count, count)
    assert np.array_equal(other_index, np.where(index < 0, -1, count - 1 - index))  # rightmost there is leftmost here


@pytest.mark.parametrize("name", NAMES)
def test_ways_over_the_network_are_mirrored_too(name, tmp_path):
    told = in_the_mirror(name, tmp_path)
    for road, lane, s in list(zip(*(part.tolist() for part in told.places[:3]), strict=True))[::7]:
        here, there = (told.network.advance(road, lane, s, 170.0), told.other.advance(road, -lane, s, 170.0))
        assert (there.road, there.lane, there.direction) == (here.road, -here.lane, here.direction)
        assert (there.s, there.remaining) == pytest.approx((here.s, here.remaining), abs=1e-7)


# ---- drawn from the other end ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", TURNABLE)
def test_a_road_drawn_from_its_other_end_is_the_same_road_to_drive_on(name, tmp_path):
    told = from_the_other_end(name, tmp_path)
    here, there = told.both("lane_to_world", 4)
    for one, other, tolerance in zip(here[:3], there[:3], (1e-8, 1e-8, 1e-8), strict=True):
        assert other == pytest.approx(one, abs=tolerance)
    for one, other in zip(here[3:], there[3:], strict=True):
        assert np.abs(wrapped(other - one)).max() < 1e-8


@pytest.mark.parametrize("name", TURNABLE)
def test_what_a_driver_sees_does_not_hang_on_where_a_road_is_drawn_from(name, tmp_path):
    told = from_the_other_end(name, tmp_path)
    here, there = told.both("travel_directions", 2)
    assert np.array_equal(there, -here)
    for same in ("lane_width", "lean"):
        here, there = (np.asarray(answer) for answer in told.both(same))
        assert there == pytest.approx(here, rel=1e-7, abs=1e-9), same
    here, there = told.both("lane_curvature", 4)
    assert there == pytest.approx(here, rel=1e-5, abs=1e-8)
    (index, count), (other_index, other_count) = told.both("lane_index")
    assert np.array_equal(other_index, index) and np.array_equal(other_count, count)


@pytest.mark.parametrize("name", TURNABLE)
def test_ways_lead_to_the_same_place_however_roads_are_drawn(name, tmp_path):
    told = from_the_other_end(name, tmp_path)
    rows = zip(*(part.tolist() for part in (*told.places[:3], told.there[2])), strict=True)
    for road, lane, s, s_there in list(rows)[::7]:
        here = told.network.advance(road, lane, s, 170.0)
        there = told.other.advance(road, -lane, s_there, 170.0)
        assert (there.road, there.lane, there.direction) == (here.road, -here.lane, -here.direction)
        place = told.network.pose_at(here.road, here.lane, here.s)
        assert told.other.pose_at(there.road, there.lane, there.s)[:2] == pytest.approx(place[:2], abs=1e-6)
        assert there.remaining == pytest.approx(here.remaining, abs=1e-7)


# ---- moved -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("x", "y", "heading"), [(4.5e5, -5.4e6, 0.0), (300.0, -70.0, 2.0)])
def test_a_road_elsewhere_is_the_same_road_also_at_the_coordinates_of_a_map(name, x, y, heading, tmp_path):
    network = hand_written(name)
    other = retold(VALID / f"{name}.xodr", tmp_path, moved, x, y, heading)
    places = random_places(network, np.random.default_rng(23), 10)
    here, there = network.lane_to_world(*places), other.lane_to_world(*places)
    turned = (here.x + 1j * here.y) * np.exp(1j * heading) + complex(x, y)
    near = 1e-9 * (1.0 + abs(complex(x, y)))  # the last digits of map coordinates are nanometres
    assert np.abs(there.x + 1j * there.y - turned).max() < near
    assert np.abs(wrapped(there.heading - here.heading - heading)).max() < 1e-9
    assert other.lane_curvature(*places[:3]) == pytest.approx(network.lane_curvature(*places[:3]), rel=1e-9, abs=1e-12)
    found = other.path_to_lane(there.x, there.y, places[0], places[2], lane_types=None)
    inside = network.path_to_lane(here.x, here.y, places[0], places[2], lane_types=None)
    same = (found.road == inside.road) & (found.lane == inside.lane)
    assert same.mean() > 0.97  # a place on the seam of two roads may go to either
    assert np.abs(found.s - inside.s)[same].max() < 10.0 * near
    assert np.abs(found.offset - inside.offset)[same].max() < 10.0 * near


def test_turning_twice_or_mirroring_twice_is_telling_the_same_again(tmp_path):
    """The retelling itself: what is done twice is undone."""
    told = from_the_other_end("leaning", tmp_path)
    again = retold(Path(told.other.path), tmp_path, turned_round, told.other)
    twice = retold(Path(in_the_mirror("leaning", tmp_path).other.path), tmp_path, mirrored)
    here = told.network.lane_to_world(*told.places)
    for network in (again, twice):
        for one, other in zip(here, network.lane_to_world(*told.places), strict=True):
            assert np.abs(wrapped(other - one)).max() < 1e-9
