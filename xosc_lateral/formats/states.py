"""The state table: one row per entity and step, as CSV or as a frame."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.formats.output_tables import harmless
from xosc_lateral.lazy import pd
from xosc_lateral.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.road import RoadNetwork

COLUMNS = ("time", "name", "x", "y", "z", "h", "speed", "road", "lane", "offset_t", "s")
"""[s], -, [m], [m], [m], [rad], [m/s], road id, lane id, [m] from the lane centre along +t, [m]."""

_NUMBERS = "%.3f,%s,%.4f,%.4f,%.4f,%.6f,%.4f,%s,%d,%.4f,%.4f"


def states_csv(motion: NominalMotion, network: RoadNetwork) -> str:
    """Rows of all entities that exist at a time, ordered by time and then as in the scenario, as CSV.

    Poses are inertial: the offset of the road's header counts. `network`: that it was played on.
    """
    columns = [list(_rows(entity, network)) for entity in motion.entities]
    lines = [",".join(COLUMNS)]
    for rows in zip(*columns, strict=True):
        lines += [row for row in rows if row]
    return "\n".join(lines) + "\n"


def states_frame(motion: NominalMotion, network: RoadNetwork) -> pd.DataFrame:
    """The same rows as a frame, every digit kept."""
    frames = [_frame(entity, network, number) for number, entity in enumerate(motion.entities)]
    if not frames:
        return pd.DataFrame(columns=list(COLUMNS))
    rows = pd.concat(frames, ignore_index=True).sort_values(["time", "entity"], kind="stable", ignore_index=True)
    return rows[list(COLUMNS)]


def _frame(motion: EntityMotion, network: RoadNetwork, number: int) -> pd.DataFrame:
    frame = pd.DataFrame(_columns(motion, network) | {"entity": number})
    there: pd.DataFrame = frame.loc[(motion.activity & Activity.ACTIVE) != 0]
    return there


def _offset_t(motion: EntityMotion, network: RoadNetwork) -> NDArray[np.float64]:
    on_road = motion.road >= 0
    offset_t = np.zeros(len(motion.time))
    offset_t[on_road] = network.travel_directions(motion.road[on_road], motion.lane[on_road]) * motion.offset[on_road]
    return offset_t


def _columns(motion: EntityMotion, network: RoadNetwork) -> dict[str, Any]:
    """By their names in the table, shape (n,) each."""
    ids = np.array([*network.road_ids, ""], dtype=object)
    return {
        "time": motion.time,
        "name": motion.name,
        "x": motion.x,
        "y": motion.y,
        "z": motion.z,
        "h": motion.heading,
        "speed": motion.speed,
        "road": ids[motion.road],
        "lane": motion.lane,
        "offset_t": _offset_t(motion, network),
        "s": motion.s,
    }


def _rows(motion: EntityMotion, network: RoadNetwork) -> Iterator[str]:
    """One line per row, empty where the entity does not exist."""
    name = _quoted(motion.name)
    ids = [_quoted(road_id) for road_id in network.road_ids]
    pose = network.header_offset.apply(motion.x, motion.y, motion.z, motion.heading)
    columns = zip(
        motion.time.tolist(),
        *(values.tolist() for values in pose),
        motion.speed.tolist(),
        motion.road.tolist(),
        motion.lane.tolist(),
        _offset_t(motion, network).tolist(),
        motion.s.tolist(),
        motion.activity.tolist(),
        strict=True,
    )
    for time, x, y, z, heading, speed, road, lane, offset, s, activity in columns:
        if activity & Activity.ACTIVE:
            yield _NUMBERS % (time, name, x, y, z, heading, speed, ids[road] if road >= 0 else "", lane, offset, s)
        else:
            yield ""


def _quoted(text: str) -> str:
    """As a CSV field."""
    text = harmless(text)
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\r\n') else text
