"""One road, and the same road drawn as two whose ends meet: whatever is played on it is the same in the world."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.kit.stage import (
    STRAIGHT,
    WIDTH,
    Stage,
    by_lanes,
    entity,
    event,
    facing,
    lane_change,
    lane_offset,
    lateral,
    maneuvers,
    on_lane,
    speed,
    teleport,
    to_lane,
)
from tests.world.player.test_driving import MIRRORED

KEEP_BESIDE = lateral(
    '<LateralDistanceAction entityRef="Lead" distance="3" freespace="false" continuous="true" coordinateSystem="road" '
    'displacement="leftToReferencedEntity"><DynamicConstraints maxAcceleration="2" maxDeceleration="2" maxSpeed="2"/>'
    "</LateralDistanceAction>"
)


def relative(attributes: str, orientation: str = "") -> str:
    return f'<RelativeLanePosition entityRef="Ego" {attributes}>{orientation}</RelativeLanePosition>'


def poses(folder: Path, roads: str, action: str, lead: str) -> dict[str, np.ndarray]:
    """x, y, speed, and the heading as cosine and sine, of all entities in all frames."""
    start = {"Ego": teleport(on_lane(-2, 150.0)) + speed(20.0), "Lead": teleport(lead) + speed(20.0)}
    folder.mkdir()
    played = Stage(folder, roads).play(*([maneuvers(event(action))] if action else ()), start=start, last=7.0)
    motions = {name: entity(played, name) for name in start}
    return {
        name: np.stack([one.x, one.y, one.speed, np.cos(one.heading), np.sin(one.heading)])
        for name, one in motions.items()
    }


@pytest.mark.parametrize(
    "action",
    [
        lane_change(to_lane(-1)),
        lane_change(to_lane(-1), "cubic", offset=0.5),
        lane_change(by_lanes(0, of="Lead")),
        lane_change(by_lanes(-1, of="Lead")),
        lane_offset('<AbsoluteTargetLaneOffset value="0.8"/>', acceleration=0.3),
        lane_offset('<RelativeTargetLaneOffset entityRef="Lead" value="0.8"/>', acceleration=0.3),
        KEEP_BESIDE,
    ],
)
def test_lateral_actions_do_not_see_the_joint(tmp_path: Path, action: str) -> None:
    one = poses(tmp_path / "one", STRAIGHT, action, on_lane(-1, 230.0))
    two = poses(tmp_path / "two", MIRRORED, action, on_lane(1, 270.0, road="2"))
    for name, values in one.items():
        np.testing.assert_allclose(two[name], values, atol=1e-6, err_msg=name)


@pytest.mark.parametrize(
    ("attributes", "y"),
    [
        ('dLane="0" ds="100"', -1.5 * WIDTH),
        ('dLane="1" ds="100"', -0.5 * WIDTH),
        ('dLane="1" ds="100" offset="0.4"', -0.5 * WIDTH + 0.4),
        ('dLane="0" dsLane="100" offset="0.4"', -1.5 * WIDTH + 0.4),
        ('dLane="1" dsLane="100"', -0.5 * WIDTH),
    ],
)
def test_a_lead_vehicle_beyond_the_joint_drives_ahead(tmp_path: Path, attributes: str, y: float) -> None:
    for name, roads in (("one", STRAIGHT), ("two", MIRRORED)):
        lead = poses(tmp_path / name, roads, "", relative(attributes))["Lead"]
        np.testing.assert_allclose(lead[:, 0], [250.0, y, 20.0, 1.0, 0.0], atol=1e-6)
        np.testing.assert_allclose(lead[:, -1], [250.0 + 20.0 * 7.0, y, 20.0, 1.0, 0.0], atol=1e-6)


def test_a_relative_heading_counts_from_the_lane_that_goes_on(tmp_path: Path) -> None:
    lead = relative('dLane="0" ds="100"', facing(0.1))
    one, two = (poses(tmp_path / name, roads, "", lead)["Lead"] for name, roads in (("a", STRAIGHT), ("b", MIRRORED)))
    np.testing.assert_allclose(two[3:, 0], one[3:, 0], atol=1e-9)
