"""Distances between an entity and something else, in the ways that conditions and actions ask for.

All signed: positive ahead, or to the left. The reference direction is that of the road at the entity, turned the way
that the entity points; without a road, the entity's own heading (as in the reference player).

References
----------
.. [1] C. Ericson, "Real-Time Collision Detection", 2005, sections 5.1.2 (point and line segment) and 5.2.1
       (separating axes).
"""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, cos, hypot, inf, nan, sin

from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.world.player.drive import drawn_by
from xosc_lateral.world.player.paths.base import nearest_s
from xosc_lateral.world.player.state import NO_ROAD, EntityState
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.lanes import lanes_between
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.road.positions import RoadPath
from xosc_lateral.world.scenario.enums import CoordinateSystem, RelativeDistanceType

_ALONG_ROADS = (CoordinateSystem.ROAD, CoordinateSystem.LANE)

MARGIN = 1e-3
"""Beyond what would be enough: more than what a comparison tolerates, of times too, up to 300 m/s. [m]"""

MOST_STRETCH = 2.0
"""A way beside a reference line is taken for no longer than so many times the way along it. [-]"""

UNREACHABLE_DISTANCE = 1e10
"""Distance where there is no way from one to the other. [m]"""


class Spot(Struct, frozen=True):
    """A place that distances are measured to; without road coordinates where it has none, or nobody needs them. [m]"""

    x: float
    y: float
    road: int = NO_ROAD
    lane: int = 0
    s: float = 0.0
    t: float = 0.0


class RoadGap(Struct, frozen=True):
    """From one place to another along the roads, seen there."""

    ds: float  # [m]
    dt: float  # [m]
    lanes: int  # positive to +t, lane 0 not counted
    opposite: bool  # on the other side of lane 0
    is_turned: bool = False  # s runs the other way


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


def spot_of(state: EntityState, *, t: bool = True) -> Spot:
    """Where an entity is along the roads; x and y, which nobody needs then, are NaN, as is its t unless asked for."""
    state.locate()
    return Spot(nan, nan, state.road, state.lane, state.s, state.t if t and state.road != NO_ROAD else nan)


def road_gap(state: EntityState, spot: Spot, *, limit: float = UNREACHABLE_DISTANCE) -> RoadGap | None:
    """Way from an entity to a spot along the roads; None: there is none."""
    return _gap_between(state, spot_of(state), spot, limit)


def free_road_gap(state: EntityState, other: EntityState, *, limit: float = UNREACHABLE_DISTANCE) -> RoadGap | None:
    """Free space along the roads to another entity, and the lanes between their front right corners; None: no way.

    A box may lie in two lanes, and the standard does not say which counts: the corner as in the reference player,
    where boxes that touch are in the same lane.
    """
    if overlap(state, other):
        return RoadGap(0.0, 0.0, 0, opposite=False)
    ds = Measure(CoordinateSystem.ROAD, RelativeDistanceType.LONGITUDINAL, freespace=True).to_entity(state, other)
    if ds is None:
        return None
    ours, theirs = (_project(state, *corners(one)[-1]) for one in (state, other))
    gap = _gap_between(state, ours, theirs, limit)
    return gap and replace(gap, ds=ds)


def is_turned(state: EntityState, road: int, s: float) -> bool:
    """Whether s runs the other way at a place on a road: +t is on the other side there. [m]"""
    ends = (state.road, state.s), (road, s)
    path = None if NO_ROAD in (road, state.road) or road == state.road else state.network.path_between(*ends)
    return path is not None and path.is_turned


def _gap_between(state: EntityState, here: Spot, spot: Spot, limit: float) -> RoadGap | None:
    path = _path_between(state, here, spot, limit)
    if path is None:
        return None
    lane = _lane_there(state.network, here, path)
    across, lanes = _across(here, spot, path), lanes_between(lane, spot.lane)
    return RoadGap(path.ds, across, lanes, lane * spot.lane < 0, path.is_turned)


def _path_between(state: EntityState, here: Spot, spot: Spot, limit: float = UNREACHABLE_DISTANCE) -> RoadPath | None:
    """The way that an entity would drive from one place to another; None: there is none."""
    if here.road == NO_ROAD or spot.road == NO_ROAD:
        return None
    # a corner may be beyond a joint of roads that run towards each other
    direction = 1 if state.is_forward is not is_turned(state, here.road, here.s) else -1
    return state.network.path_between((here.road, here.s), (spot.road, spot.s), direction=direction, limit=limit)


