"""The state table: one row per entity and step, as CSV or as a frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.lazy import pd
from xosc_lateral.files.output_tables import harmless
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.road import RoadNetwork

COLUMNS = ("time", "name", "x", "y", "z", "h", "speed", "road", "lane", "offset_t", "s")
"""[s], -, [m], [m], [m], [rad], [m/s], road id, lane id, [m] from the lane centre along +t, [m]."""

_NUMBERS = "%.3f,%s,%.4f,%.4f,%.4f,%.6f,%.4f,%s,%d,%.4f,%.4f"


def states_csv(motion: NominalMotion, network: RoadNetwork) -> str:
    """Rows of all entities that exist at a time, ordered by time and then as in the scenario, as CSV.

    Poses are inertial: the offset of the road's header counts. `network`: that it was played on.
    """
    lines = [",".join(COLUMNS)]
    for rows in zip(*(_lines(entity, network) for entity in motion.entities), strict=True):
        lines += [row for row in rows if row]
    return "\n".join(lines) + "\n"


def _lines(motion: EntityMotion, network: RoadNetwork) -> Iterator[str]:
    """One per row, empty where the entity does not exist."""
    columns = [values.tolist() for values in _columns(motion, network, _quoted).values()]
    for row, activity in zip(zip(*columns, strict=True), motion.activity.tolist(), strict=True):
        yield _NUMBERS % row if activity & Activity.ACTIVE else ""


def states_frame(motion: NominalMotion, network: RoadNetwork) -> pd.DataFrame:
    """The same rows as a frame, every digit kept."""
    frames = [
        pd.DataFrame(_columns(entity, network, str) | {"entity": number}).loc[(entity.activity & Activity.ACTIVE) != 0]
        for number, entity in enumerate(motion.entities)
    ]
    if not frames:
        return pd.DataFrame(columns=list(COLUMNS))
    rows: pd.DataFrame = pd.concat(frames, ignore_index=True)
    return rows.sort_values(["time", "entity"], kind="stable", ignore_index=True)[list(COLUMNS)]


def _columns(motion: EntityMotion, network: RoadNetwork, text: Callable[[str], str]) -> dict[str, NDArray[Any]]:
    """By their names in the table, shape (n,) each; `text`: how names are written."""
    on_road = motion.road >= 0
    offset_t = np.zeros(len(motion.time))
    offset_t[on_road] = network.travel_directions(motion.road[on_road], motion.lane[on_road]) * motion.offset[on_road]
    ids = np.array([*map(text, network.road_ids), ""], dtype=object)
    name = np.full(len(motion.time), text(motion.name), dtype=object)
    pose = network.header_offset.apply(motion.x, motion.y, motion.z, motion.heading)
    columns = motion.time, name, *pose, motion.speed, ids[motion.road], motion.lane, offset_t, motion.s
    return dict(zip(COLUMNS, columns, strict=True))


def _quoted(text: str) -> str:
    """As a CSV field."""
    text = harmless(text)
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\r\n') else text
