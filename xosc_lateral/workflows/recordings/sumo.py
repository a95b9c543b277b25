"""SUMO's FCD output as tracks, and the lanes of its networks as lines.

References
----------
.. [1] Eclipse SUMO, FCD output and road networks: x and y are the middle of the front bumper, angles count clockwise
       from north; lanes count from the side of the kerb.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.files.source import open_source
from xosc_lateral.files.tables import unpacked_text
from xosc_lateral.workflows.recordings.importers.track_table import Tracks
from xosc_lateral.workflows.recordings.roads_from_lanes import DrivenLane

LANE_WIDTH = 3.2
"""Of lanes whose width a network does not give. [m]"""
NET_ENDINGS = (".net.xml", ".net.xml.gz")
WALKED = frozenset(("crossing", "walkingarea"))
"""Functions of edges that no vehicle drives on."""
NO_VEHICLES = frozenset(("pedestrian", "bicycle"))
"""A lane that allows these alone is none for vehicles."""
LENGTHS = {"": 5.0, "truck": 7.1}
"""Of SUMO's passenger cars and trucks; FCD output has none. [m]"""
REAR_FROM_FRONT = 0.8
"""Rear axle behind the front bumper, as a share of the length: 3.7 m of a car of 4.6 m. [-]"""
TRUCK_WORDS = ("truck", "trailer", "bus", "coach", "lkw")
"""A vehicle whose type's name has one of these is a truck."""


def first_tag(path: Path) -> str:
    """Name of the root element; empty: not XML."""
    try:
        return next((element.tag for element in elements(path, ())), "")
    except FormatError:
        return ""


def elements(path: Path, tags: tuple[str, ...]) -> Iterator[etree._Element]:
    """Elements of these names (none: all) as they begin, one at a time, of a file that may be packed with gzip.

    Raises `FormatError`: not XML.
    """
    try:
        with open_source(path) as source:
            how: dict[str, Any] = {"resolve_entities": False, "no_network": True, "load_dtd": False}
            text = unpacked_text(source)
            for event, element in etree.iterparse(text, events=("start", "end"), tag=tags or None, **how):
                if event == "start":
                    yield element
                elif (parent := element.getparent()) is not None and len(parent) > 1:
                    del parent[0]  # what is over takes no memory
    except etree.XMLSyntaxError as error:
        raise FormatError(f"not XML: {error.msg}", path=path, line=error.lineno) from error


def read_net(path: Path) -> tuple[list[DrivenLane], bool]:
    """Lanes of a network that vehicles drive on, those inside junctions included, and whether it is left-handed.

    Raises `FormatError`: no network, a lane without a shape.
    """
    lines: dict[tuple[str, int], tuple[FloatArray, FloatArray]] = {}
    following: dict[tuple[str, int], list[tuple[str, int]]] = {}
    left_handed, edge, is_driven = False, "", False
    for element in elements(path, ("net", "edge", "lane", "connection")):
        if element.tag == "net":
            left_handed = element.get("lefthand") == "true"
        elif element.tag == "edge":
            edge, is_driven = element.get("id", ""), element.get("function", "") not in WALKED
        elif element.tag == "lane" and is_driven and not _is_walked(element):
            lines[edge, int(_number(element, "index", path))] = _sides(element, path)
        elif element.tag == "connection":
            start, end = (element.get("from", ""), "fromLane"), (element.get("to", ""), "toLane")
            one, other = ((name, int(_number(element, lane, path))) for name, lane in (start, end))
            if via := element.get("via"):  # by a lane inside the junction
                inner, _, index = via.rpartition("_")
                other = (inner, int(index))
            following.setdefault(one, []).append(other)
    if not lines:
        raise FormatError("no lane for vehicles: not a network of SUMO", path=path)
    numbers = {name: number for number, name in enumerate(lines)}
    to_left = -1 if left_handed else 1  # lanes count from the kerb
    lanes = [
        DrivenLane(
            *sides,
            numbers.get((edge, index + to_left), -1),
            [numbers[name] for name in following.get((edge, index), ()) if name in numbers],
        )
        for (edge, index), sides in lines.items()
    ]
    return lanes, left_handed


def _is_walked(lane: etree._Element) -> bool:
    allowed = set(lane.get("allow", "").split())
    return bool(allowed) and allowed <= NO_VEHICLES


def _sides(lane: etree._Element, path: Path) -> tuple[FloatArray, FloatArray]:
    """Left and right line of a lane, whose shape is its middle."""
    try:
        points = np.array([point.split(",")[:2] for point in lane.get("shape", "").split()], dtype=np.float64)
    except ValueError:
        points = np.empty(0)
    moved = np.hypot(*np.diff(points, axis=0).T) if points.ndim == 2 else np.empty(0)
    if not (moved > 0.0).any() or not np.isfinite(points).all():
        raise _wrong(f"shape={lane.get('shape', '')[:40]!r} is no line", lane, path)
    points = points[np.r_[True, moved > 0.0]]
    pieces = np.diff(points, axis=0)
    normals = np.stack([-pieces[:, 1], pieces[:, 0]], axis=1) / np.hypot(*pieces.T)[:, None]
    normal = np.concatenate([normals[:1], normals[:-1] + normals[1:], normals[-1:]])
    normal[1:-1] /= 1.0 + (normals[:-1] * normals[1:]).sum(axis=1, keepdims=True)  # as far from both pieces
    half = 0.5 * (LANE_WIDTH if lane.get("width") is None else _number(lane, "width", path))
    return points + half * normal, points - half * normal


def read_fcd(path: Path) -> Tracks:
    """Tracks of the rear axles, which pass where the front did: SUMO turns vehicles about their front.

    Raises `FormatError`: no such file; `NotEnoughDataError`: no vehicle in it.
    """
    rows, names, kinds = list[tuple[float, ...]](), dict[str, int](), list[str]()
    time = np.nan
    for element in elements(path, ("timestep", "vehicle")):
        if element.tag == "timestep":
            time = _number(element, "time", path)
            continue
        name = element.get("id")
        if name is None or not np.isfinite(time):
            raise _wrong("a vehicle without id, or outside a timestep", element, path)
        if name not in names:
            names[name] = len(names)
            is_truck = any(word in element.get("type", "").lower() for word in TRUCK_WORDS)
            kinds.append("truck" if is_truck else "")
        rows.append((names[name], time, *(_number(element, what, path) for what in ("x", "y", "angle", "speed"))))
    if not rows:
        raise NotEnoughDataError(f"{path}: no vehicle")
    values = np.array(rows)
    values = values[np.lexsort((values[:, 1], values[:, 0]))]
    vehicle, (time_of_row, x, y, angle, speed) = values[:, 0].astype(np.int64), values[:, 1:].T
    same = vehicle[1:] == vehicle[:-1]
    if not same.any():
        raise NotEnoughDataError(f"{path}: no vehicle has two rows")
    kind = np.array(kinds)[vehicle]
    length = np.array([LENGTHS[one] for one in kinds])[vehicle]
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


def _number(element: etree._Element, name: str, path: Path) -> float:
    text = element.get(name, "")
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise _wrong(f"{name}={text!r} is no number", element, path)
    return value


def _wrong(what: str, element: etree._Element, path: Path) -> FormatError:
    line: Any = element.sourceline  # a number or None; its stubs say otherwise
    return FormatError(what, path=path, line=line, element=str(element.tag))