def _across(here: Spot, spot: Spot, path: RoadPath) -> float:
    """Change of t on the way, as it is counted there. [m]"""
    return spot.t - (-here.t if path.is_turned else here.t)


class Measure(Struct, frozen=True, eq=False):
    """How a distance is measured, between boxes or reference points; None where no way leads along the roads."""

    system: CoordinateSystem
    kind: RelativeDistanceType
    freespace: bool = False
    note: Callable[[str, EntityState], None] = lambda what, state: None  # of what esmini measures otherwise

    @property
    def is_along_roads(self) -> bool:
        """Whether it needs road coordinates."""
        return self.kind is not RelativeDistanceType.EUCLIDIAN and self.system in _ALONG_ROADS

    def between(
        self, state: EntityState, target: Spot | EntityState, *, enough: float = inf, near: float = -inf
    ) -> float:
        """From an entity to a spot, or to another entity, all trailers included; `UNREACHABLE_DISTANCE` if none. [m]

        `enough`: what is farther, ahead or behind, need not be exact; `near`: what is nearer, and on which side [m]
        """
        gap = self.to_spot(state, target) if isinstance(target, Spot) else self._to_train(state, target, enough, near)
        return UNREACHABLE_DISTANCE if gap is None else gap

    def _to_train(self, state: EntityState, target: EntityState, enough: float, near: float) -> float | None:
        """Free space is that of the nearest two."""
        pairs = [(own, theirs) for own in _train(state) for theirs in _train(target)] if self.freespace else []
        if len(pairs) < 2:
            return self.to_entity(state, target, enough=enough, near=near)
        nearness = self if self.is_along_roads else replace(self, kind=RelativeDistanceType.EUCLIDIAN)
        gaps = [nearness.to_entity(*pair, enough=enough, near=near) for pair in pairs]
        gap, nearest = min(zip(gaps, pairs, strict=True), key=lambda each: inf if each[0] is None else abs(each[0]))
        return gap if nearness is self else self.to_entity(*nearest)

    def to_entity(
        self, state: EntityState, other: EntityState, *, enough: float = inf, near: float = -inf
    ) -> float | None:
        """From one entity to another, exact from `near` to `enough`. [m]"""
        if enough < inf and self.is_along_roads and self.kind is RelativeDistanceType.LONGITUDINAL:
            least, most = self._bounds(state, other, enough, near)
            if least > enough + MARGIN or most < near - MARGIN:
                return least if least > enough else most
        if not self.freespace:
            is_lateral = self.kind is RelativeDistanceType.LATERAL
            place = spot_of(other, t=is_lateral) if self.is_along_roads else Spot(other.plane.x, other.plane.y)
            return self.to_spot(state, place)
        if not self.is_along_roads:
            return self._between_boxes(state, corners(other), lambda: overlap(state, other))
        if overlap(state, other):
            return 0.0
        return self._between_corners(state, [_project(state, x, y) for x, y in corners(other)], other.name)

    def _bounds(self, state: EntityState, other: EntityState, enough: float, near: float) -> tuple[float, float]:
        """How far away it is at least and at most, ahead or behind, as closely as `to_entity` needs it: by where both
        are, and from one's place on its road to the other's, which are beside their boxes. No road bends so much that a
        way is half as long along its reference line.
        """
        sizes = _reach(state) + _reach(other) if self.freespace else 0.0
        least, most = 0.5 * apart(state, other.plane.x, other.plane.y) - sizes, inf
        if not self.freespace:
            return least, most
        rooms = min(_room(state), _room(other))
        is_on_roads, ends = NO_ROAD not in (state.road, other.road), ((state.road, state.s), (other.road, other.s))
        path = state.network.path_between(*ends) if is_on_roads else None
        if path is not None and rooms > 0.0:
            # a reference point may be beside its own box
            boxes = (one.entity.bounding_box for one in (state, other))
            beside = sum(
                max(abs(box.center_x) - 0.5 * box.length, abs(box.center_y) - 0.5 * box.width, 0.0) for box in boxes
            )
            away, stretch = abs(path.ds), MOST_STRETCH
            if beside > 0.0 or near - MARGIN <= away <= enough + MARGIN + stretch * sizes:  # bends decide
                stretch = max(1.0 / max(1.0 - abs(_bend(one)), 1.0 / MOST_STRETCH) for one in (state, other))
            most = away + 2.0 * stretch * beside
            least = max(least, away - stretch * sizes)
        elif path is None and is_on_roads:
            what = f"no way leads along the roads to '{other.name}'; in esmini, one to where its box is nearest"
            self.note(what, state)
        return least, most

    def to_spot(self, state: EntityState, spot: Spot) -> float | None:
        """From an entity to a spot. [m]"""
        if self.freespace:
            if self.is_along_roads:
                return self._between_corners(state, [spot])
            return self._between_boxes(
                state, ((spot.x, spot.y),), lambda: holds_point(corners(state), (spot.x, spot.y))
            )
        if self.kind is RelativeDistanceType.EUCLIDIAN:
            return straight_distance(state, spot.x, spot.y)
        lateral = self.kind is RelativeDistanceType.LATERAL
        if self.system is CoordinateSystem.WORLD:
            pose, turn = state.plane, state.network.header_offset.heading
            dx, dy = spot.x - pose.x, spot.y - pose.y
            return dx * sin(turn) + dy * cos(turn) if lateral else dx * cos(turn) - dy * sin(turn)
        if self.system is CoordinateSystem.TRAJECTORY:
            return _along_trajectory(state, spot, lateral=lateral)
        if self.system is CoordinateSystem.ENTITY:
            ahead, left = ahead_and_left(state, spot.x, spot.y)
            return left if lateral else ahead
        here = spot_of(state, t=lateral)
        path = _path_between(state, here, spot)
        return None if path is None else _across(here, spot, path) if lateral else path.ds

    def _between_boxes(self, state: EntityState, shape: tuple[Point, ...], touches: Callable[[], bool]) -> float:
        """Gap from an entity's box to a shape, straight or along the axes of the world or of the entity. [m]"""
        ours, along_own = corners(state), -state.plane.heading
        if self.kind is RelativeDistanceType.EUCLIDIAN:
            ahead, _ = box_gaps(ours, shape, along_own)
            return 0.0 if touches() else copysign(distance_between(ours, shape), ahead or 1.0)
        in_world = self.system is CoordinateSystem.WORLD
        along, across = box_gaps(ours, shape, state.network.header_offset.heading if in_world else along_own)
        return across if self.kind is RelativeDistanceType.LATERAL else along

    def _between_corners(self, state: EntityState, spots: list[Spot], name: str = "") -> float | None:
        """Smallest gap along (or across) the road between the projected corners; 0 where they overlap. [m]"""
        state.locate()
        rows = list[list[float]]()
        for place in (_project(state, x, y) for x, y in corners(state)):
            paths = [(spot, _path_between(state, place, spot)) for spot in spots]
            ways = [(spot, path) for spot, path in paths if path is not None]
            if len(ways) < len(spots):
                return None
            lateral = self.kind is RelativeDistanceType.LATERAL
            rows.append([_across(place, spot, path) if lateral else path.ds for spot, path in ways])
        low, high = min(map(min, rows)), max(map(max, rows))
        nearest = min((value for row in rows for value in row), key=abs)
        # On both sides of each other, and no farther than boxes reach: ways round a ring lead to either side, too.
        reach = 2.0 * _reach(state) + max(hypot(spot.x - spots[0].x, spot.y - spots[0].y) for spot in spots)
        beside = low < 0.0 <= high and high - low <= 2.0 * reach
        if name and beside is not any(min(row) < 0.0 <= max(row) for row in rows):
            what = "beside all of" if beside else "nowhere beside"
            self.note(f"it is {what} '{name}' along the road; in esmini, its free space is as if it were not so", state)
        return 0.0 if beside else nearest


