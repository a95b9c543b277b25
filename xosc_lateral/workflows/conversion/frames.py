"""Results as frames and plain figures: what a notebook shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.base.lazy import pd
from xosc_lateral.files.pages.chart import MEASURED, SAMPLED
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.world.motion.nominal import Activity

if TYPE_CHECKING:
    from xosc_lateral.drivers.model.sampled_offsets import SampledOffsets
    from xosc_lateral.workflows.conversion.result import Enriched


def conversion_frame(enriched: Enriched) -> pd.DataFrame:
    """One row per entity and step of those that exist then, ordered by time and then as in the scenario."""
    ids = np.array([*enriched.network.road_ids, ""], dtype=object)
    frames = []
    for number, entity in enumerate(enriched.entities):
        motion, path = entity.motion, entity.trajectory
        frame = pd.DataFrame(
            {
                "time": motion.time,
                "name": motion.name,
                "x": path.x,
                "y": path.y,
                "z": path.z,
                "h": path.heading,
                "speed": path.speed,
                "road": ids[motion.road],
                "lane": motion.lane,
                "offset": motion.offset + entity.deviation,
                "deviation": entity.deviation,
                "x_nominal": motion.x,
                "y_nominal": motion.y,
                "entity": number,
            }
        )
        frames.append(frame[(motion.activity & Activity.ACTIVE) != 0])
    rows = pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=["time", "entity"])
    return rows.sort_values(["time", "entity"], kind="stable", ignore_index=True).drop(columns="entity")


def offsets_figure(sampled: Sequence[SampledOffsets]) -> Figure:
    """Offset over time, a panel per run; what was measured beside it where it is known."""
    figure = Figure(max(1, len(sampled)), height=75.0, legend=True)
    for panel, one in zip(figure.panels, sampled, strict=False):
        if one.offset_real is not None:
            panel.line(one.time, one.offset_real, MEASURED, label="measured")
        panel.line(one.time, one.offset, SAMPLED, label="sampled")
        panel.title, panel.x.label, panel.y.label = one.drive, "time [s]", "offset [m]"
    return figure
