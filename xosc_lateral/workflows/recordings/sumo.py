"""SUMO's FCD output as tracks, and the lanes of its networks as lines.

References
----------
.. [1] Eclipse SUMO, FCD output and road networks: x and y are the middle of the front bumper, angles count clockwise
       from north; lanes count from the side of the kerb.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.files.sumo import (
    TRUCKS,
    SumoLane,
    SumoNet,
    elements,
    number_of,
    require_fcd,
    usual_length,
    wrong_element,
)
from xosc_lateral.workflows.recordings.importers.track_table import Tracks
from xosc_lateral.workflows.recordings.roads_from_lanes import DrivenLane

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
    """Tracks of the rear axles, which pass where the front did: SUMO turns vehicles about their front.

    Raises `FormatError`: no such file; `NotEnoughDataError`: no vehicle in it.
    """
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
