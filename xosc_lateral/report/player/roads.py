"""Lanes and markings around the vehicles, as polygons and lines in the world."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from xosc_lateral.road import RoadNetwork
from xosc_lateral.road.geometry import simplify
from xosc_lateral.road.network import DRIVING
from xosc_lateral.road.positions import RoadMark

MILLIMETRE = CENTIMETRE_PER_SECOND = 1e-3
"""Resolution of positions [m]; of speeds a hundred times finer than anybody reads them. [m/s]"""

MILLIRADIAN_TENTH = 1e-4
"""Resolution of headings: 0.5 mm at the end of a car of 5 m. [rad]"""


def pack(values: ArrayLike, resolution: float) -> dict[str, Any]:
    """Pack one column: rounded, stored as differences, a fraction of the size of decimal text.

    ``{"r": resolution, "b": first, "w": 2 or 4, "d": base64}``: `d` holds the differences between successive values in
    units of the resolution, as little-endian integers of `w` bytes. ``static/player.js`` unpacks it.

    Parameters
    ----------
    values : array, shape (n,)
        Finite.
    resolution : float
        Values come back as whole multiples of it. [unit of the values]
    """
    whole = np.rint(np.asarray(values, dtype=np.float64) / resolution).astype(np.int64)
    if not len(whole):
        return {"r": resolution, "b": 0, "w": 2, "d": ""}
    steps = np.diff(whole)
    is_small = not len(steps) or np.abs(steps).max() <= np.iinfo(np.int16).max
    data = steps.astype("<i2" if is_small else "<i4").tobytes()
    return {
        "r": resolution,
        "b": int(whole[0]),
        "w": 2 if is_small else 4,
        "d": base64.b64encode(data).decode("ascii"),
    }


def unpack(column: dict[str, Any]) -> NDArray[np.float64]:
    """The values of a packed column, shape (n,): what the page's script does."""
    steps = np.frombuffer(base64.b64decode(column["d"]), dtype=f"<i{column['w']}").astype(np.int64)
    return np.asarray(np.concatenate(([0], np.cumsum(steps))) + column["b"]) * float(column["r"])


FloatArray = NDArray[np.float64]

REACH = 250.0
"""Roads are shown as far as this around every place where a vehicle was. [m]"""

PIECE = 200.0
"""Length of one piece of a lane or marking: pieces out of sight are not drawn. [m]"""

STEP = 2.0
"""Between two points of a line before it is simplified. [m]"""

TOLERANCE = 0.01
"""Lines are simplified to this: less than a tenth of a marking's width. [m]"""

RESOLUTION = 0.005
"""Of the coordinates of lines. [m]"""

NO_MARK = frozenset({"none", "curb", "grass", "edge"})
"""Road marks that are no paint."""


def road_shapes(network: RoadNetwork, places: FloatArray, origin: FloatArray) -> dict[str, list[dict[str, Any]]]:
    """Lanes and markings near the given places.

    Parameters
    ----------
    network : RoadNetwork
    places : array, shape (n, 2)
        Where vehicles were. [m]
    origin : array, shape (2,)
        Subtracted from all coordinates. [m]

    Returns
    -------
    dict
        ``lanes``: polygons with the lane's `type`; ``marks``: lines with `type`, `color`, `width` [m] and `start`
        (s, so that dashes go on from piece to piece). [m]
    """
    lanes, marks = [], []
    near = _cells(places, reach=REACH)
    for road in range(len(network.roads)):
        for first, last in _ranges_near(network, road, near):
            lanes += [shape for shape in _lanes(network, road, first, last, origin) if shape]
            marks += list(_marks(network, road, first, last, origin))
    return {"lanes": lanes, "marks": marks}


def _cells(places: FloatArray, reach: float) -> set[tuple[int, int]]:
    """Squares of the size of the reach that lie within it of any place."""
    whole = {(int(i), int(k)) for i, k in np.unique(np.floor(places / reach), axis=0)} if len(places) else set()
    return {(i + a, k + b) for i, k in whole for a in (-1, 0, 1) for b in (-1, 0, 1)}


