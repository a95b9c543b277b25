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

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.vehicle_classes import ON_ROADS, TRUCKS, class_named
from xosc_lateral.drivers.drives.identity import identify
from xosc_lateral.extras.recordings import sumo
from xosc_lateral.extras.recordings.cuts import KEPT_ROWS, is_right_to_left
from xosc_lateral.extras.recordings.importers import ImportedDrives, imported, importer
from xosc_lateral.extras.recordings.importers.track_table import Tracks, tracks_of_rows
from xosc_lateral.extras.recordings.lane_order import LaneGraph
from xosc_lateral.extras.recordings.neighbours import neighbour_columns
from xosc_lateral.extras.recordings.roads_from_lanes import DrivenLane
from xosc_lateral.workflows.options import flag

LICENCE = "that of the simulation"
ROW_COLUMNS = ("time", "name", "lane", "pos", "side", "speed", "kind", "x", "y", "angle")
NET_ENDINGS = (".net.xml", ".net.xml.gz")
REAR_FROM_FRONT = 0.8  # rear axle behind the front bumper, as a share of the length: 3.7 m of a car of 4.6 m [-]


@importer
def import_fcd(
    source: Path, *,
    net: Annotated[str | Path | None, flag(kind=Path | None,
        help="Road network (.net.xml): lanes, side of the road, who is on the next edge.")] = None,
    types: Annotated[str | Path | None, flag(kind=Path | None,
        help="File with the vehicle types (.rou.xml): lengths.")] = None,
    lane_width: Annotated[float, flag(help="Without a network. [m]", min=1, max=10)] = sumo.LANE_WIDTH,
) -> ImportedDrives:  # fmt: skip
    """SUMO's FCD output of a run with the sublane model: a drive for every vehicle.

    It is a truck when its type's name or class says so.
    """
    vehicles = sumo.fcd_vehicles(source, "a vehicle outside a timestep")
    known = None if net is None else sumo.read_sumo_net(Path(net))
    vehicle_types = sumo.read_vehicle_types(None if types is None else Path(types))
    rows = pd.DataFrame(_rows(vehicles, source), columns=list(ROW_COLUMNS))
    rows["is_inner"] = rows["lane"].astype(str).str.startswith(":")
    every, rows = len(rows), rows[~rows["is_inner"]] if known is None else rows
    if rows.empty:
        raise NotEnoughDataError(f"{source}: no vehicle")
    codes, labels = rows["name"].factorize(sort=True)
    time, x, y = (rows[name].to_numpy() for name in ("time", "x", "y"))
    seen = identify(list(map(str, labels)), codes, time, x, y, path=source)
    dropped = {"junction": every - len(rows), **seen.dropped}
    rows = rows.iloc[seen.rows].assign(name=np.array(seen.names, dtype=object)[seen.vehicle]).reset_index(drop=True)
    lanes = _net_of(rows, lane_width) if known is None else known
    strange = rows["lane"][~rows["lane"].isin(list(lanes.lanes))]
    if len(strange):
        raise FormatError(f"lane {strange.iloc[0]!r} is not in {net}", path=source)
    left_hand = _left_hand(rows, lanes, None if known is None else known.left_hand, source)
    table = _drive_table(rows, lanes, vehicle_types, left_hand, source)
    turned = "left-hand traffic: lanes and sides are counted from the left kerb, and turned"
    notes = [*seen.notes, *([turned] if left_hand else [])]
    if known is None:
        notes.append("without --net: lanes without a width, and nobody is seen on another edge")
    sources = [source, *(Path(file) for file in (net, types) if file is not None)]
    settings = {"lane_width": lane_width if net is None else None}
    about = {"format": "fcd", "licence": LICENCE, "settings": settings, "notes": notes, "dropped": dropped}
    step = float(np.median(np.diff(np.unique(table["time"])))) if table["time"].nunique() > 1 else 0.0
    return imported(table, sources=sources, step=step, **about)