def _train(state: EntityState) -> list[EntityState]:
    """The vehicle in front and what it draws."""
    while state.tow is not None:
        state = state.tow
    return [state, *(trailer for _, trailer in drawn_by(state))]


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


def _project(state: EntityState, x: float, y: float) -> Spot:
    """Road coordinates of a point near an entity."""
    if state.road == NO_ROAD:
        return Spot(x, y)
    lane_position = state.network.world_to_lane_at(x, y, near=(state.road, state.s), lane_types=None)
    return Spot(x, y, lane_position.road, lane_position.lane, lane_position.s, lane_position.t)


def _lane_there(network: RoadNetwork, here: Spot, path: RoadPath) -> int:
    """Lane that a place's lane leads to at the end of a way; where none does, its own, counted from there."""
    road, lane, way = here.road, here.lane, path.way
    for entered, entry in path.entered:
        onward = network.next_lanes(road, lane, way)
        there = [link.lane for link in onward if (link.road, link.direction) == (entered, entry)]
        if not there:
            return -here.lane if path.is_turned else here.lane
        road, lane, way = entered, there[0], entry
    return lane


# ---- bounding boxes in the plane: overlap, and gaps between them [m] ----
Point = tuple[float, float]

HEIGHT_APART = 2.5
"""Entities further apart than this in z are on different levels of the road: they don't touch. [m]"""


