"""SUMO's FCD output ("floating car data"): where every vehicle of a run with the sublane model was.

Lanes are SUMO's, so is `posLat`, the place in them; in left-hand networks SUMO counts both from the left kerb, and they
are turned here. Widths and counts of lanes, and how edges hang together, come from the net, where it is given; else
lanes are 3.2 m wide, as SUMO has them, and nobody is seen on another edge.

References
----------
.. [1] Eclipse SUMO, FCD output and road networks: x and y are the middle of the front bumper, angles count clockwise
       from north; lanes count from the side of the kerb.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.files.columns import require_row_step
from xosc_lateral.files.sumo import (
    TRUCKS,
    WIDTH,
    SumoLane,
    SumoNet,
    elements,
    number_of,
    read_sumo_net,
    read_vehicle_types,
    require_fcd,
    usual_length,
    wrong_element,
)
from xosc_lateral.workflows.recordings.cuts import KEPT_ROWS
from xosc_lateral.workflows.recordings.gate import is_right_to_left
from xosc_lateral.workflows.recordings.importers.table import Imported, finished, guarded
from xosc_lateral.workflows.recordings.importers.track_table import Tracks
from xosc_lateral.workflows.recordings.lane_graph import LaneGraph, neighbour_columns
from xosc_lateral.workflows.recordings.roads_from_lanes import DrivenLane

LICENCE = "that of the simulation"


class _Row(NamedTuple):
    time: float
    name: str
    lane: str
    pos: float
    side: float
    speed: float
    kind: str
    x: float
    y: float
    angle: float


@guarded
def import_fcd(
    source: Path, *, net: str | Path | None = None, types: str | Path | None = None, lane_width: float = WIDTH
) -> Imported:
    """A drive for every vehicle of what ``--fcd-output`` wrote; it is a truck when its type's name or class says so.

    `net`: the road network, ``.net.xml``, for widths and counts of lanes, and for who is on the next edge. `types`:
    file with the vehicle types, for lengths. `lane_width`: without a network. [m]
    """
    require_fcd(source)
    known = None if net is None else read_sumo_net(Path(net))
    vehicle_types = read_vehicle_types(None if types is None else Path(types))
    rows = [row for row in _rows(source) if known is not None or not row.lane.startswith(":")]
    if not rows:
        raise NotEnoughDataError(f"{source}: no vehicle")
    rows.sort(key=lambda row: (row.name, row.time))
    used = _net_of(rows, lane_width) if known is None else known
    if strange := next((row.lane for row in rows if row.lane not in used.lanes), None):
        raise FormatError(f"lane {strange!r} is not in {net}", path=source)
    lane = [used.lanes[row.lane] for row in rows]
    left_hand = _left_hand(rows, lane, None if known is None else known.left_hand, source)
    table = _table(rows, lane, used, vehicle_types, left_hand, source)
    notes = ["left-hand traffic: lanes and sides are counted from the left kerb, and turned"] if left_hand else []
    if known is None:
        notes.append("without --net: lanes without a width, and nobody is seen on another edge")
    sources = [source, *(Path(one) for one in (net, types) if one is not None)]
    settings = {"lane_width": lane_width if net is None else None}
    about = {"format": "fcd", "licence": LICENCE, "settings": settings, "notes": notes}
    step = float(np.median(np.diff(np.unique(table["time"])))) if table["time"].nunique() > 1 else 0.0
    return finished(table, keep_cut=False, sources=sources, step=step, **about)


def _table(
    rows: Sequence[_Row],
    lane: Sequence[SumoLane],
    net: SumoNet,
    types: Mapping[str, tuple[float, str]],
    left_hand: bool,
    source: Path,
) -> pd.DataFrame:
    """The drive table with its column `state`."""
    vehicle, names = pd.factorize(np.array([row.name for row in rows], dtype=object))
    time, pos, side, speed = (np.array([row[k] for row in rows]) for k in (0, 3, 4, 5))
    kinds = [types.get(row.kind.partition("@")[0], (usual_length(row.kind), row.kind)) for row in rows]
    length = np.array([size for size, _ in kinds])
    is_truck = np.array([any(word in kind.lower() for word in TRUCKS) for _, kind in kinds])
    numbers, graph, index, count = _graph(net, left_hand)
    piece = np.array([numbers.get(row.lane, -1) for row in rows])
    passed = np.diff(time)[np.diff(vehicle) == 0]
    step = float(np.median(passed)) if len(passed) else 1.0
    require_row_step(step, source)
    near = neighbour_columns(graph, piece, pos - 0.5 * length, time, vehicle, step, speed, length, is_truck)
    is_inner = [row.lane.startswith(":") for row in rows]
    return pd.DataFrame({
        "drive": names[vehicle], "time": time, "offset": (-side if left_hand else side) + 0.0, "speed": speed,
        "lane_width": [one.width for one in lane], "lane_index": index[piece], "lane_count": count[piece],
        "is_truck": is_truck.astype(np.float64), **near,
        "state": np.where(is_inner, "junction", np.where(piece < 0, "no lane", KEPT_ROWS)),
    })  # fmt: skip


def _graph(net: SumoNet, left_hand: bool) -> tuple[dict[str, int], LaneGraph, np.ndarray, np.ndarray]:
    """Numbers of the driving lanes, how they hang together, and of each its index from the right and their count."""
    names = [name for name, lane in net.lanes.items() if lane.is_driving]
    numbers = {name: k for k, name in enumerate(names)}
    edges: dict[str, list[str]] = {}
    for name in sorted(names, key=lambda name: net.lanes[name].index, reverse=left_hand):
        edges.setdefault(net.lanes[name].edge, []).append(name)
    left, index, count = (np.full(len(names), value) for value in (-1, 0, 1))
    for own in edges.values():
        for k, name in enumerate(own):
            index[numbers[name]], count[numbers[name]] = k, len(own)
            left[numbers[name]] = numbers[own[k + 1]] if k + 1 < len(own) else -1
    following = [[numbers[one] for one in net.following.get(name, []) if one in numbers] for name in names]
    length = np.array([net.lanes[name].length for name in names])
    return numbers, LaneGraph(length, left, following), index, count


def _net_of(rows: Sequence[_Row], width: float) -> SumoNet:
    """What the output alone says of the lanes: those in which somebody was, and all on their right."""
    net, top, end = SumoNet(), dict[str, int](), dict[str, float]()
    for row in rows:
        edge, _, index = row.lane.rpartition("_")
        top[edge], end[edge] = max(top.get(edge, 0), int(index)), max(end.get(edge, 0.0), row.pos)
    for edge, last in top.items():
        net.lanes |= {f"{edge}_{k}": SumoLane(edge, k, width, end[edge], True) for k in range(last + 1)}
    return net


def _left_hand(rows: Sequence[_Row], lane: Sequence[SumoLane], said: bool | None, source: Path) -> bool:
    """Whether sides are counted from the left kerb: as the network says, which positions must not contradict."""
    across = np.array([one.index * one.width + row.side for one, row in zip(lane, rows, strict=True)])
    x, y, angle = (np.array([row[k] for row in rows]) for k in (7, 8, 9))
    seen = is_right_to_left(x, y, np.radians(90.0 - angle), across, pd.factorize(np.array([e.edge for e in lane]))[0])
    if said is not None and seen is not None and seen is said:
        hands = ("right", "left") if said else ("left", "right")
        what = f"positions are of {hands[0]}-hand traffic, the network is of {hands[1]}-hand traffic: is it this run's?"
        raise FormatError(what, path=source)
    return bool(said) if said is not None else seen is False


def _rows(source: Path) -> Iterator[_Row]:
    time, found = float("nan"), False
    for event, element in elements(source, ("timestep", "vehicle")):
        if element.tag == "timestep":
            if event == "start":
                time, found = number_of(element, "time", source), True
            else:
                element.clear()
        elif event == "start":
            if not found:
                raise wrong_element("a vehicle outside a timestep", element, source)
            if element.get("posLat") is None:
                what = "no posLat: it is written with the sublane model and --fcd-output.attributes all"
                raise wrong_element(what, element, source)
            if element.get("lane") is None or element.get("id") is None:
                raise wrong_element("no id or lane", element, source)
            numbers = (number_of(element, name, source) for name in ("pos", "posLat", "speed"))
            seen = (float(element.get(name, "nan")) for name in ("x", "y", "angle"))
            name, lane = str(element.get("id")), str(element.get("lane"))
            pos, side, speed = numbers
            yield _Row(time, name, lane, pos, side, speed, element.get("type", ""), *seen)


NET_ENDINGS = (".net.xml", ".net.xml.gz")
REAR_FROM_FRONT = 0.8  # rear axle behind the front bumper, as a share of the length: 3.7 m of a car of 4.6 m [-]


def lanes_of_net(net: SumoNet, path: Path) -> list[DrivenLane]:
    """Lanes that vehicles drive on, those inside junctions included. Raises `FormatError`: a lane without a shape."""
    names = [name for name, lane in net.lanes.items() if lane.is_driving]
    if not names:
        raise FormatError("no lane for vehicles", path=path)
    numbers = {name: number for number, name in enumerate(names)}
    to_left = -1 if net.left_hand else 1  # lanes count from the kerb
    lanes = list[DrivenLane]()
    for name in names:
        lane = net.lanes[name]
        beside = numbers.get(f"{lane.edge}_{lane.index + to_left}", -1)
        following = [numbers[one] for one in net.following.get(name, ()) if one in numbers]
        lanes.append(DrivenLane(*_sides(name, lane, path), beside, following))
    return lanes


def _sides(name: str, lane: SumoLane, path: Path) -> tuple[FloatArray, FloatArray]:
    """Left and right line of a lane, whose shape is its middle."""
    try:
        points = np.array([point.split(",")[:2] for point in lane.shape.split()], dtype=np.float64)
    except ValueError:
        points = np.empty(0)
    moved = np.hypot(*np.diff(points, axis=0).T) if points.ndim == 2 else np.empty(0)
    if not (moved > 0.0).any() or not np.isfinite(points).all():
        raise FormatError(f"shape={lane.shape[:40]!r} is no line", path=path, element=f"lane {name!r}")
    points = points[np.r_[True, moved > 0.0]]
    pieces = np.diff(points, axis=0)
    normals = np.stack([-pieces[:, 1], pieces[:, 0]], axis=1) / np.hypot(*pieces.T)[:, None]
    normal = np.concatenate([normals[:1], normals[:-1] + normals[1:], normals[-1:]])
    normal[1:-1] /= 1.0 + (normals[:-1] * normals[1:]).sum(axis=1, keepdims=True)  # as far from both pieces
    half = 0.5 * lane.width
    return points + half * normal, points - half * normal


def read_fcd(path: Path) -> Tracks:
    """Tracks of the rear axles, which pass where the front did: SUMO turns vehicles about their front."""
    require_fcd(path)
    rows, names, types = list[tuple[float, ...]](), dict[str, int](), list[str]()
    time = np.nan
    for event, element in elements(path, ("timestep", "vehicle")):
        if event == "end":
            if element.tag == "timestep":
                element.clear()
        elif element.tag == "timestep":
            time = number_of(element, "time", path)
        else:
            name = element.get("id")
            if name is None or not np.isfinite(time):
                raise wrong_element("a vehicle without id, or outside a timestep", element, path)
            if name not in names:
                names[name] = len(names)
                types.append(element.get("type", "").lower())
            rows.append((names[name], time, *(number_of(element, key, path) for key in ("x", "y", "angle", "speed"))))
    if not rows:
        raise NotEnoughDataError(f"{path}: no vehicle")
    values = np.array(rows)
    values = values[np.lexsort((values[:, 1], values[:, 0]))]
    vehicle, (time_of_row, x, y, angle, speed) = values[:, 0].astype(np.int64), values[:, 1:].T
    same = vehicle[1:] == vehicle[:-1]
    if not same.any():
        raise NotEnoughDataError(f"{path}: no vehicle has two rows")
    kind = np.array(["truck" if any(word in one for word in TRUCKS) else "" for one in types])[vehicle]
    length = np.array([usual_length(one) for one in types])[vehicle]
    heading = 0.5 * np.pi - np.radians(angle)
    for mine in np.split(np.arange(len(x)), np.flatnonzero(~same) + 1):
        first, behind = mine[0], REAR_FROM_FRONT * length[mine[0]]
        start = [x[first] - behind * np.cos(heading[first]), y[first] - behind * np.sin(heading[first])]
        front = np.vstack([start, np.stack([x[mine], y[mine]], axis=1)])
        way = np.r_[0.0, np.cumsum(np.hypot(*np.diff(front, axis=0).T))]
        x[mine], y[mine] = (np.interp(way[1:] - behind, way, front[:, axis]) for axis in (0, 1))
    when = time_of_row - float(time_of_row.min()), float(np.median(np.diff(time_of_row)[same]))
    rear = (REAR_FROM_FRONT - 0.5) * length
    return Tracks(tuple(names), vehicle, *when, x, y, heading, speed, length, kind, rear=rear)
