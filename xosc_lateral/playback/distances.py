"""Distances between an entity and something else, in the ways that conditions and actions ask for.

All signed: positive ahead, or to the left. The reference direction is that of the road at the entity, turned the way
that the entity points; without a road, the entity's own heading (as in the reference player).
"""

from __future__ import annotations

from math import copysign, cos, hypot, inf, sin

from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.playback import boxes
from xosc_lateral.playback.paths.base import nearest_s
from xosc_lateral.playback.state import NOWHERE, EntityState
from xosc_lateral.road.network import RoadNetwork
from xosc_lateral.road.positions import RoadPath
from xosc_lateral.scenario.enums import CoordinateSystem, RelativeDistanceType

_ALONG_ROADS = (CoordinateSystem.ROAD, CoordinateSystem.LANE)

FAR = 1e10
"""Distance where there is no way from one to the other. [m]"""


class Spot(Struct, frozen=True):
    """A place that distances are measured to. `lane` is 0 and `road` -1 where it is on no road. [m]"""

    x: float
    y: float
    road: int
    lane: int
    s: float
    t: float


class RoadGap(Struct, frozen=True):
    """From one place to another along the roads, seen there.

    [m], lanes (positive to +t, lane 0 not counted), whether on the other side of lane 0, whether s runs the other way.
    """

    ds: float
    dt: float
    lanes: int
    opposite: bool
    is_turned: bool = False


def ahead_and_left(state: EntityState, x: float, y: float) -> tuple[float, float]:
    """Components of the way to a point in the entity's own frame: along its heading, and to its left. [m]"""
    pose = state.plane
    c, s = cos(pose.heading), sin(pose.heading)
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
    return _gap_between(network, spot_of(state), spot, 1 if state.is_forward else -1, limit)


def free_road_gap(
    network: RoadNetwork, state: EntityState, other: EntityState, *, limit: float = FAR
) -> RoadGap | None:
    """Free space along the roads to another entity, and the lanes between their front right corners; None: no way.

    A box may lie in two lanes, and the standard does not say which counts: the corner as in the reference player,
    where boxes that touch are in the same lane.
    """
    if boxes.overlap(state, other):
        return RoadGap(0.0, 0.0, 0, opposite=False)
    ds = entity_distance(
        network, state, other, CoordinateSystem.ROAD, RelativeDistanceType.LONGITUDINAL, freespace=True
    )
    if ds is None:
        return None
    own, theirs = (_project(network, state, *boxes.corners(one)[-1]) for one in (state, other))
    gap = _gap_between(network, own, theirs, 1 if state.is_forward else -1, limit)
    return gap and replace(gap, ds=ds)


def _gap_between(network: RoadNetwork, own: Spot, spot: Spot, direction: int, limit: float) -> RoadGap | None:
    if own.road == NOWHERE or spot.road == NOWHERE:
        return None
    path = network.path_between((own.road, own.s), (spot.road, spot.s), direction=direction, limit=limit)
    if path is None:
        return None
    lane = _lane_there(network, own, path)
    opposite = lane * spot.lane < 0
    lanes = spot.lane - lane
    if opposite:
        lanes -= 1 if lanes > 0 else -1
    return RoadGap(path.ds, spot.t - (-own.t if path.is_turned else own.t), lanes, opposite, path.is_turned)


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
    if kind is RelativeDistanceType.EUCLIDIAN or system not in _ALONG_ROADS:
        shape = boxes.corners(other)
        if system is CoordinateSystem.WORLD and kind is not RelativeDistanceType.EUCLIDIAN:
            east, north = boxes.gaps_between(boxes.corners(state), shape, network.header_offset.heading)
            return north if kind is RelativeDistanceType.LATERAL else east
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


def train_distance(
    network: RoadNetwork,
    state: EntityState,
    other: EntityState,
    system: CoordinateSystem,
    kind: RelativeDistanceType,
    *,
    freespace: bool,
) -> float | None:
    """As `entity_distance`; free space is that of the nearest two of both vehicles and all trailers that they draw."""
    pairs = [(own, theirs) for own in _train(state) for theirs in _train(other)]
    if not freespace or len(pairs) == 1:
        return entity_distance(network, state, other, system, kind, freespace=freespace)
    along = system in _ALONG_ROADS and kind is not RelativeDistanceType.EUCLIDIAN
    apart = kind if along else RelativeDistanceType.EUCLIDIAN
    found = [entity_distance(network, *pair, system, apart, freespace=True) for pair in pairs]
    gap, nearest = min(zip(found, pairs, strict=True), key=lambda one: inf if one[0] is None else abs(one[0]))
    return gap if apart is kind else entity_distance(network, *nearest, system, kind, freespace=True)


