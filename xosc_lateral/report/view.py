"""The page of `view`: a scenario as its maneuvers alone play it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.motion.nominal import Activity, NominalMotion
from xosc_lateral.report.figures import PALETTE, figure_style, label_of, new_figure
from xosc_lateral.report.player.scene import nominal_scene
from xosc_lateral.report.render import render_page
from xosc_lateral.road import RoadNetwork

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


def view_page(motion: NominalMotion, network: RoadNetwork, *, source: str, provenance: Mapping[str, object]) -> str:
    """HTML page with the player, self-contained; same input, same bytes.

    Parameters
    ----------
    motion : NominalMotion
        As played.
    network : RoadNetwork
        That it was played on.
    source : str
        File name, for the reader.
    provenance : mapping
        Shown in the footer.
    """
    notes = [
        {"what": note.what, "element": note.element, "file": Path(note.path).name, "line": str(note.line or "")}
        for note in motion.notes
    ]
    return render_page(
        "view.html",
        title=Path(source).name,
        provenance=provenance,
        motion=motion,
        scene=nominal_scene(motion, network),
        speeds=nominal_speeds(motion),
        notes=notes,
    )
