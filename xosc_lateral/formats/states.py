"""The state table: one row per entity and step, as CSV."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.road import RoadNetwork

COLUMNS = ("time", "name", "x", "y", "z", "h", "speed", "road", "lane", "offset_t", "s")
"""[s], -, [m], [m], [m], [rad], [m/s], road id, lane id, [m] from the lane centre along +t, [m]."""

_NUMBERS = "%.3f,%s,%.4f,%.4f,%.4f,%.6f,%.4f,%s,%d,%.4f,%.4f"


def write_states(motion: NominalMotion, network: RoadNetwork, path: Path | str) -> None:
    """Write the rows of all entities that exist at a time, ordered by time and then as in the scenario.

    Parameters
    ----------
    motion : NominalMotion
    network : RoadNetwork
        That it was played on.
    path : path
        The CSV file; it appears when it is complete.
    """
    columns = [list(_rows(entity, network)) for entity in motion.entities]
    lines = [",".join(COLUMNS)]
    for rows in zip(*columns, strict=True):
        lines += [row for row in rows if row]
    write_atomically(path, "\n".join(lines) + "\n")


def _rows(motion: EntityMotion, network: RoadNetwork) -> Iterator[str]:
    """One line per row, empty where the entity does not exist."""
    on_road = motion.road >= 0
    offset_t = np.zeros(len(motion.time))
    offset_t[on_road] = network.travel_directions(motion.road[on_road], motion.lane[on_road]) * motion.offset[on_road]
    name = _quoted(motion.name)
    ids = [_quoted(road_id) for road_id in network.road_ids]
    columns = zip(
        motion.time.tolist(),
        motion.x.tolist(),
        motion.y.tolist(),
        motion.z.tolist(),
        motion.heading.tolist(),
        motion.speed.tolist(),
        motion.road.tolist(),
        motion.lane.tolist(),
        offset_t.tolist(),
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
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\r\n') else text
