"""Lanes of a trace as shapes, from either of OSI's two encodings, and how they hang together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.files.osi import osi
from xosc_lateral.workflows.recordings.gate import MOVING_SPEED
from xosc_lateral.workflows.recordings.lane_graph import LaneGraph
from xosc_lateral.workflows.recordings.lane_shapes import Strip, lane_graph, middle
from xosc_lateral.workflows.recordings.osi.read import Recorded

SHOWING_ROWS = 20_000  # so many rows of a trace show which way its lanes are driven [-]


@dataclass(frozen=True)
class _Lane:
    """Identifier, lines in the direction of travel, lanes on the left, and those that follow."""

    number: int
    centre: FloatArray
    left: FloatArray
    right: FloatArray
    beside: tuple[int, ...]
    following: tuple[int, ...]


def lanes_of(recorded: Recorded) -> tuple[list[Strip], LaneGraph] | None:
    """Driving lanes with a boundary on both sides: logical ones where there are any, else physical ones, else None."""
    lanes = list(_logical(recorded)) or list(_physical(recorded))
    if not lanes:
        return None
    strips = [Strip(lane.centre, lane.left, lane.right) for lane in lanes]
    numbers = {lane.number: k for k, lane in enumerate(lanes)}
    left = np.full(len(lanes), -1)
    for k, lane in enumerate(lanes):
        for other in lane.beside:
            if other in numbers and _way(strips[k]) @ _way(strips[numbers[other]]) > 0.0:
                left[k] = numbers[other]
    following = [[numbers[one] for one in lane.following if one in numbers] for lane in lanes]
    return strips, lane_graph(strips, left, following)


def _way(strip: Strip) -> FloatArray:
    return np.asarray((strip.centre[-1] - strip.centre[0])[:2])


def _physical(recorded: Recorded) -> Iterable[_Lane]:
    kinds = osi("osi3.osi_lane_pb2").Lane.Classification
    lanes, edges = recorded.things["lane"], recorded.things["lane_boundary"]
    # writers of proto3 leave out what is false: a lane that says nothing is driven backwards; where none says anything,
    # vehicles show it
    known = any(lane.classification.HasField("centerline_is_driving_direction") for lane in lanes.values())
    found = []
    for number, lane in lanes.items():
        about = lane.classification
        if about.type not in (kinds.TYPE_DRIVING, kinds.TYPE_INTERSECTION):
            continue
        left, right = (
            _chained([_points(edges[i.value].boundary_line) for i in ids if i.value in edges])
            for ids in (about.left_lane_boundary_id, about.right_lane_boundary_id)
        )
        if left is None or right is None:
            continue
        centre = np.array([(p.x, p.y, p.z) for p in about.centerline], dtype=np.float64).reshape(-1, 3)
        if len(centre) > 1:
            left, right = _aligned(left, centre), _aligned(right, centre)
        else:
            right = _aligned(right, left)
            centre = middle(left, right)
        found.append((number, about, centre, left, right))
    beside = {number: [*about.left_adjacent_lane_id, *about.right_adjacent_lane_id] for number, about, *_ in found}
    shown = {} if known else _driven_ahead({lane[0]: lane[2:] for lane in found}, beside, recorded)
    for number, about, centre, left, right in found:
        ahead = about.centerline_is_driving_direction if known else shown.get(number, True)
        pairs = [(pair.antecessor_lane_id.value, pair.successor_lane_id.value) for pair in about.lane_pairing]
        on_left = about.left_adjacent_lane_id if ahead else about.right_adjacent_lane_id
        following = tuple(dict.fromkeys(pair[1 if ahead else 0] for pair in pairs))
        lines = (centre, left, right) if ahead else (centre[::-1], right[::-1], left[::-1])
        yield _Lane(number, *lines, tuple(other.value for other in on_left), following)


def _driven_ahead(
    lines: Mapping[int, Sequence[FloatArray]], beside: Mapping[int, Sequence[Any]], recorded: Recorded
) -> dict[int, bool]:
    """Whether lanes, by number, are driven along their lines: as their vehicles do, else as the nearest lane beside."""
    tracks, found = recorded.tracks, dict[int, bool]()
    rows = np.arange(0, len(tracks.x), max(1, len(tracks.x) // SHOWING_ROWS))
    rows = rows[tracks.speed[rows] > MOVING_SPEED]
    for number, (centre, left, right) in lines.items():
        strip = Strip(centre, left, right)
        near = rows[strip.may_hold(tracks.x[rows], tracks.y[rows])]
        if len(near):
            way, aside, width, direction, _ = strip.place(tracks.x[near], tracks.y[near])
            inside = np.isfinite(way) & (np.abs(aside) <= 0.5 * width)
            agreement = float(np.cos(tracks.heading[near] - direction)[inside].sum())
            if agreement != 0.0:
                found[number] = agreement > 0.0
    unseen = [number for number in lines if number not in found]
    if unseen:
        said = ", ".join(map(str, unseen))
        recorded.notes.append(f"lanes {said}: no direction, and no vehicle that shows it: taken as the lane beside")
    for _ in unseen:
        for number in [number for number in unseen if number not in found]:
            ways = [found[other.value] for other in beside[number] if other.value in found]
            if ways:
                found[number] = ways[0]
    return found


def _logical(recorded: Recorded) -> Iterable[_Lane]:
    kinds = osi("osi3.osi_logicallane_pb2").LogicalLane
    driven = {
        kinds.Type.Value(f"TYPE_{name}")
        for name in ("NORMAL", "EXIT", "ENTRY", "ONRAMP", "OFFRAMP", "CONNECTINGRAMP", "UNKNOWN")
    }
    lanes, edges = recorded.things["logical_lane"], recorded.things["logical_lane_boundary"]
    found = []
    for number, lane in lanes.items():
        if lane.type not in driven:
            continue
        left, right = (
            _chained([_points(edges[i.value].boundary_line, lane.start_s, lane.end_s) for i in ids if i.value in edges])
            for ids in (lane.left_boundary_id, lane.right_boundary_id)
        )
        if left is not None and right is not None:
            found.append((number, lane, left, right))
    directed = (kinds.MOVE_DIRECTION_INCREASING_S, kinds.MOVE_DIRECTION_DECREASING_S)
    open_lanes = [entry for entry in found if entry[1].move_direction not in directed]
    sides = {
        number: [other.other_lane_id for other in (*lane.left_adjacent_lane, *lane.right_adjacent_lane)]
        for number, lane, _, _ in open_lanes
    }
    shown = _driven_ahead({n: (middle(left, right), left, right) for n, _, left, right in open_lanes}, sides, recorded)
    for number, lane, left, right in found:
        ahead = shown.get(number, lane.move_direction != kinds.MOVE_DIRECTION_DECREASING_S)
        beside = lane.left_adjacent_lane if ahead else lane.right_adjacent_lane
        onward = lane.successor_lane if ahead else lane.predecessor_lane
        if not ahead:
            left, right = right[::-1], left[::-1]
        yield _Lane(
            number,
            middle(left, right),
            left,
            right,
            tuple(one.other_lane_id.value for one in beside),
            tuple(one.other_lane_id.value for one in onward),
        )


def _points(points: Any, start: float = 0.0, end: float = 0.0) -> FloatArray:
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


def _chained(lines: Sequence[FloatArray]) -> FloatArray | None:
    """Stretches put end to end, each as it fits to the one before; None: no line."""
    lines = [
        line for line in lines if len(line) > 1 and np.isfinite(line).all() and np.ptp(line[:, :2], axis=0).max() > 0.0
    ]
    if not lines:
        return None
    chain, rest = lines[0], list(lines[1:])
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


def _aligned(line: FloatArray, along: FloatArray) -> FloatArray:
    """The line in the direction of another one."""
    return line if (line[-1] - line[0])[:2] @ (along[-1] - along[0])[:2] >= 0.0 else line[::-1]
