"""``lanes``: lane offset and lane sections, one-sided sections included."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf

from msgspec import Struct, structs

from xosc_lateral.files.opendrive.document import RoadFile, XmlElement
from xosc_lateral.world.road.lanes import LaneRecord, LaneSection, build_section
from xosc_lateral.world.road.piecewise import PiecewiseCubic
from xosc_lateral.world.road.positions import RoadMark

MAXIMUM_LANE_ID = 1000
"""No lane id is further from 0: tables of lanes grow with it."""

MAXIMUM_LANE_WIDTH = 1000.0
"""No lane is wider, or further off its reference line. [m]"""

_REVERSED = "laneSection/*/lane[@direction='reversed']"

SPEED_UNITS = {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704}


class _Written(Struct, frozen=True):
    """A section as written; a side is None where the section says nothing about it (``singleSide``)."""

    start: float
    left: tuple[LaneRecord, ...] | None
    right: tuple[LaneRecord, ...] | None
    centre_marks: tuple[RoadMark, ...]


def read_sections(
    road: XmlElement, length: float, rule: str, source: RoadFile
) -> tuple[tuple[LaneSection, ...], dict[int, int]]:
    """Lane sections, gapless over [0, length], and the travel direction of each lane id."""
    offsets = [e for lanes in _permanent(road.iterfind("lanes")) for e in lanes.iterfind("laneOffset")]
    offset_records = [(source.number(e, "s"), source.cubic(e)) for e in offsets]
    lane_offset = PiecewiseCubic.from_records(offset_records, begin=0.0)
    written = _read_all(road, length, source)
    directions = _directions(road, written, rule, source)
    sections = []
    ends = [*(section.start for section in written[1:]), length]
    for section, lanes, end in zip(written, _both_sides(written), ends, strict=True):
        start, marks = section.start, _until(section.centre_marks, end)
        records = [structs.replace(lane, marks=_until(lane.marks, end, start)) for lane in lanes]
        sections.append(
            build_section(records, start, end, lane_offset=lane_offset, directions=directions, centre_marks=marks)
        )
    _check_lanes(road, sections, source)
    return tuple(sections), directions


def _read_all(road: XmlElement, length: float, source: RoadFile) -> list[_Written]:
    by_start: dict[float, _Written] = {}
    layers = list(road.iterfind("lanes"))
    if (permanent := _permanent(layers)) != layers:
        source.note("temporary lanes are left out: scenarios name lanes of the permanent layer", road)
    sections = [e for lanes in permanent for e in lanes.iterfind("laneSection")]
    elements = sorted(sections, key=lambda e: source.number(e, "s"))
    for element in elements:
        start = source.number(element, "s")
        if start >= length and by_start:
            source.note(f"lane section at s={start:g} m, beyond the road's end at {length:g} m, left out", element)
            continue
        if start in by_start:
            source.note(f"second lane section at s={start:g} m replaces the first", element)
        by_start[start] = _read_section(element, start, source)
    if not by_start:
        source.note("road without lane sections: it has no lanes", road)
        return [_Written(0.0, (), (), ())]
    written = list(by_start.values())
    if written[0].start > 0.0:
        source.note(f"first lane section starts at s={written[0].start:g} m: taken to start at 0", elements[0])
    written[0] = structs.replace(written[0], start=0.0)
    return written


def _permanent(elements: Iterable[XmlElement]) -> list[XmlElement]:
    """Lanes, or links to lanes, of the permanent layer: what names no layer means it (OpenDRIVE 1.9, section 11.2)."""
    return [element for element in elements if element.get("layer", "permanent") == "permanent"]


def _read_section(element: XmlElement, start: float, source: RoadFile) -> _Written:
    single = element.get("singleSide", "false").lower() in ("true", "1")
    sides: dict[str, tuple[LaneRecord, ...] | None] = {}
    for side, sign in (("left", 1), ("right", -1)):
        group = element.find(side)
        if group is None and single:
            sides[side] = None
            continue
        lanes = [_read_lane(e, start, source) for e in (() if group is None else group.iterfind("lane"))]
        for lane in lanes:
            if lane.id * sign <= 0:
                raise source.error(f"lane {lane.id} on the {side} side", element)
        ids = [lane.id for lane in lanes]
        if len(set(ids)) != len(ids):
            raise source.error(f"lane ids on the {side} side are not unique: {ids}", element)
        sides[side] = tuple(lanes)
    centre = element.find("center/lane")
    marks = () if centre is None else _read_marks(centre, 0, start, source)
    return _Written(start, sides["left"], sides["right"], marks)


def _read_lane(element: XmlElement, start: float, source: RoadFile) -> LaneRecord:
    widths, borders = (
        tuple((start + source.number(e, "sOffset", 0.0), source.cubic(e)) for e in element.iterfind(tag))
        for tag in ("width", "border")
    )
    lane = source.integer(element, "id")
    if abs(lane) > MAXIMUM_LANE_ID:
        raise source.error(f"lane id {lane}; limit {MAXIMUM_LANE_ID}", element)
    if not widths and not borders:
        source.note(f"lane {lane} has neither width nor border: taken as 0 m wide", element)
    heights = sorted(
        (start + source.number(e, "sOffset", 0.0), source.number(e, "inner", 0.0), source.number(e, "outer", 0.0))
        for e in element.iterfind("height")
    )
    speeds = sorted(
        (start + source.number(e, "sOffset", 0.0), speed_limit(e, source)) for e in element.iterfind("speed")
    )
    predecessors, successors = (
        tuple(source.integer(e, "id") for e in _permanent(element.iterfind(f"link/{tag}")))
        for tag in ("predecessor", "successor")
    )
    return LaneRecord(
        id=lane,
        type=element.get("type", "none"),
        level=element.get("level", "false").lower() in ("true", "1"),
        widths=widths,
        borders=borders,
        heights=tuple(heights),
        speeds=tuple(speeds),
        marks=_read_marks(element, lane, start, source),
        predecessors=predecessors,
        successors=successors,
    )


def _read_marks(element: XmlElement, lane: int, start: float, source: RoadFile) -> tuple[RoadMark, ...]:
    """Markings; each ends where the next begins, the last one at infinity until the section's end is known."""
    marks = sorted((start + source.number(e, "sOffset", 0.0), i, e) for i, e in enumerate(element.iterfind("roadMark")))
    ends = [*(s for s, _, _ in marks[1:]), inf][: len(marks)]
    return tuple(
        RoadMark(lane, s, end, e.get("type", "none"), e.get("color", "standard"), source.appearance(e, "width", 0.12))
        for (s, _, e), end in zip(marks, ends, strict=True)
        if end > s
    )


