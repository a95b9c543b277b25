"""Who is ahead and who is behind in a lane, and how near, by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.kit.stage import Stage, maneuvers, on_lane, speed, teleport
from xosc_lateral.extras.recordings.lane_order import RoadLanes, vehicle_next


def test_the_follower_closes_when_he_is_the_faster_one(tmp_path: Path) -> None:
    """Cars of 5 m at 0, 50 and 120 m with 30, 20 and 25 m/s: 45 m free, closing with 10 m/s; 65 m, opening with 5."""
    start = {
        "Behind": teleport(on_lane(-1, 100.0)) + speed(30.0),
        "Ego": teleport(on_lane(-1, 150.0)) + speed(20.0),
        "Ahead": teleport(on_lane(-1, 220.0)) + speed(25.0),
    }
    played = Stage(tmp_path).play(maneuvers(), start=start, last=1.0)
    lanes, vehicles = RoadLanes(played.network), played.motion.entities
    behind, ego, ahead = (next(one for one in vehicles if one.name == name) for name in start)
    found = vehicle_next(ego, 0, vehicles, lanes, ahead=False)
    assert (found.gap, found.closing, found.speed) == pytest.approx((45.0, 10.0, 30.0))
    assert (found.headway, found.time_to_collision) == pytest.approx((1.5, 4.5))
    assert vehicle_next(behind, 0, vehicles, lanes) == pytest.approx(found)
    found = vehicle_next(ego, 0, vehicles, lanes)
    assert (found.gap, found.closing, found.time_to_collision) == pytest.approx((65.0, -5.0, np.inf))
    assert vehicle_next(ahead, 0, vehicles, lanes, ahead=False) == pytest.approx(found)
    assert np.isnan(vehicle_next(ahead, 0, vehicles, lanes).gap)
