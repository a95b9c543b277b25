"""A played scenario as plain values for the player of a page: vehicles over time, roads around them, packed small."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from xosc_lateral.arrays import FloatArray
from xosc_lateral.enrich.result import EntityResult
from xosc_lateral.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.motion.trajectory import WorldTrajectory
from xosc_lateral.report.path_dynamics import lateral_dynamics
from xosc_lateral.road import RoadNetwork
from xosc_lateral.road.geometry import simplify
from xosc_lateral.road.network import DRIVING
from xosc_lateral.road.positions import RoadMark
from xosc_lateral.rows import true_slices

RowArray = NDArray[np.int64]

FRAME = 0.1
"""Between two frames; the player interpolates, which is off by 6 mm at 5 m/s2. [s]"""

MOST_FRAMES = 60_000
"""Frames of all entities together beyond which they are spaced farther apart: what a browser takes at once."""


def scene_of(motion: NominalMotion, network: RoadNetwork, results: Sequence[EntityResult] = ()) -> str:
    """JSON for the player: results with the nominal motion as ghosts, or the nominal motion alone."""
    given: list[tuple[EntityMotion, EntityResult | None]] = [(one.motion, one) for one in results]
    given = given or [(one, None) for one in motion.entities]
    shown = [(number, entity, result) for number, (entity, result) in enumerate(given) if _present(entity).any()]
    rows = _rows(motion, len(shown))
    origin = _origin([entity for _, entity, _ in shown])
    places = [np.column_stack([e.x[_present(e)], e.y[_present(e)]]) for _, e, _ in shown]
    step = (rows[1] - rows[0]) * motion.step if len(rows) > 1 else FRAME
    scene = {
        "step": round(float(step), 9),
        "frames": len(rows),
        "end": motion.end_time,
        "entities": [_entity(network, number, each, result, rows, origin) for number, each, result in shown],
        **road_shapes(network, np.concatenate(places) if places else np.empty((0, 2)), origin),
    }
    # "<" would end the script element that holds this
    return json.dumps(scene, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c")


def _rows(motion: NominalMotion, entities: int) -> RowArray:
    count = len(motion.entities[0].time) if motion.entities else 0
    frames = max(1, count * motion.step / FRAME * entities)
    every = max(1, round(FRAME / motion.step)) * int(np.ceil(frames / MOST_FRAMES))
    return np.arange(0, count, every)


def _present(motion: EntityMotion) -> NDArray[np.bool_]:
    return np.asarray((motion.activity & Activity.ACTIVE) != 0)


def _origin(entities: Sequence[EntityMotion]) -> FloatArray:
    """Whole metres near the first place: coordinates stay small on roads with geographic ones."""
    if not entities:
        return np.zeros(2)
    first = entities[0]
    row = int(np.argmax(_present(first)))
    return np.round(np.array([first.x[row], first.y[row]]))


def _entity(
    network: RoadNetwork,
    number: int,
    motion: EntityMotion,
    result: EntityResult | None,
    rows: RowArray,
    origin: FloatArray,
) -> dict[str, Any]:
    box = motion.entity.bounding_box
    values: dict[str, Any] = {
        "name": motion.name,
        "number": number,
        "length": box.length,
        "width": box.width,
        "ahead": box.center_x,
        "left": box.center_y,
        "vehicle": motion.entity.is_vehicle,
        "present": [[part.start, part.stop - 1] for part in true_slices(_present(motion)[rows])],
        "jumps": _jumps(motion, rows),
        "lanes": _lane_changes(network, motion, rows),
        "course": pack(np.unwrap(_filled(_course(motion)[rows])), MILLIRADIAN_TENTH),
        "nominal": _path(motion, rows, origin, motion),
        "offset": pack(_filled(motion.offset[rows]), MILLIMETRE),
    }
    if result is not None and result.is_enriched:
        values["enriched"] = _path(result.trajectory, rows, origin, motion)
        values["added"] = pack(_filled(result.deviation[rows]), MILLIMETRE)
    return values


def _course(motion: EntityMotion) -> FloatArray:
    """Direction of the lane where the entity is, the way that it drives; its own heading off the roads. [rad]"""
    turned = np.arctan(np.tan(motion.heading_relative))  # against s, half a turn is no deviation
    return np.asarray(motion.heading - np.where(motion.road >= 0, turned, 0.0))


def _path(
    path: EntityMotion | WorldTrajectory, rows: RowArray, origin: FloatArray, motion: EntityMotion
) -> dict[str, Any]:
    dynamics = lateral_dynamics(motion, path)
    across = np.interp(path.time[rows], dynamics.time, np.nan_to_num(dynamics.acceleration))
    return {
        "x": pack(_filled(path.x[rows] - origin[0]), MILLIMETRE),
        "y": pack(_filled(path.y[rows] - origin[1]), MILLIMETRE),
        "h": pack(np.unwrap(_filled(path.heading[rows])), MILLIRADIAN_TENTH),
        "v": pack(_filled(path.speed[rows]), CENTIMETRE_PER_SECOND),
        "a": pack(across, MILLIMETRE),
    }


def _filled(values: FloatArray) -> FloatArray:
    """Numbers instead of NaN, where an entity is absent: nobody sees them there."""
    return np.nan_to_num(np.asarray(values, dtype=np.float64))


def _jumps(motion: EntityMotion, rows: RowArray) -> list[int]:
    """Frames that are not reached by moving from the one before."""
    placed = np.cumsum((motion.activity & Activity.TELEPORTED) != 0)[rows]
    return [k + 1 for k, (one, other) in enumerate(pairwise(placed.tolist())) if other > one]


def _lane_changes(network: RoadNetwork, motion: EntityMotion, rows: RowArray) -> list[tuple[int, str, int]]:
    """Frame, road id and lane id wherever one of them is new; no road: off the road."""
    road, lane = motion.road[rows], motion.lane[rows]
    is_new = np.append(True, (np.diff(road) != 0) | (np.diff(lane) != 0))[: len(rows)]
    return [(int(k), network.road_ids[road[k]] if road[k] >= 0 else "", int(lane[k])) for k in np.flatnonzero(is_new)]


# ---- roads ----
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


REACH = 250.0
"""Roads are shown as far as this around every place where a vehicle was. [m]"""

PIECE = 200.0
"""Length of one piece of a lane or marking: pieces out of sight are not drawn. [m]"""

LINE_STEP = 2.0
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
    return np.linspace(start, max(start, stop - 1e-6), max(2, int(np.ceil((stop - start) / LINE_STEP)) + 1))


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


def _line(
    network: RoadNetwork, road: int, s: FloatArray, t: FloatArray, origin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    poses = network.road_to_world(road, s, t)
    x, y = np.asarray(poses.x) - origin[0], np.asarray(poses.y) - origin[1]
    kept = simplify(x, y, TOLERANCE)
    return x[kept], y[kept]