def _ranges_near(network: RoadNetwork, road: int, near: set[tuple[int, int]]) -> Iterator[tuple[float, float]]:
    """Parts of a road, as (first, last) s, that lie in those squares, at most `PIECE` long each."""
    length = network.roads[road].length
    count = max(1, int(np.ceil(length / PIECE)))
    edges = np.linspace(0.0, length, count + 1)
    for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        poses = network.road_to_world(road, np.linspace(first, last, 5))
        cells = np.floor(np.column_stack([poses.x, poses.y]) / REACH)
        if last > first and any((int(i), int(k)) in near for i, k in cells):
            yield first, last


def _sections(network: RoadNetwork, road: int, first: float, last: float) -> Iterator[tuple[float, float]]:
    """The lane sections within a range."""
    start = first
    while start < last:
        section_start, section_end = network.section_at(road, start)
        if section_end <= start:  # a section of no length: OpenDRIVE forbids it, field files have it
            return
        yield max(section_start, start), min(section_end, last)
        start = section_end


def _grid(start: float, stop: float) -> FloatArray:
    """From start to just before stop, where the next section begins."""
    return np.linspace(start, max(start, stop - 1e-6), max(2, int(np.ceil((stop - start) / STEP)) + 1))


def _lanes(
    network: RoadNetwork, road: int, first: float, last: float, origin: FloatArray
) -> Iterator[dict[str, Any] | None]:
    for start, stop in _sections(network, road, first, last):
        s = _grid(start, stop)
        for lane in network.lanes_at(road, 0.5 * (start + stop)):
            if lane.type == "none":
                continue
            centre, width = network.lane_centre_t(road, lane.id, s), network.lane_width(road, lane.id, s)
            if width.max() < TOLERANCE:
                continue
            left = _line(network, road, s, centre + 0.5 * width, origin)
            right = _line(network, road, s, centre - 0.5 * width, origin)
            x, y = (np.concatenate([one, other[::-1]]) for one, other in zip(left, right, strict=True))
            kind = "driving" if lane.type in DRIVING else lane.type
            yield {"type": kind, "x": pack(x, RESOLUTION), "y": pack(y, RESOLUTION)}


def _marks(network: RoadNetwork, road: int, first: float, last: float, origin: FloatArray) -> Iterator[dict[str, Any]]:
    for mark, start, s, t in _mark_lines(network, road, first, last):
        x, y = _line(network, road, s, t, origin)
        yield {
            "type": mark.type,
            "color": mark.color,
            "width": mark.width,
            "start": round(start, 2),
            "x": pack(x, RESOLUTION),
            "y": pack(y, RESOLUTION),
        }


def _mark_lines(
    network: RoadNetwork, road: int, first: float, last: float
) -> Iterator[tuple[RoadMark, float, FloatArray, FloatArray]]:
    """Paint between two s: the mark, where it starts, and t over s."""
    for mark in network.road_marks(road):
        start, stop = max(first, mark.s_start), min(last, mark.s_end)
        if stop <= start or mark.type in NO_MARK:
            continue
        s = _grid(start, stop)
        outer = 0.5 * np.sign(mark.lane) * network.lane_width(road, mark.lane, s) if mark.lane else 0.0
        yield mark, start, s, network.lane_centre_t(road, mark.lane, s) + outer


def mark_points(network: RoadNetwork, places: FloatArray) -> Iterator[FloatArray]:
    """Lines of paint near the given places, shape (n, 2), as points in the world, shape (m, 3) each. [m]"""
    near = _cells(places, reach=REACH)
    for road in range(len(network.roads)):
        for first, last in _ranges_near(network, road, near):
            for _, _, s, t in _mark_lines(network, road, first, last):
                poses = network.road_to_world(road, s, t)
                kept = simplify(np.asarray(poses.x), np.asarray(poses.y), TOLERANCE)
                yield np.column_stack([poses.x, poses.y, poses.z])[kept]


def _line(
    network: RoadNetwork, road: int, s: FloatArray, t: FloatArray, origin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    poses = network.road_to_world(road, s, t)
    x, y = np.asarray(poses.x) - origin[0], np.asarray(poses.y) - origin[1]
    kept = simplify(x, y, TOLERANCE)
    return x[kept], y[kept]