def _train(state: EntityState) -> list[EntityState]:
    """The vehicle in front and what it draws."""
    while state.tow is not None:
        state = state.tow
    members = [state]
    while state.trailer is not None:
        state = state.trailer
        members.append(state)
    return members


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
    if freespace and system is CoordinateSystem.WORLD and kind is not RelativeDistanceType.EUCLIDIAN:
        own, point = boxes.corners(state), ((spot.x, spot.y),)
        east, north = boxes.gaps_between(own, point, network.header_offset.heading)
        return north if kind is RelativeDistanceType.LATERAL else east
    if freespace and (kind is RelativeDistanceType.EUCLIDIAN or system not in _ALONG_ROADS):
        return _freespace_to_point(state, (spot.x, spot.y), kind)
    if freespace:
        return _road_freespace(network, state, [spot], kind)
    if kind is RelativeDistanceType.EUCLIDIAN:
        return straight_distance(state, spot.x, spot.y)
    lateral = kind is RelativeDistanceType.LATERAL
    if system is CoordinateSystem.WORLD:
        pose, turn = state.plane, network.header_offset.heading
        dx, dy = spot.x - pose.x, spot.y - pose.y
        return dx * sin(turn) + dy * cos(turn) if lateral else dx * cos(turn) - dy * sin(turn)
    if system is CoordinateSystem.TRAJECTORY:
        return _along_trajectory(state, spot, lateral=lateral)
    if system is CoordinateSystem.ENTITY:
        ahead, left = ahead_and_left(state, spot.x, spot.y)
        return left if lateral else ahead
    gap = road_gap(network, state, spot)
    if gap is None:
        return None
    return gap.dt if lateral else gap.ds


def _along_trajectory(state: EntityState, spot: Spot, *, lateral: bool) -> float:
    """From where an entity is on its trajectory to the nearest point there; without one, straight."""
    if state.path is None:
        return straight_distance(state, spot.x, spot.y)
    path = state.path.path
    s = nearest_s(path, spot.x, spot.y)
    if not lateral:
        return s - state.path.s
    point = path.at(s)
    return (spot.y - point.y) * cos(point.tangent) - (spot.x - point.x) * sin(point.tangent)


def spot_for(state: EntityState, system: CoordinateSystem, kind: RelativeDistanceType) -> Spot:
    """Where an entity is, with road coordinates only when the distance needs them."""
    if kind is RelativeDistanceType.EUCLIDIAN or system not in _ALONG_ROADS:
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
            path = network.path_between((own.road, own.s), (spot.road, spot.s), direction=direction)
            if path is None:
                return None
            values.append(spot.t - (-own.t if path.is_turned else own.t) if lateral else path.ds)
    if min(values) < 0.0 <= max(values):
        return 0.0
    return min(values, key=abs)


def _project(network: RoadNetwork, state: EntityState, x: float, y: float) -> Spot:
    """Road coordinates of a point near an entity."""
    if state.road == NOWHERE:
        return Spot(x, y, NOWHERE, 0, 0.0, 0.0)
    found = network.world_to_lane_at(x, y, near=(state.road, state.s), lane_types=None)
    return Spot(x, y, found.road, found.lane, found.s, found.t)


def _lane_there(network: RoadNetwork, own: Spot, path: RoadPath) -> int:
    """Lane that a place's lane leads to at the end of a way; where none does, its own, counted from there."""
    road, lane, way = own.road, own.lane, path.way
    for entered, entry in path.entered:
        onward = network.next_lanes(road, lane, way)
        there = [link.lane for link in onward if (link.road, link.direction) == (entered, entry)]
        if not there:
            return -own.lane if path.is_turned else own.lane
        road, lane, way = entered, there[0], entry
    return lane
