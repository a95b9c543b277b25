"""Road geometry: (road, lane, s, offset) <-> (x, y, z, heading). Numbers only, no files."""

from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.links import Chooser
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.road.positions import (
    Advance,
    LaneCoordinates,
    LaneInfo,
    LaneLink,
    LanePositions,
    LaneState,
    Pose,
    Poses,
    RoadMark,
    RouteStep,
)

__all__ = [
    "DRIVING",
    "Advance",
    "Chooser",
    "LaneCoordinates",
    "LaneInfo",
    "LaneLink",
    "LanePositions",
    "LaneState",
    "Pose",
    "Poses",
    "RoadMark",
    "RoadNetwork",
    "RouteStep",
]
