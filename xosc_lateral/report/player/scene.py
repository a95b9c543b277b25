"""A played scenario as plain values for the player: vehicles over time, roads around them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import groupby, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.enrich.result import Enriched, EntityResult
from xosc_lateral.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.motion.trajectory import WorldTrajectory
from xosc_lateral.report.path_dynamics import lateral_dynamics
from xosc_lateral.report.player.roads import CENTIMETRE_PER_SECOND, MILLIMETRE, MILLIRADIAN_TENTH, pack, road_shapes
from xosc_lateral.road import RoadNetwork
from xosc_lateral.road.geometry import simplify
from xosc_lateral.rows import true_slices

FloatArray = NDArray[np.float64]
RowArray = NDArray[np.int64]

BEYOND = 250.0
"""How far the line goes on behind and ahead of the motion. [m]"""

STEP = 5.0
"""Between points of it. [m]"""

TOLERANCE = 0.01
"""It is simplified to this. [m]"""


def track_of(network: RoadNetwork, motion: EntityMotion) -> FloatArray:
    """Points of the line in the direction of travel, shape (n, 2), n >= 2. [m]"""
    line = _along_roads(network, motion)
    if line is None:
        line = _along_motion(motion)
    line = line[np.append(True, np.hypot(*np.diff(line, axis=0).T) > 0.5)]
    if len(line) < 2:
        row = int(np.argmax((motion.activity & Activity.ACTIVE) != 0))
        ahead = np.array([np.cos(motion.heading[row]), np.sin(motion.heading[row])])
        line = line[0] + np.array([[-1.0], [1.0]]) * ahead
    return np.asarray(line[simplify(line[:, 0], line[:, 1], TOLERANCE)])


def _along_motion(motion: EntityMotion) -> FloatArray:
    present = (motion.activity & Activity.ACTIVE) != 0
    rows = present if present.any() else np.ones_like(present)
    return np.column_stack([motion.x[rows], motion.y[rows]])


def _along_roads(network: RoadNetwork, motion: EntityMotion) -> FloatArray | None:
    """Beside the reference lines; None where the entity leaves the roads or is placed anew."""
    rows = np.flatnonzero((motion.activity & Activity.ACTIVE) != 0)
    moved = (motion.activity[rows[1:]] & Activity.TELEPORTED) != 0
    if len(rows) < 2 or moved.any() or (motion.road[rows] < 0).any() or (np.abs(motion.heading_relative) > 1.0).any():
        return None
    places = [
        *_beyond(network, motion, int(rows[0]), -1.0),
        *zip(motion.road[rows].tolist(), motion.s[rows].tolist(), strict=True),
        *_beyond(network, motion, int(rows[-1]), 1.0),
    ]
    here = np.array([motion.x[rows[0]], motion.y[rows[0]]])
    begin = int(motion.road[rows[0]])
    t = float(network.path_to_lane(here[:1], here[1:], begin, motion.s[rows[:1]], lane_types=None).t[0])
    return _beside(network, places, begin, t)


def _beside(network: RoadNetwork, places: Sequence[tuple[int, float]], begin: int, t: float) -> FloatArray:
    """Points at an even t beside one reference line after the other, shape (n, 2). [m]"""
    parts: list[FloatArray] = []
    for road, group in groupby(places, key=lambda place: place[0]):
        s = np.array([place[1] for place in group])
        if parts and road != begin:
            last = parts[-1][-1]
            t = float(network.path_to_lane(last[:1], last[1:], road, s[:1], lane_types=None).t[0])
        begin = road
        kept = np.append(True, np.diff(np.floor(s / STEP)) != 0)
        kept[-1] = True
        poses = network.road_to_world(road, s[kept], np.full(int(kept.sum()), t))
        parts.append(np.column_stack([poses.x, poses.y]))
    return np.concatenate(parts)


def _beyond(network: RoadNetwork, motion: EntityMotion, row: int, way: float) -> list[tuple[int, float]]:
    """Places along the lane behind (way -1) or ahead (+1) of a row, in the order of travel."""
    places = []
    for distance in np.arange(STEP, BEYOND, STEP):
        moved = network.advance(
            int(motion.road[row]), int(motion.lane[row]), float(motion.s[row]), float(way * distance)
        )
        if moved.remaining:
            break
        places.append((moved.road, moved.s))
    return places if way > 0 else places[::-1]


FRAME = 0.1
"""Between two frames; the player interpolates, which is off by 6 mm at 5 m/s2. [s]"""

MOST_FRAMES = 60_000
"""Frames of all entities together beyond which they are spaced farther apart: what a browser takes at once."""

TRACK_RESOLUTION = 0.005
"""Of the line along which the road is straightened. [m]"""


def enriched_scene(enriched: Enriched) -> str:
    """JSON for the player: enriched motion, and the nominal one as ghosts."""
    return _json(enriched.network, enriched.motion, [(one.motion, one) for one in enriched.entities])


def paths_scene(motion: NominalMotion, network: RoadNetwork, results: Sequence[EntityResult]) -> str:
    """JSON for the player: other paths than the motion's, which is shown as ghosts."""
    return _json(network, motion, list(zip(motion.entities, results, strict=True)))


def nominal_scene(motion: NominalMotion, network: RoadNetwork) -> str:
    """JSON for the player: nominal motion alone."""
    return _json(network, motion, [(entity, None) for entity in motion.entities])


def _json(network: RoadNetwork, motion: NominalMotion, all_: Sequence[tuple[EntityMotion, EntityResult | None]]) -> str:
    shown = [(number, entity, result) for number, (entity, result) in enumerate(all_) if _present(entity).any()]
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
    track = track_of(network, motion) - origin
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
        "track": [pack(track[:, k], TRACK_RESOLUTION) for k in (0, 1)],
        "nominal": _path(motion, rows, origin, motion),
        "offset": pack(_filled(motion.offset[rows]), MILLIMETRE),
    }
    if result is not None and result.is_enriched:
        values["enriched"] = _path(result.trajectory, rows, origin, motion)
        values["added"] = pack(_filled(result.deviation[rows]), MILLIMETRE)
    return values


def _path(
    path: EntityMotion | WorldTrajectory, rows: RowArray, origin: FloatArray, motion: EntityMotion
) -> dict[str, Any]:
    dynamics = lateral_dynamics(motion, path)  # type: ignore[arg-type]  # both have the fields that it reads
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
