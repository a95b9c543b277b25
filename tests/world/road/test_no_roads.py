"""Scenarios without a road exist (parking lots, open fields): their empty network still answers batch calls."""

from __future__ import annotations

import numpy as np

from xosc_lateral.world.road.network import RoadNetwork


def test_a_network_without_roads_answers_an_empty_batch_with_an_empty_one():
    nothing = np.empty(0, dtype=np.int32)
    poses = RoadNetwork(()).lane_to_world(nothing, nothing, np.empty(0))
    assert poses.x.shape == (0,)
