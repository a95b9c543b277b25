"""A road network as OSI's lanes: centre lines in the direction of travel, their boundaries, how they hang together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.files.osi import osi
from xosc_lateral.world.road.geometry import simplify
from xosc_lateral.world.road.lanes import DRIVING, Lane, LaneSection, beside
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.road.positions import RoadMark

POINT_SPACING = 1.0  # between two points of a line before it is simplified [m]
LINE_TOLERANCE = 2.5e-4  # points that change a line by less are left out [m]
BEFORE_END = 1e-6  # the last point of a section lies this much before its end, where the next one begins [m]
Piece = tuple[int, int, int]  # road, lane section, lane

SUBTYPES: Mapping[str, str] = {
    **dict.fromkeys(("driving", "bidirectional", "HOV", "bus", "taxi"), "NORMAL"),
    **dict.fromkeys(("entry", "mwyEntry"), "ENTRY"),
    **dict.fromkeys(("exit", "mwyExit"), "EXIT"),
    **{"onRamp": "ONRAMP", "offRamp": "OFFRAMP", "connectingRamp": "CONNECTINGRAMP", "slipLane": "CONNECTINGRAMP"},
    **{"biking": "BIKING", "sidewalk": "SIDEWALK", "walking": "SIDEWALK", "parking": "PARKING", "stop": "STOP"},
    **{"restricted": "RESTRICTED", "border": "BORDER", "shoulder": "SHOULDER"},
}
"""Lane type of OpenDRIVE -> `Lane.Classification.Subtype`; OTHER for the rest."""

LINES: Mapping[str, str] = {
    **dict.fromkeys(("solid", "solid solid", "solid broken", "broken solid"), "SOLID_LINE"),
    **dict.fromkeys(("broken", "broken broken"), "DASHED_LINE"),
    **{"none": "NO_LINE", "botts dots": "BOTTS_DOTS", "curb": "CURB", "grass": "GRASS_EDGE", "edge": "ROAD_EDGE"},
}
"""Road mark of OpenDRIVE -> `LaneBoundary.Classification.Type`; OTHER for the rest."""

COLOURS: Mapping[str, str] = {"standard": "WHITE"} | {
    name: name.upper() for name in ("white", "yellow", "red", "blue", "green", "violet", "orange")
}
"""Colour of OpenDRIVE -> `LaneBoundary.Classification.Color`; OTHER for the rest."""


@dataclass
class RoadIds:
    """Identifiers, unique in a trace: those of moving objects first, then lanes, then boundaries."""

    network: RoadNetwork
    first: int  # the lowest that is free
    lanes: dict[Piece, int] = field(init=False)
    free: int = field(init=False)

    def __post_init__(self) -> None:
        pieces = [
            (road, k, lane.id)
            for road, part in enumerate(self.network.roads)
            for k, section in enumerate(part.sections)
            if section.end - section.start > 10 * BEFORE_END
            for lane in section.lanes
            if lane.type != "none"
        ]
        self.lanes = {piece: self.first + number for number, piece in enumerate(pieces)}
        self.free = self.first + len(pieces)

    def at(self, road: int, lane: int, s: float) -> int | None:
        """Lane of a place; None: there is none."""
        return None if road < 0 else self.lanes.get((road, self.network.roads[road].section_number(s), lane))


def write_lanes(message: Any, ids: RoadIds) -> None:
    """Add every lane and boundary of the network to a `GroundTruth`."""
    network = ids.network
    kinds = osi("osi3.osi_lane_pb2")
    boundaries = {
        (road, k): _boundaries(message, kinds, ids, road, section)
        for road, part in enumerate(network.roads)
        for k, section in enumerate(part.sections)
        if any((road, k, lane.id) in ids.lanes for lane in section.lanes)
    }
    for (road, k, name), number in ids.lanes.items():
        section = network.roads[road].sections[k]
        lane = section.by_id[name]
        forward = lane.direction > 0
        written = message.lane.add()
        written.id.value = number
        reference = written.source_reference.add(type="net.asam.opendrive")
        reference.identifier.extend([network.road_ids[road], f"{section.start:g}", str(name)])
        about = written.classification
        drives = lane.type in DRIVING
        about.type = kinds.Lane.Classification.TYPE_DRIVING if drives else kinds.Lane.Classification.TYPE_NONDRIVING
        about.subtype = kinds.Lane.Classification.Subtype.Value(f"SUBTYPE_{SUBTYPES.get(lane.type, 'OTHER')}")
        about.centerline_is_driving_direction = True
        line = _line(network, road, name, _grid(section), 0.0)
        for x, y, z in (line if forward else line[::-1]).tolist():
            about.centerline.add(x=x, y=y, z=z)
        for step, adjacent in ((1, about.left_adjacent_lane_id), (-1, about.right_adjacent_lane_id)):
            other = road, k, beside(name, step if forward else -step)
            if other in ids.lanes:
                adjacent.add().value = ids.lanes[other]
        inner = name - 1 if name > 0 else name + 1
        edges = boundaries[road, k][inner], boundaries[road, k][name]
        left_edges, right_edges = edges if (name < 0) == forward else edges[::-1]
        for edge in left_edges:
            about.left_lane_boundary_id.add().value = edge
        for edge in right_edges:
            about.right_lane_boundary_id.add().value = edge
        # one entry per way through: OSI pairs where a lane comes from with where it leads; 0 is nobody's
        before, after = ([*_next(ids, (road, k, name), lane, side)] for side in (-lane.direction, lane.direction))
        for antecessor, successor in product(before or [0], after or [0]):
            if antecessor or successor:
                pair = about.lane_pairing.add()
                if antecessor:
                    pair.antecessor_lane_id.value = antecessor
                if successor:
                    pair.successor_lane_id.value = successor


def _next(ids: RoadIds, piece: Piece, lane: Lane, side: int) -> Iterator[int]:
    """Lanes that touch this one's end (side +1) or start (-1), by their identifiers."""
    road, k, name = piece
    sections = ids.network.roads[road].sections
    if 0 <= k + side < len(sections):
        linked = lane.successors if side > 0 else lane.predecessors
        touching = [(road, k + side, other) for other in linked]
    else:
        links = ids.network.next_lanes(road, name, side)
        touching = [
            (x.road, 0 if x.direction > 0 else len(ids.network.roads[x.road].sections) - 1, x.lane) for x in links
        ]
    yield from (ids.lanes[piece_there] for piece_there in touching if piece_there in ids.lanes)