def _room(state: EntityState) -> float:
    """How far an entity may go with all its box on the road that it is on; none within junctions. [m]"""
    state.locate()
    if state.road == NO_ROAD or (road := state.network.roads[state.road]).junction is not None:
        return 0.0
    return min(state.s, road.length - state.s) - 2.0 * _reach(state)


def _bend(state: EntityState) -> float:
    """By how much less than its way a part of an entity goes along the reference line, at most, where it is. [-]"""
    reach = _reach(state)
    bends = (abs(state.network.curvature_at(state.road, state.s + ds)) for ds in (-reach, 0.0, reach))
    return (abs(state.t) + reach) * max(bends)


def _reach(state: EntityState) -> float:
    """No corner of its box is further from its reference point. [m]"""
    box = state.entity.bounding_box
    return hypot(0.5 * box.length + abs(box.center_x), 0.5 * box.width + abs(box.center_y))


def corners(state: EntityState) -> tuple[Point, Point, Point, Point]:
    """Corners of an entity's box, counter-clockwise from front left."""
    box, pose = state.entity.bounding_box, state.plane
    c, s = cos(pose.heading), sin(pose.heading)
    front, rear = box.center_x + 0.5 * box.length, box.center_x - 0.5 * box.length
    left, right = box.center_y + 0.5 * box.width, box.center_y - 0.5 * box.width

    def world(x: float, y: float) -> Point:
        return pose.x + x * c - y * s, pose.y + x * s + y * c

    return world(front, left), world(rear, left), world(rear, right), world(front, right)


def axis_gap(corners_: tuple[Point, ...], other: tuple[Point, ...], axis: Point) -> float:
    """Signed gap from `corners_` to `other` along an axis; 0 where their shadows overlap."""
    mine, theirs = ([x * axis[0] + y * axis[1] for x, y in shape] for shape in (corners_, other))
    ahead, behind = min(theirs) - max(mine), max(theirs) - min(mine)
    return ahead if ahead > EPSILON else behind if behind < -EPSILON else 0.0


def overlap(a: EntityState, b: EntityState) -> bool:
    """Whether the boxes touch (separating axes), on the same level."""
    pa, pb = a.plane, b.plane
    if hypot(pb.x - pa.x, pb.y - pa.y) > _reach(a) + _reach(b) or abs(b.pose.z - a.pose.z) > HEIGHT_APART:
        return False
    first, other = corners(a), corners(b)
    return not any(any(box_gaps(first, other, -heading)) for heading in (pa.heading, pb.heading))


def distance_between(a: tuple[Point, ...], b: tuple[Point, ...]) -> float:
    """Shortest distance between the outlines of two convex shapes that don't overlap; either may be a point."""
    return min(
        _to_edge(point, start, end)
        for points, outline in ((a, b), (b, a))
        for start, end in zip(outline, outline[1:] + outline[:1], strict=True)
        for point in points
    )


def _to_edge(point: Point, start: Point, end: Point) -> float:
    ux, uy = end[0] - start[0], end[1] - start[1]
    length = ux * ux + uy * uy
    u = 0.0 if length == 0.0 else ((point[0] - start[0]) * ux + (point[1] - start[1]) * uy) / length
    u = min(max(u, 0.0), 1.0)
    return hypot(point[0] - start[0] - u * ux, point[1] - start[1] - u * uy)


def holds_point(box: tuple[Point, ...], point: Point) -> bool:
    """Whether a point is inside a box given by its corners."""
    (ax, ay), (bx, by), _, (dx, dy) = box
    sides = (bx - ax, by - ay), (dx - ax, dy - ay)
    return all(0.0 <= (point[0] - ax) * ux + (point[1] - ay) * uy <= ux * ux + uy * uy for ux, uy in sides)


def box_gaps(shape_: tuple[Point, ...], shape: tuple[Point, ...], turn: float) -> tuple[float, float]:
    """Gap from `shape_` to a shape along the axes of a frame turned back by `turn` [rad]; 0 where they overlap."""
    c, s = cos(turn), sin(turn)
    return axis_gap(shape_, shape, (c, -s)), axis_gap(shape_, shape, (s, c))
