"""The one gate of direction and side that every recording with positions passes.

Offsets count to the left of travel, so a recording whose axes, headings or side of the road are not those of its lanes
has all signs, leaders and lane numbers wrong. Three directions have to agree wherever a vehicle moves: that of its way
through x and y, its heading as recorded, and that of the lane that it is in. Where they don't, the recording is
refused, with the share of the rows and the likeliest cause.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.world.road.network import RoadNetwork

MOVING_SPEED = 3.0  # slower vehicles have no direction: 2 cm of noise in 0.4 s turn the way at 3 m/s by 1 degree [m/s]
LANE_AGREEMENT = 0.7  # cosine of a vehicle's direction and that of the lane that it is taken to follow: 45 degrees [-]
HEADING_AGREEMENT = 0.94  # cosine of a vehicle's heading and of its way: 20 degrees, as of its front at R = 10 m [-]
WITHIN_EARTH = 4e7  # places beyond are none: the earth's girth [m]
MAX_AGAINST = 0.1
"""Share of the moving rows that may contradict: mirrored or turned recordings have all, or half where headings are
random; overtaking in the oncoming lane and vehicles that reverse have a few in a hundred. [-]"""

STRAIGHT_AGREEMENT = np.cos(np.radians(3.0))  # cosine of a heading and its edge's that is straight [-]
LEAST_SPREAD = 0.1  # standard deviation of places across the road from which their side can be told [m]
CLOCKWISE, NORTH = "counted clockwise", "counted clockwise from north"


def require_headings(heading: FloatArray, way: FloatArray, speed: FloatArray, path: Path) -> None:
    """Refuse headings as recorded that are not those of the way through x and y; all of shape (n,). [rad], [m/s]"""
    moving = (speed > MOVING_SPEED) & np.isfinite(heading + way)
    wrong = _share(np.cos(heading - way)[moving] < HEADING_AGREEMENT)
    if wrong <= MAX_AGAINST:
        return
    meant = {
        "in degrees, heading=COLUMN:deg": np.radians(heading),
        "the opposite direction": heading + np.pi,
        CLOCKWISE: -heading,
        NORTH: 0.5 * np.pi - heading,
        "in degrees, " + CLOCKWISE: -np.radians(heading),
        "in degrees, " + NORTH: 0.5 * np.pi - np.radians(heading),
    }
    shares = {name: _share(np.cos(other - way)[moving] < HEADING_AGREEMENT) for name, other in meant.items()}
    likely = min(shares, key=lambda name: shares[name])
    meant_by_us = "radians counter-clockwise from x are meant"
    cause = f"; it may be {likely}" if shares[likely] <= MAX_AGAINST else f"; {meant_by_us}"
    what = f"contradicts the way through x and y in {100 * wrong:.0f} % of the moving rows{cause}"
    raise FormatError(what, path=path, element="column 'heading'")


def require_lane_direction(agreement: FloatArray, speed: FloatArray, where: str, path: Path) -> BoolArray:
    """Rows against their lane by the cosine of way and lane (NaN: in none), shape (n,); refuse a recording of them."""
    against = (speed > MOVING_SPEED) & (agreement < 0.0)
    share = _share(against[(speed > MOVING_SPEED) & np.isfinite(agreement)])
    if share > MAX_AGAINST:
        cause = "y may point down, or one is of left-hand, the other of right-hand traffic"
        what = f"{100 * share:.0f} % of the moving rows drive against the direction of their lanes in {where}: {cause}"
        raise FormatError(what, path=path)
    return np.asarray(against)


def require_along_lanes(
    network: RoadNetwork, x: FloatArray, y: FloatArray, heading: FloatArray, speed: FloatArray, path: Path
) -> None:
    """Refuse places in the coordinates of a road's file that drive against its lanes. [m], [rad], [m/s]"""
    near = np.flatnonzero(np.abs(x) + np.abs(y) < WITHIN_EARTH)
    place = network.world_to_lane(x[near], y[near], heading=heading[near])
    inside = (place.distance <= 0.0) & (place.lane != 0)
    lane = network.lane_to_world(place.road[inside], place.lane[inside], place.s[inside])
    agreement = np.full(len(near), np.nan)
    agreement[inside] = np.cos(heading[near][inside] - lane.heading)
    require_lane_direction(agreement, speed[near], Path(network.path).name or "its lanes", path)


def is_right_to_left(
    x: FloatArray, y: FloatArray, heading: FloatArray, across: FloatArray, edge: IntArray
) -> bool | None:
    """Whether places across an edge, as counted by a source, grow to the left of travel, by where they are; None: it
    can't be told. All of shape (n,). [m], [rad]"""
    from_line, counted = list[FloatArray](), list[FloatArray]()
    for number in np.unique(edge):
        mine = np.flatnonzero((edge == number) & np.isfinite(x + y + heading))
        if len(mine) < 2:
            continue
        way = float(np.arctan2(np.sin(heading[mine]).mean(), np.cos(heading[mine]).mean()))
        straight = mine[np.cos(heading[mine] - way) > STRAIGHT_AGREEMENT]
        if len(straight) > max(1, 0.9 * len(mine)):
            left = np.cos(way) * y[straight] - np.sin(way) * x[straight]
            from_line.append(left - left.mean())
            counted.append(across[straight] - across[straight].mean())
    left, places = (np.concatenate([np.zeros(0), *parts]) for parts in (from_line, counted))
    if not len(left) or min(left.std(), places.std()) < LEAST_SPREAD:
        return None
    agreement = float(np.corrcoef(left, places)[0, 1])
    return agreement > 0.0 if abs(agreement) > LANE_AGREEMENT else None


def _share(rows: BoolArray) -> float:
    return float(rows.mean()) if len(rows) else 0.0
