"""ASAM OSI traces [1]_ into the standard drive table (extra `osi`).

Vehicles are placed between the boundaries of their lanes, as the trace has them or, with `road`, as an OpenDRIVE file
has them. The offset is that of the rear axle where the trace says where it is, else of the vehicle's middle.

References
----------
.. [1] ASAM OSI (Open Simulation Interface) 3.8: osi_groundtruth.proto, osi_lane.proto, osi_logicallane.proto.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.extras.recordings.cuts import DEFAULT_CUTS, MOVING_SPEED, CutSettings
from xosc_lateral.extras.recordings.importers import ImportedDrives, import_each, importer, paths_of
from xosc_lateral.extras.recordings.importers.tracks import (
    Strip,
    graph_of_shapes,
    import_placed,
    middle,
    place_in_shapes,
    place_on_road,
    require_lanes,
)
from xosc_lateral.extras.recordings.lane_order import LaneGraph
from xosc_lateral.extras.recordings.osi_trace import Recorded, read_osi
from xosc_lateral.files.opendrive.reader import parse_opendrive, read_opendrive
from xosc_lateral.files.osi import osi
from xosc_lateral.workflows.options import flag

LICENCE = "that of the trace"
HOST = "host"  # stands for the trace's own host vehicle


@importer
def import_osi(
    sources: Path | Sequence[Path],
    settings: CutSettings = DEFAULT_CUTS,
    *,
    host: Annotated[str | None, flag("--host", metavar="ID",
        help="Keep this vehicle alone: its id or name; host: the host vehicle.")] = None,
    road: Annotated[Path | str | None, flag("--road", kind=Path | None, metavar="FILE.xodr",
        help="Take lanes from here, not from the trace.")] = None,
    channel: Annotated[str | None, flag("--channel", metavar="TOPIC", help="Of an MCAP file.")] = None,
) -> ImportedDrives:  # fmt: skip
    """ASAM OSI traces of ground truth or sensor views (extra `osi`): vehicles between the boundaries of their lanes."""
    files = paths_of(sources)

    def read(path: Path, label: str) -> ImportedDrives:
        recorded = read_osi(path, channel)
        only = None if host is None else _named(recorded, host, path)
        if len(files) > 1:
            names = tuple(f"{label}:{name}" for name in recorded.tracks.names)
            recorded = replace(recorded, tracks=replace(recorded.tracks, names=names))
            only = None if only is None else {f"{label}:{name}" for name in only}
        network, where = None, "the road in it"
        if road is not None:
            network, where = read_opendrive(road), Path(road).name
        elif recorded.opendrive is not None:
            network = parse_opendrive(recorded.opendrive, path.stem)
        if network is not None:
            placed, graph = place_on_road(recorded.tracks, network)
        elif (lanes := lanes_of(recorded)) is not None:
            (strips, graph), where = lanes, "the trace"
            placed = place_in_shapes(recorded.tracks, strips, graph.left)
        else:
            raise FormatError("has no lanes with boundaries: give the road with --road FILE.xodr", path=path)
        require_lanes(placed, where, path)
        sources = [path] if road is None else [path, Path(road)]
        about = {"format": "osi", "sources": sources, "licence": LICENCE, "notes": recorded.notes}
        return import_placed(placed, graph, settings, only=only, **about)

    return import_each(files, read)


def _named(recorded: Recorded, host: str, path: Path) -> set[str]:
    wanted = host
    if host == HOST:
        if len(recorded.hosts) != 1:
            there = ", ".join(recorded.hosts) or "none"
            raise FormatError(f"host vehicles: {there}; name one with --host", path=path)
        wanted = recorded.hosts[0]
    wanted = {number: name for name, number in recorded.numbers.items()}.get(wanted, wanted)
    names = {name for name in recorded.tracks.names if name.split("#")[0] == wanted}  # NAME#2 after a leap
    if not names:
        raise FormatError(f"no vehicle {host!r}; there are {', '.join(recorded.tracks.names[:20])}", path=path)
    return names


SHOWING_ROWS = 20_000  # so many rows of a trace show which way its lanes are driven [-]


@dataclass(frozen=True)
class _Lane:
    """As a trace has it; pairs are of what is ahead or on the left along its lines, and of what is behind or right."""

    left: FloatArray
    right: FloatArray
    centre: FloatArray | None  # None: midway between the boundaries
    is_ahead: bool | None  # whether it is driven along its lines; None: the trace does not say
    beside: tuple[list[int], list[int]]
    onward: tuple[list[int], list[int]]

    def strip(self, *, is_ahead: bool = True) -> Strip:
        """With lines in the direction of travel."""
        lines = (self.left, self.right) if is_ahead else (self.right[::-1], self.left[::-1])
        centre = middle(*lines) if self.centre is None else self.centre if is_ahead else self.centre[::-1]
        return Strip(centre, *lines)


def lanes_of(recorded: Recorded) -> tuple[list[Strip], LaneGraph] | None:
    """Driving lanes with a boundary on both sides: logical ones where there are any, else physical ones, else None."""
    lanes = _logical(recorded) or _physical(recorded)
    if not lanes:
        return None
    shown = _driven_ahead({number: lane for number, lane in lanes.items() if lane.is_ahead is None}, recorded)
    ways = {number: 0 if shown.get(number, lane.is_ahead is not False) else 1 for number, lane in lanes.items()}
    strips = [lane.strip(is_ahead=ways[number] == 0) for number, lane in lanes.items()]
    numbers = {number: k for k, number in enumerate(lanes)}
    courses = [(strip.centre[-1] - strip.centre[0])[:2] for strip in strips]
    left = np.full(len(lanes), -1)
    for k, (number, lane) in enumerate(lanes.items()):
        for other in lane.beside[ways[number]]:
            if other in numbers and courses[k] @ courses[numbers[other]] > 0.0:
                left[k] = numbers[other]
    following = [[numbers[n] for n in lane.onward[ways[name]] if n in numbers] for name, lane in lanes.items()]
    return strips, graph_of_shapes(strips, left, following)


def _physical(recorded: Recorded) -> dict[int, _Lane]:
    kinds = osi("osi3.osi_lane_pb2").Lane.Classification
    things, edges = recorded.things["lane"], recorded.things["lane_boundary"]
    # writers of proto3 leave out what is false: a lane that says nothing is driven backwards; where none says anything,
    # vehicles show it
    known = any(lane.classification.HasField("centerline_is_driving_direction") for lane in things.values())
    lanes = {}
    for number, lane in things.items():
        about = lane.classification
        left, right = (_edge(edges, ids) for ids in (about.left_lane_boundary_id, about.right_lane_boundary_id))
        if about.type not in (kinds.TYPE_DRIVING, kinds.TYPE_INTERSECTION) or left is None or right is None:
            continue
        centre = np.array([(p.x, p.y, p.z) for p in about.centerline], dtype=np.float64).reshape(-1, 3)
        if len(centre) > 1:
            left, right = _aligned(left, centre), _aligned(right, centre)
        else:
            right = _aligned(right, left)
            centre = middle(left, right)
        is_ahead = about.centerline_is_driving_direction if known else None
        beside = [n.value for n in about.left_adjacent_lane_id], [n.value for n in about.right_adjacent_lane_id]
        following = list(dict.fromkeys(pair.successor_lane_id.value for pair in about.lane_pairing))
        before = list(dict.fromkeys(pair.antecessor_lane_id.value for pair in about.lane_pairing))
        lanes[number] = _Lane(left, right, centre, is_ahead, beside, (following, before))
    return lanes


def _logical(recorded: Recorded) -> dict[int, _Lane]:
    kinds, edges = osi("osi3.osi_logicallane_pb2").LogicalLane, recorded.things["logical_lane_boundary"]
    words = ("NORMAL", "EXIT", "ENTRY", "ONRAMP", "OFFRAMP", "CONNECTINGRAMP", "UNKNOWN")
    driven = {kinds.Type.Value(f"TYPE_{word}") for word in words}
    directions = {kinds.MOVE_DIRECTION_INCREASING_S: True, kinds.MOVE_DIRECTION_DECREASING_S: False}
    lanes = {}
    for number, lane in recorded.things["logical_lane"].items():
        sides = lane.left_boundary_id, lane.right_boundary_id
        left, right = (_edge(edges, ids, lane.start_s, lane.end_s) for ids in sides)
        if lane.type in driven and left is not None and right is not None:
            beside = _numbers(lane.left_adjacent_lane), _numbers(lane.right_adjacent_lane)
            onward = _numbers(lane.successor_lane), _numbers(lane.predecessor_lane)
            lanes[number] = _Lane(left, right, None, directions.get(lane.move_direction), beside, onward)
    return lanes


def _numbers(lanes: Any) -> list[int]:
    return [lane.other_lane_id.value for lane in lanes]


def _driven_ahead(lanes: Mapping[int, _Lane], recorded: Recorded) -> dict[int, bool]:
    """Whether lanes, by number, are driven along their lines: as their vehicles do, else as the nearest lane beside."""
    tracks, shown = recorded.tracks, dict[int, bool]()
    rows = np.arange(0, len(tracks.x), max(1, len(tracks.x) // SHOWING_ROWS))
    rows = rows[tracks.speed[rows] > MOVING_SPEED]
    for number, lane in lanes.items():
        strip = lane.strip()
        near = rows[strip.may_hold(tracks.x[rows], tracks.y[rows])]
        if len(near):
            way, aside, width, direction, _ = strip.place(tracks.x[near], tracks.y[near])
            inside = np.isfinite(way) & (np.abs(aside) <= 0.5 * width)
            agreement = float(np.cos(tracks.heading[near] - direction)[inside].sum())
            if agreement != 0.0:
                shown[number] = agreement > 0.0
    unseen = [number for number in lanes if number not in shown]
    if unseen:
        names = ", ".join(map(str, unseen))
        recorded.notes.append(f"lanes {names}: no direction, and no vehicle that shows it: taken as the lane beside")
    for _ in unseen:
        for number in [number for number in unseen if number not in shown]:
            ways = [shown[other] for side in lanes[number].beside for other in side if other in shown]
            if ways:
                shown[number] = ways[0]
    return shown


def _edge(edges: Mapping[int, Any], ids: Any, start: float = 0.0, end: float = 0.0) -> FloatArray | None:
    """The boundaries of these identifiers as one line, within start and end of s where they say s, put end to end, each
    as it fits to those before; None: no line. [m]"""
    lines = [_points(edges[i.value].boundary_line, start, end) for i in ids if i.value in edges]
    rest = [
        line for line in lines if len(line) > 1 and np.isfinite(line).all() and np.ptp(line[:, :2], axis=0).max() > 0.0
    ]
    if not rest:
        return None
    chain = rest.pop(0)
    while rest:
        tries = [
            (float(np.linalg.norm(end - start)), k, flipped, ahead)
            for k, line in enumerate(rest)
            for ahead, end in ((True, chain[-1]), (False, chain[0]))
            for flipped, start in ((False, line[0 if ahead else -1]), (True, line[-1 if ahead else 0]))
        ]
        _, k, flipped, ahead = min(tries)
        line = rest.pop(k)
        line = line[::-1] if flipped else line
        chain = np.concatenate([chain, line] if ahead else [line, chain])
    return chain


def _points(points: Any, start: float, end: float) -> FloatArray:
    """Of a boundary, shape (n, 3); within start and end of s, where the boundary says s. [m]"""
    line = np.array([(p.position.x, p.position.y, p.position.z) for p in points], dtype=np.float64).reshape(-1, 3)
    if end <= start or len(line) < 2:
        return line
    s = np.array([p.s_position for p in points])
    if s[-1] < s[0]:
        line, s = line[::-1], s[::-1]
    if not np.any(np.diff(s) > 0.0) or (start <= s[0] and s[-1] <= end):
        return line
    at = np.concatenate([[max(start, s[0])], s[(s > start) & (s < end)], [min(end, s[-1])]])
    return np.stack([np.interp(at, s, line[:, axis]) for axis in (0, 1, 2)], axis=1) if at[-1] > at[0] else line[:0]


def _aligned(line: FloatArray, along: FloatArray) -> FloatArray:
    return line if (line[-1] - line[0])[:2] @ (along[-1] - along[0])[:2] >= 0.0 else line[::-1]
