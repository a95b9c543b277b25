"""A played scenario as plain values for the player of a page: vehicles over time, roads around them, packed small."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from xosc_lateral.base.arrays import FloatArray, true_slices
from xosc_lateral.base.track import Track
from xosc_lateral.workflows.conversion.result import EntityResult
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, MovingTraffic
from xosc_lateral.world.road.geometry import simplify
from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.road.positions import RoadMark

RowArray = NDArray[np.int64]

FRAME_STEP = 0.1
"""Between two frames; the player interpolates, which is off by 6 mm at 5 m/s2. [s]"""

MOST_FRAMES = 60_000
"""Frames of all entities together beyond which they are spaced farther apart: what a browser takes at once."""

POSITION_RESOLUTION, HEADING_RESOLUTION, LINE_RESOLUTION = 1e-3, 1e-4, 5e-3
"""Resolution of positions [m] and speeds [m/s]; of headings, 0.5 mm at the end of a car of 5 m [rad]; of lines [m]."""

ROAD_REACH = 250.0
"""Roads are shown as far as this around every place where a vehicle was. [m]"""

ROAD_WIDTH = 7.0
"""Shown where there is no road. [m]"""

WIDTH_SAMPLES = 20
"""At which it is looked how wide the road is. [-]"""

PIECE_LENGTH = 200.0
"""Length of one piece of a lane or marking: pieces out of sight are not drawn. [m]"""

LINE_TOLERANCE = 0.01
"""Lines are simplified to this: less than a tenth of a marking's width. [m]"""


class Remade(NamedTuple):
    """A vehicle as it was written, and as the output that was made of it plays."""

    motion: EntityMotion
    trajectory: Track
    deviation: FloatArray  # positive left, shape (n,) [m]
    is_enriched: bool


def remade(written: MovingTraffic, made: MovingTraffic, moved: Collection[str]) -> list[Remade]:
    """Vehicles of both runs for as long as both last; `moved`: who has lateral movement."""
    outputs = {entity.name: entity for entity in made.entities}
    both = [(entity, outputs[entity.name]) for entity in written.entities if entity.name in outputs]
    results = []
    for source, output in both:
        rows = slice(0, min(len(source), len(output)))
        before, after = source.at(rows), output.at(rows)
        left = np.cos(before.heading) * (after.y - before.y) - np.sin(before.heading) * (after.x - before.x)
        results.append(Remade(before, after, left, before.name in moved))
    return results