def _rows(vehicles: Iterator[tuple[float, Any]], source: Path) -> Iterator[tuple[Any, ...]]:
    for time, element in vehicles:
        if element.get("posLat") is None:
            what = "no posLat: it is written with the sublane model and --fcd-output.attributes all"
            raise sumo.wrong_element(what, element, source)
        if element.get("lane") is None or element.get("id") is None:
            raise sumo.wrong_element("no id or lane", element, source)
        place = (sumo.number_of(element, name, source) for name in ("pos", "posLat", "speed"))
        seen = (float(element.get(name, "nan")) for name in ("x", "y", "angle"))
        yield time, element.get("id"), element.get("lane"), *place, element.get("type", ""), *seen


def _drive_table(
    rows: pd.DataFrame, net: sumo.SumoNet, types: dict[str, tuple[float, str]], left_hand: bool, source: Path
) -> pd.DataFrame:
    vehicle, names = rows["name"].factorize()
    time, side, speed = (rows[name].to_numpy() for name in ("time", "side", "speed"))
    kinds = [types.get(kind.partition("@")[0], (sumo.usual_length(kind), kind)) for kind in rows["kind"]]
    length = np.array([size for size, _ in kinds])
    is_truck = np.array([class_named(kind) in TRUCKS for _, kind in kinds])
    # lanes of an edge lie side by side, counted from the right here
    numbers, following = _driving_lanes(net)
    edges: dict[str, list[int]] = {}
    for name in sorted(numbers, key=lambda name: net.lanes[name].index, reverse=left_hand):
        edges.setdefault(net.lanes[name].edge, []).append(numbers[name])
    left, index, count = (np.full(len(numbers), value) for value in (-1, 0, 1))
    for lanes in edges.values():
        index[lanes], count[lanes], left[lanes] = np.arange(len(lanes)), len(lanes), [*lanes[1:], -1]
    graph = LaneGraph(np.array([net.lanes[name].length for name in numbers]), left, following)
    piece = np.array([numbers.get(name, -1) for name in rows["lane"]])
    passed = np.diff(time)[np.diff(vehicle) == 0]
    step = float(np.median(passed)) if len(passed) else 1.0
    middle = rows["pos"].to_numpy() - 0.5 * length
    near = neighbour_columns(graph, piece, middle, time, vehicle, step, speed, length, is_truck)
    return pd.DataFrame({
        "drive": np.asarray(names, dtype=object)[vehicle], "time": time,
        "offset": (-side if left_hand else side) + 0.0, "speed": speed,
        "lane_width": [net.lanes[name].width for name in rows["lane"]],
        "lane_index": index[piece], "lane_count": count[piece], "is_truck": is_truck.astype(np.float64), **near,
        "state": np.where(rows["is_inner"], "junction", np.where(piece < 0, "no lane", KEPT_ROWS)),
    })  # fmt: skip


def _driving_lanes(net: sumo.SumoNet) -> tuple[dict[str, int], list[list[int]]]:
    """Numbers of the lanes that vehicles drive on, and those that each leads to."""
    numbers = {name: k for k, name in enumerate(name for name, lane in net.lanes.items() if lane.is_driving)}
    return numbers, [[numbers[other] for other in net.following.get(name, ()) if other in numbers] for name in numbers]


def _net_of(rows: pd.DataFrame, width: float) -> sumo.SumoNet:
    """What the output alone says of the lanes: those in which somebody was, and all on their right."""
    last, end = dict[str, int](), dict[str, float]()
    for name, place in zip(rows["lane"], rows["pos"], strict=True):
        edge, _, index = name.rpartition("_")
        last[edge], end[edge] = max(last.get(edge, 0), int(index)), max(end.get(edge, 0.0), place)
    lanes = [sumo.SumoLane(edge, k, width, end[edge], True) for edge, top in last.items() for k in range(top + 1)]
    return sumo.SumoNet(lanes={f"{lane.edge}_{lane.index}": lane for lane in lanes})


