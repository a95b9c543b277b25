"""Results as frames and plain figures: what a notebook shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.report.figures import MEASURED, SAMPLED, figure_style, new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from xosc_lateral.driver.sampled_offsets import SampledOffsets
    from xosc_lateral.enrich.result import Enriched


def conversion_frame(enriched: Enriched) -> pd.DataFrame:
    """One row per entity and step of those that exist then, ordered by time and then as in the scenario."""
    import pandas as pd

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


@figure_style()
def offsets_figure(sampled: Sequence[SampledOffsets]) -> Figure:
    """Offset over time, a panel per run; what was measured beside it where it is known."""
    figure, axes = new_figure(max(1, len(sampled)), 1, height=0.6 + 1.3 * max(1, len(sampled)))
    for axis, one in zip(axes[:, 0], sampled, strict=False):
        if one.offset_real is not None:
            axis.plot(one.time, one.offset_real, color=MEASURED, label="measured")
        axis.plot(one.time, one.offset, color=SAMPLED, label="sampled")
        axis.set_title(one.drive)
        axis.set_ylabel("offset [m]")
        axis.legend(loc="upper right")
    axes[-1, 0].set_xlabel("time [s]")
    return figure