def _grid(section: LaneSection) -> FloatArray:
    end = section.end - BEFORE_END
    return np.linspace(section.start, end, max(2, int(np.ceil((end - section.start) / POINT_SPACING)) + 1))


def _line(network: RoadNetwork, road: int, lane: int, s: FloatArray, across: float) -> FloatArray:
    """World points of a lane's centre (0) or outer edge (1), simplified, shape (n, 3). [m]"""
    outwards = 0.5 * across * np.sign(lane) * network.travel_direction(road, lane)
    offset = outwards * network.lane_width(road, lane, s) if lane else 0.0
    poses = network.lane_to_world(road, lane, s, offset)
    x, y, z, _ = network.header_offset.apply(poses.x, poses.y, poses.z, poses.heading)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    kept = np.union1d(simplify(x, y, LINE_TOLERANCE), simplify(way, z, LINE_TOLERANCE))
    return np.stack([x, y, z], axis=1)[kept]


def _boundaries(message: Any, kinds: Any, ids: RoadIds, road: int, section: LaneSection) -> dict[int, list[int]]:
    """Write the outer edges of all lanes, lane 0 included; lane -> identifiers, one per stretch of one marking."""
    edges: dict[int, list[int]] = {}
    for lane in (*section.lanes, section.centre):
        edges[lane.id] = []
        grid = _grid(section)
        for start, end, mark in _stretches(lane, section):
            s = np.concatenate([[start], grid[(grid > start) & (grid < end)], [end]])
            written = message.lane_boundary.add()
            written.id.value = ids.free
            width = 0.0 if mark is None else mark.width
            for x, y, z in _line(ids.network, road, lane.id, s, 1.0).tolist():
                point = written.boundary_line.add(width=width, height=0.0)
                point.position.x, point.position.y, point.position.z = x, y, z
            about = written.classification
            line = "NO_LINE" if mark is None else LINES.get(mark.type, "OTHER")
            about.type = kinds.LaneBoundary.Classification.Type.Value(f"TYPE_{line}")
            colour = "NONE" if line == "NO_LINE" or mark is None else COLOURS.get(mark.color, "OTHER")
            about.color = kinds.LaneBoundary.Classification.Color.Value(f"COLOR_{colour}")
            edges[lane.id].append(ids.free)
            ids.free += 1
    return edges


def _stretches(lane: Lane, section: LaneSection) -> Iterator[tuple[float, float, RoadMark | None]]:
    """A section's edge cut where its marking changes; None: no marking."""
    low, high = section.start, section.end - BEFORE_END
    marks = [(max(mark.s_start, low), min(mark.s_end, high), mark) for mark in lane.marks]
    marks = sorted(
        (stretch for stretch in marks if stretch[1] - stretch[0] > 10 * BEFORE_END), key=lambda stretch: stretch[:2]
    )
    at = low
    for start, end, mark in marks:
        if start - at > 10 * BEFORE_END:
            yield at, start, None
        if end > at:
            yield max(start, at), end, mark
            at = end
    if high - at > 10 * BEFORE_END:
        yield at, high, None