def _left_hand(rows: pd.DataFrame, net: sumo.SumoNet, stated: bool | None, source: Path) -> bool:
    """Whether sides are counted from the left kerb: as the network says, which positions must not contradict."""
    lanes = [net.lanes[name] for name in rows["lane"]]
    across = np.array([lane.index * lane.width for lane in lanes]) + rows["side"].to_numpy()
    x, y, angle = (rows[name].to_numpy() for name in ("x", "y", "angle"))
    edge = pd.factorize(np.array([lane.edge for lane in lanes]))[0]
    seen = is_right_to_left(x, y, np.radians(90.0 - angle), across, edge)
    if stated is not None and seen is not None and seen is stated:
        hands = ("right", "left") if stated else ("left", "right")
        what = f"positions are of {hands[0]}-hand traffic, the network is of {hands[1]}-hand traffic: is it this run's?"
        raise FormatError(what, path=source)
    return bool(stated) if stated is not None else seen is False


# ---- for `reconstruct`: the lanes of a network as lines, and where vehicles' rear axles were -------------------------
def lanes_of_net(net: sumo.SumoNet, path: Path) -> list[DrivenLane]:
    """Lanes that vehicles drive on, those inside junctions included. Raises `FormatError`: a lane without a shape."""
    numbers, following = _driving_lanes(net)
    if not numbers:
        raise FormatError("no lane for vehicles", path=path)
    lanes = list[DrivenLane]()
    for name, onward in zip(numbers, following, strict=True):
        lane = net.lanes[name]
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
        half = 0.5 * lane.width * normal
        on_left = f"{lane.edge}_{lane.index + (-1 if net.left_hand else 1)}"  # lanes count from the kerb
        lanes.append(DrivenLane(points + half, points - half, numbers.get(on_left, -1), onward))
    return lanes


def read_fcd(path: Path) -> Tracks:
    """Tracks of the rear axles, which pass where the front did: SUMO turns vehicles about their front."""
    rows, names, types = list[tuple[float, ...]](), dict[str, int](), list[str]()
    for time, element in sumo.fcd_vehicles(path, outside := "a vehicle without id, or outside a timestep"):
        if (name := element.get("id")) is None:
            raise sumo.wrong_element(outside, element, path)
        if name not in names:
            names[name] = len(names)
            types.append(element.get("type", "").lower())
        rows.append((names[name], time, *(sumo.number_of(element, key, path) for key in ("x", "y", "angle", "speed"))))
    if not rows:
        raise NotEnoughDataError(f"{path}: no vehicle")
    number, time, x, y, angle, speed = np.array(rows).T
    vehicle = number.astype(np.int64)
    kind = np.array([name if (name := class_named(word)) in ON_ROADS else "" for word in types])[vehicle]
    length = np.array([sumo.usual_length(name) for name in types])[vehicle]
    tracks, _ = tracks_of_rows(
        list(names), vehicle,
        {"time": time, "x": x, "y": y, "heading": 0.5 * np.pi - np.radians(angle), "speed": speed, "kind": kind,
         "length": length, "rear": (REAR_FROM_FRONT - 0.5) * length},
        path,
    )  # fmt: skip
    x, y, heading = tracks.x, tracks.y, tracks.heading
    for part in np.split(np.arange(len(x)), np.flatnonzero(np.diff(tracks.vehicle)) + 1):
        first, behind = part[0], REAR_FROM_FRONT * tracks.length[part[0]]
        start = [x[first] - behind * np.cos(heading[first]), y[first] - behind * np.sin(heading[first])]
        front = np.vstack([start, np.stack([x[part], y[part]], axis=1)])
        way = np.r_[0.0, np.cumsum(np.hypot(*np.diff(front, axis=0).T))]
        x[part], y[part] = (np.interp(way[1:] - behind, way, front[:, axis]) for axis in (0, 1))
    return replace(tracks, time=tracks.time - float(tracks.time.min()))