def scene_of(
    motion: MovingTraffic,
    network: RoadNetwork,
    results: Sequence[EntityResult | Remade] = (),
    *,
    names: Sequence[str] = (),
    views: tuple[str, str] = ("As written", "Lifelike"),
) -> str:
    """JSON for the player: results with the nominal motion as ghosts, or the nominal motion alone.

    `names`: of all vehicles in the order that decides on their colours; without: the motion's own. `views`: titles of
    the nominal motion and of that of the results, one below the other
    """
    pairs: list[tuple[EntityMotion, EntityResult | Remade | None]] = [(result.motion, result) for result in results]
    pairs = pairs or [(entity, None) for entity in motion.entities]
    place = {name: number for number, name in enumerate(names)}
    shown = [
        (place.get(entity.name, number), entity, result)
        for number, (entity, result) in enumerate(pairs)
        if _present(entity).any()
    ]
    rows = _rows(motion.step, [entity for _, entity, _ in shown])
    places = [np.column_stack([entity.x, entity.y])[_present(entity)] for _, entity, _ in shown]
    # whole metres near the first place: coordinates stay small on roads with geographic ones
    origin = np.round(places[0][0]) if places else np.zeros(2)
    scene = {
        "step": round(float(rows[1] - rows[0]) * motion.step if len(rows) > 1 else FRAME_STEP, 9),
        "start": round(float(shown[0][1].time[0]), 3) if len(rows) else 0.0,
        "frames": len(rows),
        "views": views,
        "across": round(_across(network, shown), 2),
        "entities": [_entity(network, number, each, result, rows, origin) for number, each, result in shown],
        **_roads(network, np.concatenate(places) if places else np.empty((0, 2)), origin),
    }
    # "<" would end the script element that holds this
    return json.dumps(scene, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c")


def _across(network: RoadNetwork, shown: Sequence[tuple[int, EntityMotion, EntityResult | Remade | None]]) -> float:
    """How far the player looks to either side of the vehicle that it follows first: driving lanes, one beside its own.

    In m.
    """
    first = next((motion for _, motion, result in shown if result is None or result.is_enriched), None)
    if first is None:
        return ROAD_WIDTH
    there = np.flatnonzero(_present(first) & (first.road >= 0))
    reach = [ROAD_WIDTH / 2]
    for row in there[:: max(1, len(there) // WIDTH_SAMPLES)].tolist():
        road, s = int(first.road[row]), float(first.s[row])
        t = float(network.offset_to_t(road, int(first.lane[row]), s, float(first.offset[row])))
        lanes = [lane for lane in network.lanes_at(road, s) if lane.type in DRIVING]
        reach += [min(abs(lane.centre_t - t) + 0.5 * lane.width, 1.6 * lane.width) for lane in lanes]
    return max(reach)


def packed(values: ArrayLike, resolution: float) -> dict[str, Any]:
    """One column of finite values, small as text: the resolution `r`, and in units of it `d`, each less the one before.

    The first stands as it is. `static/player.js` adds them up again.
    """
    whole = np.rint(np.asarray(values, dtype=np.float64) / resolution).astype(np.int64)
    return {"r": resolution, "d": np.diff(whole, prepend=0).tolist()}


def _rows(step: float, motions: Sequence[EntityMotion]) -> RowArray:
    count = len(motions[0]) if motions else 0
    frames = max(1, count * step / FRAME_STEP * len(motions))
    every = max(1, round(FRAME_STEP / step)) * int(np.ceil(frames / MOST_FRAMES))
    return np.arange(0, count, every)


# ---- vehicles --------------------------------------------------------------------------------------------------------
def _present(motion: EntityMotion) -> NDArray[np.bool_]:
    return np.asarray((motion.activity & Activity.ACTIVE) != 0)


def _entity(
    network: RoadNetwork,
    number: int,
    motion: EntityMotion,
    result: EntityResult | Remade | None,
    rows: RowArray,
    origin: FloatArray,
) -> dict[str, Any]:
    box, shown = motion.box, motion.at(rows)
    values: dict[str, Any] = {
        "name": motion.name,
        "number": number,
        "length": box.length,
        "width": box.width,
        "ahead": box.center_x,
        "left": box.center_y,
        "present": [[part.start, part.stop - 1] for part in true_slices(_present(shown))],
        "jumps": shown.breaks.tolist(),  # frames that nobody reaches by moving
        "lanes": _lane_changes(network, shown),
        "course": packed(np.unwrap(_filled(_course(shown))), HEADING_RESOLUTION),
        "nominal": _path(shown, origin),
        "offset": packed(_filled(shown.offset), POSITION_RESOLUTION),
    }
    if result is not None and result.is_enriched:
        values["enriched"] = _path(result.trajectory.at(rows), origin)
        values["added"] = packed(_filled(result.deviation[rows]), POSITION_RESOLUTION)
    return values


def _course(motion: EntityMotion) -> FloatArray:
    """Direction of the lane where the entity is, the way that it drives; its own heading off the roads. [rad]"""
    turned = np.arctan(np.tan(motion.heading_relative))  # against s, half a turn is no deviation
    return np.asarray(motion.heading - np.where(motion.road >= 0, turned, 0.0))


def _path(path: Track, origin: FloatArray) -> dict[str, Any]:
    return {
        "x": packed(_filled(path.x - origin[0]), POSITION_RESOLUTION),
        "y": packed(_filled(path.y - origin[1]), POSITION_RESOLUTION),
        "h": packed(np.unwrap(_filled(path.heading)), HEADING_RESOLUTION),
        "v": packed(_filled(path.speed), POSITION_RESOLUTION),
    }


def _filled(values: FloatArray) -> FloatArray:
    """Numbers instead of NaN, where an entity is absent: nobody sees them there."""
    return np.nan_to_num(np.asarray(values, dtype=np.float64))


def _lane_changes(network: RoadNetwork, motion: EntityMotion) -> list[tuple[int, str, int]]:
    """Frame, road id and lane id wherever one of them is new; no road: off the road."""
    road, lane = motion.road, motion.lane
    is_new = np.append(True, (np.diff(road) != 0) | (np.diff(lane) != 0))[: len(motion)]
    return [(int(k), network.road_ids[road[k]] if road[k] >= 0 else "", int(lane[k])) for k in np.flatnonzero(is_new)]


# ---- roads -----------------------------------------------------------------------------------------------------------
def _roads(network: RoadNetwork, places: FloatArray, origin: FloatArray) -> dict[str, list[dict[str, Any]]]:
    """Lanes and markings near some places, shape (n, 2) [m], as seen from the origin.

    Lanes are polygons with their `type`; marks are lines with `type`, `color`, `width` [m] and `start` (s, so that
    dashes go on from piece to piece) [m].
    """
    lanes, marks = [], []
    cells = {(int(i), int(k)) for i, k in np.unique(np.floor(places / ROAD_REACH), axis=0)}
    near = {(i + a, k + b) for i, k in cells for a in (-1, 0, 1) for b in (-1, 0, 1)}

    def line(road: int, s: FloatArray, t: FloatArray) -> FloatArray:
        poses = network.road_to_world(road, s, t)
        places = np.column_stack([poses.x, poses.y]) - origin
        return places[simplify(places[:, 0], places[:, 1], LINE_TOLERANCE)]

    def drawn(places: FloatArray, **what: Any) -> dict[str, Any]:
        return what | {"x": packed(places[:, 0], LINE_RESOLUTION), "y": packed(places[:, 1], LINE_RESOLUTION)}

    for road in range(len(network.roads)):
        for first, last in _pieces_near(network, road, near):
            for kind, s, right, left in lane_surfaces(network, road, first, last):
                if (left - right).max() >= LINE_TOLERANCE:
                    outline = np.concatenate([line(road, s, left), line(road, s, right)[::-1]])
                    lanes.append(drawn(outline, type="driving" if kind in DRIVING else kind))
            for mark, s, t in markings(network, road, first, last):
                what = {"type": mark.type, "color": mark.color, "width": mark.width, "start": round(float(s[0]), 2)}
                marks.append(drawn(line(road, s, t), **what))
    return {"lanes": lanes, "marks": marks}


def _pieces_near(network: RoadNetwork, road: int, near: set[tuple[int, int]]) -> Iterator[tuple[float, float]]:
    """Parts of a road, as (first, last) s, that lie in those squares, at most `PIECE_LENGTH` long each."""
    length = network.roads[road].length
    edges = np.linspace(0.0, length, max(1, int(np.ceil(length / PIECE_LENGTH))) + 1).tolist()
    for first, last in pairwise(edges):
        poses = network.road_to_world(road, np.linspace(first, last, 5))
        cells = np.floor(np.column_stack([poses.x, poses.y]) / ROAD_REACH)
        if last > first and any((int(i), int(k)) in near for i, k in cells):
            yield first, last


# ---- lanes and markings of roads as lines of t over s ----
LINE_STEP = 2.0
"""Between two points of a line. [m]"""

NO_MARK = frozenset({"none", "curb", "grass", "edge"})
"""Road marks that are no paint."""


def lane_surfaces(
    network: RoadNetwork, road: int, first: float, last: float
) -> Iterator[tuple[str, FloatArray, FloatArray, FloatArray]]:
    """Lanes of one road between two s: the type, and t of the right and of the left edge over s. [m]"""
    start, last = max(0.0, first), min(network.roads[road].length, last)
    while start < last:
        section_start, section_end = network.section_at(road, start)
        if section_end <= start:  # a section of no length: OpenDRIVE forbids it, field files have it
            return
        s = _grid(start, min(section_end, last))
        for lane in network.lanes_at(road, 0.5 * (max(section_start, start) + min(section_end, last))):
            if lane.type != "none":
                centre, half = network.lane_centre_t(road, lane.id, s), 0.5 * network.lane_width(road, lane.id, s)
                yield lane.type, s, centre - half, centre + half
        start = section_end


def markings(
    network: RoadNetwork, road: int, first: float, last: float
) -> Iterator[tuple[RoadMark, FloatArray, FloatArray]]:
    """Paint on one road between two s: the mark, and its t over s. [m]"""
    for mark in network.road_marks(road):
        start, stop = max(first, mark.s_start), min(last, mark.s_end)
        if start < stop and mark.type not in NO_MARK:
            s = _grid(start, stop)
            outer = 0.5 * np.sign(mark.lane) * network.lane_width(road, mark.lane, s) if mark.lane else 0.0
            yield mark, s, network.lane_centre_t(road, mark.lane, s) + outer


def _grid(start: float, stop: float) -> FloatArray:
    """From start to just before stop, where the next section begins."""
    return np.linspace(start, max(start, stop - 1e-6), max(2, int(np.ceil((stop - start) / LINE_STEP)) + 1))
