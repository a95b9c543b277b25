"""Who drives ahead of a vehicle in its lane, at one moment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.surroundings import around


def vehicle_ahead(
    vehicle: EntityMotion, row: int, vehicles: Sequence[EntityMotion], network: RoadNetwork
) -> tuple[float, float]:
    """Free space to the vehicle ahead [m], and how fast that gets less [m/s]; NaN: there is none within sight.

    Who is ahead has the middle of its body in the vehicle's lane, along which it is found over joints of roads, too.
    """
    time, road, lane, s = vehicle.time[row], int(vehicle.road[row]), int(vehicle.lane[row]), float(vehicle.s[row])
    there = [(one, int(np.searchsorted(one.time, time - 1e-9))) for one in vehicles if one is not vehicle]
    there = [(one, k) for one, k in there if k < len(one.time) and one.time[0] <= time + 1e-9 and one.road[k] >= 0]
    if road < 0 or not there:
        return np.nan, np.nan
    places = np.array([(one.road[k], one.lane[k], one.s[k], one.offset[k], one.speed[k], one.box.length,
                        one.box.center_x, int(one.way(np.array([k]))[0])) for one, k in there])  # fmt: skip
    roads, lanes = places[:, 0].astype(np.int64), places[:, 1].astype(np.int64)
    beside = network.offset_to_t(roads, lanes, places[:, 2], places[:, 3])
    directions = network.travel_directions(roads, lanes) * places[:, 7].astype(np.int64)
    way = int(vehicle.way(np.array([row]))[0])
    path = around.lane_path(network, road, lane, s, network.travel_direction(road, lane) * way)
    centre = np.zeros(len(there))  # of the vehicle's lane, where it is
    seen = around.see_along(path, centre, centre, roads, places[:, 2], beside, directions, network.lane_centre_t)
    gap = around.free_space(seen, vehicle.box, around.Extent(places[:, 5], places[:, 6]))
    half = 0.5 * float(network.lane_width(road, lane, s))
    in_lane = (np.abs(seen.left) < half) & (seen.ahead > 0.0) & ~seen.oncoming
    gap = np.where(in_lane & (gap <= around.SIGHT_DISTANCE), gap, np.inf)
    nearest = int(np.argmin(gap))
    if not np.isfinite(gap[nearest]):
        return np.nan, np.nan
    return float(gap[nearest]), float(vehicle.speed[row] - places[nearest, 4])
