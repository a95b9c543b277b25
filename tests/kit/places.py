"""Places on roads for tests: the hand-written roads, and random places on any network."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.network import RoadNetwork

VALID = Path(__file__).parents[1] / "data" / "xodr" / "valid"


def hand_written(name: str) -> RoadNetwork:
    """One of the roads under tests/data."""
    return read_opendrive(VALID / f"{name}.xodr")


def random_places(network: RoadNetwork, rng: np.random.Generator, n_per_lane: int, *, driving: bool = True):
    """Arrays (road, lane, s, offset) inside lanes that are at least 1 cm wide there."""
    parts = []
    for index, road in enumerate(network.roads):
        for section in road.sections:
            for lane in section.lanes:
                if driving and lane.type not in DRIVING:
                    continue
                s = rng.uniform(section.start, section.end, n_per_lane)
                parts.append((np.full(n_per_lane, index), np.full(n_per_lane, lane.id), s))
    road, lane, s = (np.concatenate(part) for part in zip(*parts, strict=True))
    width = network.lane_width(road, lane, s)
    wide = width > 0.01
    offset = rng.uniform(-0.499, 0.499, len(s)) * width
    return road[wide], lane[wide], s[wide], offset[wide]


def wrapped(angle):
    """Into [-pi, pi)."""
    return (np.asarray(angle) + np.pi) % (2.0 * np.pi) - np.pi
