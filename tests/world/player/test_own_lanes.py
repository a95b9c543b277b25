"""Which lane is an entity's own, and where the cases of the field put it: values by hand, from lane widths."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import xosc_lateral as xl
from tests.kit.stage import (
    WIDTH,
    Stage,
    after,
    entity,
    event,
    lane_change,
    lane_offset,
    maneuvers,
    on_lane,
    speed,
    teleport,
    to_lane,
)  # fmt: skip

CASES = [
    ("ramp_ends_beside_shoulder/scenario", "A", 7.0, "1", -2, -5.25),
    ("ramp_ends_beside_shoulder/wide", "A", 7.0, "1", -2, -5.25),
    ("ramp_ends_beside_shoulder/joint_of_roads", "A", 11.0, "7", 2, 5.25),
    ("route_waypoint_lane_ignored/scenario", "A", 9.0, "2", -2, -5.25),
    ("route_waypoint_lane_ignored/exit_with_waypoint", "A", 14.0, "4", -1, None),
    ("route_waypoint_lane_ignored/exit_without_waypoint", "A", 14.0, "4", -1, None),
    ("lane_change_onto_shoulder_forgotten/offset", "A", 14.0, "0", -4, -11.95),
    ("lane_change_onto_shoulder_forgotten/init_offset", "A", 14.0, "0", -4, -11.95),
    ("lane_change_onto_shoulder_forgotten/pullover", "A", 20.0, "0", -3, -8.75),
    ("lane_change_onto_shoulder_forgotten/median_two", "A", 11.0, "0", -3, -8.75),
    ("lane_change_onto_shoulder_forgotten/median_offset", "A", 13.0, "0", -2, -5.25),
    ("init_add_entity_relative/scenario", "B", 0.0, "0", -1, -2.75),
    ("init_add_entity_relative/scenario", "C", 0.0, "0", -1, -2.75),
    ("init_add_entity_relative/after_private", "B", 0.0, "0", -1, -2.75),
]


@pytest.mark.parametrize(("case", "name", "time", "road", "lane", "y"), CASES)
def test_the_cases_of_the_field(
    shared: Path, case: str, name: str, time: float, road: str, lane: int, y: float
) -> None:
    table = xl.play(shared / "cases" / "field" / f"{case}.xosc").to_frame()
    row = table[(table["name"] == name) & ((table["time"] - time).abs() < 0.011)].iloc[0]
    assert (str(row["road"]), int(row["lane"])) == (road, lane)
    if y is not None:
        assert row["y"] == pytest.approx(y, abs=0.01)


def test_a_place_beyond_its_route_is_a_doubt_and_so_is_the_car_in_another(shared: Path) -> None:
    played = xl.play(shared / "cases" / "field" / "route_position_past_the_end" / "scenario.xosc")
    beyond, overlap = played.warnings
    assert "pathS = 200 m" in beyond and "60.0 m" in beyond and "s = 80 m" in beyond
    assert "'B' appears in 'A'" in overlap


@pytest.mark.parametrize(("own", "target"), [(-1, -2), (-2, -1)])
def test_at_the_edge_of_two_lanes_a_car_has_not_moved_out_of_its_own(tmp_path: Path, own: int, target: int) -> None:
    change = event(lane_change(to_lane(target), over=4.0, shape="linear"), trigger=after(1.0))
    motion = entity(Stage(tmp_path).play(maneuvers(change), start={"Ego": teleport(on_lane(own, 50.0)) + speed(20.0)}))
    half = int(np.argmin(np.abs(motion.y + WIDTH)))
    assert motion.y[half] == pytest.approx(-WIDTH, abs=1e-9)
    assert motion.lane[half : half + 2].tolist() == [own, target]


def test_who_stands_goes_on_standing_while_a_lane_offset_moves_him(tmp_path: Path) -> None:
    aside = event(lane_offset('<AbsoluteTargetLaneOffset value="0.5"/>'), trigger=after(1.0))
    motion = entity(Stage(tmp_path).play(maneuvers(aside), start={"Ego": teleport(on_lane(-1, 50.0)) + speed(0.0)}))
    assert motion.y[-1] == pytest.approx(-0.5 * WIDTH + 0.5, abs=1e-6)
    assert not motion.speed.any()
    assert (motion.x == 50.0).all()
