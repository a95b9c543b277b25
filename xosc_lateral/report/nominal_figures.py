"""Figures of nominal motion alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.motion.nominal import Activity, NominalMotion
from xosc_lateral.report.figures import PALETTE, figure_style, label_of, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROW_STEP = 0.1
"""Rows that are drawn. [s]"""


@figure_style()
def nominal_speeds(motion: NominalMotion) -> Figure:
    """Speed of every entity over time."""
    figure, axes = new_figure(1, 1, height=3.0)
    ax = axes[0, 0]
    every = max(1, round(ROW_STEP / motion.step))
    for number, entity in enumerate(motion.entities):
        present = (entity.activity[::every] & Activity.ACTIVE) != 0
        speed = np.where(present, entity.speed[::every], np.nan)
        ax.plot(entity.time[::every], speed, color=PALETTE[number % len(PALETTE)], label=label_of(entity.name))
    ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
    ax.set_xlabel("time [s]")
    ax.set_ylabel("speed [m/s]")
    if 0 < len(motion.entities) <= len(PALETTE):
        figure.legend(ncols=min(6, len(motion.entities)), loc="outside upper right")
    return figure
