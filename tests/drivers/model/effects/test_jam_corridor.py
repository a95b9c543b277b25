"""The corridor in a jam: who keeps where."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.drivers.model.effects.jam_corridor import JamCorridor


def kept_left(**context: float) -> float:
    usual = {"speed": 0.0, "lane_index": 0.0, "lane_count": 3.0, "lane_width": 3.5, "motorway": 1.0}
    return float(JamCorridor().quantity({name: np.array([value]) for name, value in (usual | context).items()})[0, 0])


@pytest.mark.parametrize(
    ("lane", "count", "side"), [(2, 3, 1), (1, 3, -1), (0, 3, -1), (1, 2, 1), (0, 2, -1), (0, 1, 0)]
)
def test_the_leftmost_lane_keeps_left_and_all_others_right(lane: int, count: int, side: int) -> None:
    assert kept_left(lane_index=lane, lane_count=count) == pytest.approx(0.4 * side)


def test_it_is_faded_in_below_40_km_h_and_is_none_off_motorways() -> None:
    assert kept_left(speed=40.0 / 3.6) == kept_left(speed=30.0) == kept_left(motorway=0.0) == 0.0
    assert -0.4 < kept_left(speed=8.0) < -0.1
    assert kept_left(speed=5.0) == pytest.approx(-0.4)


def test_a_narrow_lane_keeps_its_distance_to_the_marking() -> None:
    assert kept_left(lane_width=3.0) == pytest.approx(-0.3)  # 1.5 m less half a car and 0.3 m
    assert kept_left(lane_width=2.3) == 0.0
