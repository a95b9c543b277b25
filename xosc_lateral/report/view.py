"""The page of `view`: a scenario as its maneuvers alone play it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from xosc_lateral.motion.nominal import NominalMotion
from xosc_lateral.report.nominal_figures import nominal_speeds
from xosc_lateral.report.player.scene import nominal_scene
from xosc_lateral.report.render import render_page
from xosc_lateral.road import RoadNetwork


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