def _until(marks: Sequence[RoadMark], end: float, start: float = -inf) -> tuple[RoadMark, ...]:
    """What lies before the end and, where it is given, behind the start."""
    inside = [mark for mark in marks if mark.s_start < end and min(mark.s_end, end) > start]
    return tuple(mark._replace(s_start=max(mark.s_start, start), s_end=min(mark.s_end, end)) for mark in inside)


def speed_limit(element: XmlElement | None, source: RoadFile) -> float:
    """``speed/@max`` in m/s; inf for ``no limit`` and ``undefined``, and without the element."""
    if element is None or element.get("max", "undefined") in ("no limit", "undefined"):
        return inf
    unit = element.get("unit", "m/s")
    if unit not in SPEED_UNITS:
        raise source.error(f"unit={unit!r} is none of {', '.join(SPEED_UNITS)}", element)
    return source.number(element, "max") * SPEED_UNITS[unit]


def _directions(road: XmlElement, written: Sequence[_Written], rule: str, source: RoadFile) -> dict[int, int]:
    """Right-hand traffic drives right lanes along s and left lanes against it; left-hand traffic vice versa."""
    along = -1 if rule == "RHT" else 1
    directions = {
        lane.id: along if lane.id > 0 else -along for w in written for lane in (*(w.left or ()), *(w.right or ()))
    }
    for element in (e for lanes in _permanent(road.iterfind("lanes")) for e in lanes.iterfind(_REVERSED)):
        lane = source.integer(element, "id")
        directions[lane] = -along if lane > 0 else along
        source.note(f"lane {lane} is driven against its side of the road, all along the road", element)
    return directions


def _both_sides(written: Sequence[_Written]) -> list[tuple[LaneRecord, ...]]:
    """Lanes of sections that hold both sides: a side that a section leaves out goes on as it was.

    The lane of a side that goes on is its own successor at the cut, and hands its real links to its last part.
    """
    parts: list[dict[str, tuple[LaneRecord, ...]]] = []
    for section in written:
        part = {}
        for side, lanes in (("left", section.left), ("right", section.right)):
            before = parts[-1][side] if parts else ()
            if lanes is None and parts:
                parts[-1][side] = tuple(structs.replace(lane, successors=(lane.id,)) for lane in before)
                lanes = tuple(structs.replace(lane, predecessors=(lane.id,)) for lane in before)
            part[side] = lanes or ()
        parts.append(part)
    return [(*part["left"], *part["right"]) for part in parts]


def _check_lanes(road: XmlElement, sections: Sequence[LaneSection], source: RoadFile) -> None:
    for section in sections:
        for lane in section.lanes:
            for s in (*lane.starts, section.end):
                centre, _, width = lane.state_at(s)
                if max(abs(centre), abs(width)) > MAXIMUM_LANE_WIDTH:
                    raise source.error(
                        f"lane {lane.id} at s={s:g} m: {width:g} m wide, {centre:g} m off the reference line; "
                        f"limit {MAXIMUM_LANE_WIDTH:g} m",
                        road,
                    )
            if not any(any(cubic) for cubic in lane.width):
                source.note(f"road '{road.get('id')}': lane {lane.id} is 0 m wide all along a section", road)
            elif min(lane.state_at(s).width for s in (*lane.starts, section.end)) < -1e-6:
                source.note(f"road '{road.get('id')}': lane {lane.id} has a negative width", road)
