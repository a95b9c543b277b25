"""Distances between an entity and something else, in the ways that conditions and actions ask for.

All signed: positive ahead, or to the left. The reference direction is that of the road at the entity, turned the way
that the entity points; without a road, the entity's own heading (as in the reference player).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, cos, hypot, sin

from xosc_lateral.motion import boxes
from xosc_lateral.motion.angles import is_forward
from xosc_lateral.motion.state import NOWHERE, EntityState
from xosc_lateral.road.network import RoadNetwork
from xosc_lateral.scenario.enums import CoordinateSystem, RelativeDistanceType

FAR = 1e10
"""Distance where there is no way from one to the other. [m]"""


@dataclass(frozen=True, slots=True)
class Spot:
    """A place that distances are measured to. `lane` is 0 and `road` -1 where it is on no road. [m]"""

    x: float
    y: float
    road: int
    lane: int
    s: float
    t: float


@dataclass(frozen=True, slots=True)
class RoadGap:
    """From one place to another along the roads: [m], lanes (positive to +t, lane 0 not counted), whether opposite."""

    ds: float
    dt: float
    lanes: int
    opposite: bool


def ahead_and_left(state: EntityState, x: float, y: float) -> tuple[float, float]:
    """Components of the way to a point, along and across the road as the entity points."""
    pose = state.pose
    heading = state.road_heading() if state.road != NOWHERE or not state.is_located else pose.heading
    if state.road != NOWHERE and not is_forward(state.relative_heading):
        c, s = -cos(heading), -sin(heading)
    else:
        c, s = cos(heading), sin(heading)
    dx, dy = x - pose.x, y - pose.y
    return dx * c + dy * s, dy * c - dx * s


def apart(state: EntityState, x: float, y: float) -> float:
    """Euclidian distance in the plane, never negative. [m]"""
    pose = state.plane
    return hypot(pose.x - x, pose.y - y)


def straight_distance(state: EntityState, x: float, y: float) -> float:
    """Euclidian distance, negative when the point is behind."""
    ahead, left = ahead_and_left(state, x, y)
    length = hypot(ahead, left)
    return length if ahead > 0.0 else -length


def spot_of(state: EntityState) -> Spot:
    """Where an entity is."""
    state.locate()
    pose = state.pose
    if state.road == NOWHERE:
        return Spot(pose.x, pose.y, NOWHERE, 0, 0.0, 0.0)
    return Spot(pose.x, pose.y, state.road, state.lane, state.s, state.t)


def road_gap(network: RoadNetwork, state: EntityState, spot: Spot, *, limit: float = FAR) -> RoadGap | None:
    """Way from an entity to a spot along the roads; None: there is none."""
    state.locate()
    if state.road == NOWHERE or spot.road == NOWHERE:
        return None
    direction = 1 if state.is_forward else -1
    ds = network.path_distance((state.road, state.s), (spot.road, spot.s), direction=direction, limit=limit)
    if ds is None:
        return None
    lane = state.lane if spot.road == state.road else _lane_there(network, state, spot)
    opposite = lane * spot.lane < 0
    lanes = spot.lane - lane
    if opposite:
        lanes -= 1 if lanes > 0 else -1
    side = copysign(1.0, lane) * copysign(1.0, state.lane)
    return RoadGap(ds, spot.t - side * state.t, lanes, opposite)


def entity_distance(
    network: RoadNetwork,
    state: EntityState,
    other: EntityState,
    system: CoordinateSystem,
    kind: RelativeDistanceType,
    *,
    freespace: bool,
) -> float | None:
    """Distance to another entity; None: no way along the roads."""
    if not freespace:
        return spot_distance(network, state, spot_for(other, system, kind), system, kind)
    if kind is RelativeDistanceType.EUCLIDIAN or system is CoordinateSystem.ENTITY:
        shape = boxes.corners(other)
        ahead, left = boxes.gaps(state, shape)
        if kind is RelativeDistanceType.LONGITUDINAL:
            return ahead
        if kind is RelativeDistanceType.LATERAL:
            return left
        if boxes.overlap(state, other):
            return 0.0
        return copysign(boxes.distance_between(boxes.corners(state), shape), ahead or 1.0)
    if boxes.overlap(state, other):
        return 0.0
    return _road_freespace(network, state, [_project(network, state, x, y) for x, y in boxes.corners(other)], kind)


def spot_distance(
    network: RoadNetwork,
    state: EntityState,
    spot: Spot,
    system: CoordinateSystem,
    kind: RelativeDistanceType,
    *,
    freespace: bool = False,
) -> float | None:
    """Distance to a spot; None: no way along the roads."""
    in_plane = kind is RelativeDistanceType.EUCLIDIAN or system is CoordinateSystem.ENTITY
    if freespace and in_plane:
        return _freespace_to_point(state, (spot.x, spot.y), kind)
    if freespace:
        return _road_freespace(network, state, [spot], kind)
    if kind is RelativeDistanceType.EUCLIDIAN:
        return straight_distance(state, spot.x, spot.y)
    if system in (CoordinateSystem.ENTITY, CoordinateSystem.WORLD, CoordinateSystem.TRAJECTORY):
        ahead, left = ahead_and_left(state, spot.x, spot.y)
        return left if kind is RelativeDistanceType.LATERAL else ahead
    gap = road_gap(network, state, spot)
    if gap is None:
        return None
    return gap.dt if kind is RelativeDistanceType.LATERAL else gap.ds


def spot_for(state: EntityState, system: CoordinateSystem, kind: RelativeDistanceType) -> Spot:
    """Where an entity is, with road coordinates only when the distance needs them."""
    if kind is RelativeDistanceType.EUCLIDIAN or system not in (CoordinateSystem.ROAD, CoordinateSystem.LANE):
        pose = state.plane
        return Spot(pose.x, pose.y, NOWHERE, 0, 0.0, 0.0)
    return spot_of(state)


def _freespace_to_point(state: EntityState, point: boxes.Point, kind: RelativeDistanceType) -> float:
    own = boxes.corners(state)
    ahead, left = boxes.gaps(state, (point,))
    if kind is RelativeDistanceType.LONGITUDINAL:
        return ahead
    if kind is RelativeDistanceType.LATERAL:
        return left
    if boxes.holds_point(own, point):
        return 0.0
    return copysign(boxes.distance_between(own, (point,)), ahead or 1.0)


def _road_freespace(
    network: RoadNetwork, state: EntityState, spots: list[Spot], kind: RelativeDistanceType
) -> float | None:
    """Smallest gap along (or across) the road between the projected corners; 0 where they overlap."""
    state.locate()
    lateral = kind is RelativeDistanceType.LATERAL
    values = []
    direction = 1 if state.is_forward else -1
    for own in (_project(network, state, x, y) for x, y in boxes.corners(state)):
        for spot in spots:
            if own.road == NOWHERE or spot.road == NOWHERE:
                return None
            ds = network.path_distance((own.road, own.s), (spot.road, spot.s), direction=direction)
            if ds is None:
                return None
            values.append(spot.t - own.t if lateral else ds)
    if min(values) < 0.0 <= max(values):
        return 0.0
    return min(values, key=abs)


def _project(network: RoadNetwork, state: EntityState, x: float, y: float) -> Spot:
    """Road coordinates of a point near an entity."""
    if state.road == NOWHERE:
        return Spot(x, y, NOWHERE, 0, 0.0, 0.0)
    found = network.world_to_lane_at(x, y, near=(state.road, state.s), lane_types=None)
    return Spot(x, y, found.road, found.lane, found.s, found.t)


def _lane_there(network: RoadNetwork, state: EntityState, spot: Spot) -> int:
    """Lane on the spot's road that the entity's lane leads to; the lane of the same id where none does."""
    steps = network.route((state.road, state.lane, state.s), (spot.road, spot.lane, spot.s))
    if steps is None:
        return state.lane
    road, lane, s = state.road, state.lane, state.s
    for step in steps[1:]:
        direction = 1 if (state.is_forward if road == state.road else step.direction > 0) else -1
        links = [link for link in network.next_lanes(road, lane, direction) if link.road == step.road]
        if not links:
            return state.lane
        road, lane, s = links[0].road, links[0].lane, links[0].s
    return lane if s is not None else state.lane
