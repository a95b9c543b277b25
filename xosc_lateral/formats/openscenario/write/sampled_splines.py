"""Clothoid splines as polylines for versions before 1.3, which have none, in scenarios that stay reactive."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, hypot, isfinite, nan, sqrt

from lxml import etree

from xosc_lateral.formats.openscenario.element import XmlElement, local_name
from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.formats.openscenario.write.literal import in_scope
from xosc_lateral.formats.openscenario.write.losses import Losses
from xosc_lateral.formats.openscenario.write.path_pieces import LEAST_SPACING, VERTEX_SPACING
from xosc_lateral.playback.paths.clothoid import TimedClothoid
from xosc_lateral.scenario.parameters import Scope

Frame = tuple[str, str]
"""A position's tag, and the entity that it is relative to ("" in the world)."""
Pose = tuple[float, float, float]
"""x, y [m], heading [rad] in a frame."""

SINCE = (1, 3)
"""Version from which a trajectory may be a clothoid spline."""
SAGITTA = 0.005
"""How far a straight line between two vertices may be from the arc. [m]"""
FARTHEST = 2.0
"""Distance between vertices: the reference player turns a car within 2 m of them. [m]"""


def sample_splines(losses: Losses, scope: Scope) -> None:
    """Write polylines in place of clothoid splines whose segments begin in the world, at one object or at the entity.

    What else there is stays, and is refused or left out with what its version lacks: where such a spline begins
    depends on the road.
    """
    for item, within in list(in_scope(losses, losses.root, scope, "ClothoidSpline")):
        spline = XmlElement(item, losses.path, within)
        frame = _frame(spline)
        if frame is None:
            continue
        shape = item.getparent()
        assert shape is not None
        polyline = _polyline(spline, frame)
        build.insert_indented(shape, shape.index(item), polyline)
        polyline.tail = item.tail
        shape.remove(item)
        losses.note(f"ClothoidSpline: written as a Polyline of {len(polyline)} vertices ({losses.target} has none)")


def _polyline(spline: XmlElement, frame: Frame) -> etree._Element:
    polyline = etree.Element("Polyline")
    for pose, time in _vertices(_pieces(spline), spline.optional_number("timeEnd")):
        _add_vertex(polyline, frame, pose, time)
    return polyline


def _frame(spline: XmlElement) -> Frame | None:
    """What all its starts are given in; None where that is not one, or the road decides."""
    frames = set()
    for number, segment in enumerate(spline.children("ClothoidSplineSegment")):
        holder = segment.child("PositionStart")
        position = None if holder is None else next(holder.children())
        if position is None and number == 0:
            frames.add(("RelativeObjectPosition", _only_actor(spline.xml)))
        elif position is not None and position.tag == "WorldPosition":
            frames.add((position.tag, ""))
        elif position is not None and _is_at_object(position):
            frames.add(("RelativeObjectPosition", position.text("entityRef")))
        elif position is not None:
            return None
    tag, entity = frames.pop()
    return None if frames or entity is None else (tag, entity)


def _is_at_object(position: XmlElement) -> bool:
    """Along an object's axes: its heading counts from the object's, as it does without a type since 1.3."""
    turned = position.child("Orientation")
    if turned is not None and turned.text("type", "relative") != "relative":
        return False
    at_it = position.number("dx", 0.0) == position.number("dy", 0.0) == 0.0
    return position.tag == "RelativeObjectPosition" or (position.tag == "RelativeWorldPosition" and at_it)


def _only_actor(item: etree._Element) -> str | None:
    """The entity that follows; None where there is not exactly one."""
    group = next((owner for owner in item.iterancestors() if local_name(owner) in ("ManeuverGroup", "Private")), None)
    if group is None:
        return None
    if local_name(group) == "Private":
        return group.get("entityRef")
    names = [reference.get("entityRef") for reference in group.iterfind("{*}Actors/{*}EntityRef")]
    return names[0] if len(names) == 1 else None


def _pieces(spline: XmlElement) -> list[TimedClothoid]:
    pieces: list[TimedClothoid] = []
    for segment in spline.children("ClothoidSplineSegment"):
        holder = segment.child("PositionStart")
        pose = pieces[-1].at(pieces[-1].length) if pieces else (0.0, 0.0, 0.0)
        x, y, heading = pose if holder is None else _pose(next(holder.children()))
        heading += segment.number("hOffset", 0.0)
        bends = segment.number("curvatureStart"), segment.number("curvatureEnd")
        start = segment.optional_number("timeStart")
        pieces.append(TimedClothoid(x, y, heading, *bends, segment.number("length"), nan if start is None else start))
    return pieces


def _pose(position: XmlElement) -> Pose:
    if position.tag == "WorldPosition":
        return position.number("x"), position.number("y"), position.number("h", 0.0)
    turned = position.child("Orientation")
    return position.number("dx"), position.number("dy"), 0.0 if turned is None else turned.number("h", 0.0)


def _vertices(pieces: list[TimedClothoid], end: float | None) -> Iterator[tuple[Pose, float]]:
    """Evenly on each piece, close enough for its sharpest bend, none closer to the last than a player tells apart."""
    last: Pose | None = None
    ends = [*(piece.start_time for piece in pieces[1:]), nan if end is None else end]
    for piece, end_time in zip(pieces, ends, strict=True):
        bend = max(abs(piece.curvature), abs(piece.end_curvature))
        step = min(FARTHEST, sqrt(8.0 * SAGITTA / bend) if bend > 0.0 else FARTHEST)
        count = max(1, min(ceil(piece.length / step), int(piece.length / VERTEX_SPACING)))
        for k in range(count + 1):
            share = k / count
            pose = piece.at(share * piece.length)
            if last is None or hypot(pose[0] - last[0], pose[1] - last[1]) >= LEAST_SPACING:
                yield pose, piece.start_time + share * (end_time - piece.start_time)
                last = pose


def _add_vertex(polyline: etree._Element, frame: Frame, pose: Pose, time: float) -> None:
    """Without a heading, as a spline gives none: a car that comes backwards goes on backwards."""
    tag, entity = frame
    x, y = (build.decimal(value, 5) for value in pose[:2])
    vertex = build.sub(polyline, "Vertex", time=build.decimal(time if isfinite(time) else 0.0, 6))
    position = build.sub(vertex, "Position")
    if tag == "WorldPosition":
        build.sub(position, tag, x=x, y=y)
    else:
        build.sub(position, tag, entityRef=entity, dx=x, dy=y)
