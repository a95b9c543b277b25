"""Bounding boxes in the plane: overlap, and gaps between them. [m]

References
----------
.. [1] C. Ericson, "Real-Time Collision Detection", 2005, sections 5.1.2 (point and line segment) and 5.2.1
       (separating axes).
"""

from __future__ import annotations

from math import cos, hypot, inf, sin

from xosc_lateral.world.player.state import EntityState
from xosc_lateral.world.player.transition import EPSILON

Point = tuple[float, float]

HEIGHT_APART = 2.5
"""Entities further apart than this in z are on different levels of the road: they don't touch. [m]"""


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
    mine = [x * axis[0] + y * axis[1] for x, y in corners_]
    theirs = [x * axis[0] + y * axis[1] for x, y in other]
    if max(mine) < min(theirs) - EPSILON:
        return min(theirs) - max(mine)
    if min(mine) > max(theirs) + EPSILON:
        return max(theirs) - min(mine)
    return 0.0


def overlap(a: EntityState, b: EntityState) -> bool:
    """Whether the boxes touch (separating axes), on the same level."""
    pa, pb = a.plane, b.plane
    box_a, box_b = a.entity.bounding_box, b.entity.bounding_box
    reach = hypot(box_a.length + box_b.length, box_a.width + box_b.width)
    if hypot(pb.x - pa.x, pb.y - pa.y) > reach or abs(b.pose.z - a.pose.z) > HEIGHT_APART:
        return False
    first, other = corners(a), corners(b)
    return not any(any(gaps(first, other, -heading)) for heading in (pa.heading, pb.heading))


def distance_between(a: tuple[Point, ...], b: tuple[Point, ...]) -> float:
    """Shortest distance between the outlines of two convex shapes that don't overlap; either may be a point."""
    best = inf
    for points, outline in ((a, b), (b, a)):
        edges = list(zip(outline, outline[1:] + outline[:1], strict=True))
        for point in points:
            for start, end in edges:
                ux, uy = end[0] - start[0], end[1] - start[1]
                length = ux * ux + uy * uy
                u = 0.0 if length == 0.0 else ((point[0] - start[0]) * ux + (point[1] - start[1]) * uy) / length
                u = min(max(u, 0.0), 1.0)
                best = min(best, hypot(point[0] - start[0] - u * ux, point[1] - start[1] - u * uy))
    return best


def holds_point(box: tuple[Point, ...], point: Point) -> bool:
    """Whether a point is inside a box given by its corners."""
    (ax, ay), (bx, by), _, (dx, dy) = box
    for ux, uy in ((bx - ax, by - ay), (dx - ax, dy - ay)):
        along = (point[0] - ax) * ux + (point[1] - ay) * uy
        if not 0.0 <= along <= ux * ux + uy * uy:
            return False
    return True


def gaps(shape_: tuple[Point, ...], shape: tuple[Point, ...], turn: float) -> tuple[float, float]:
    """Gap from `shape_` to a shape along the axes of a frame turned back by `turn` [rad]; 0 where they overlap."""
    c, s = cos(turn), sin(turn)
    return axis_gap(shape_, shape, (c, -s)), axis_gap(shape_, shape, (s, c))
