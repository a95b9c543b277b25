"""The page of a played scenario, before anything is converted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from xosc_lateral.files.pages.page import Page
from xosc_lateral.workflows.playing.figures import speeds_over_time
from xosc_lateral.workflows.playing.scene import scene_of
from xosc_lateral.world.motion.nominal import NominalMotion, Note
from xosc_lateral.world.road.network import RoadNetwork


def view_page(
    motion: NominalMotion,
    network: RoadNetwork,
    *,
    source: str,
    provenance: Mapping[str, object],
    converted: Mapping[str, Any] | None = None,
) -> str:
    """HTML page with the player, self-contained; same input, same bytes.

    `source`: file name, for the reader; `provenance`: for the footer; `converted`: what the file says of its
    conversion, if it was converted.
    """
    page, profiles = Page(Path(source).name), (converted or {}).get("profiles")
    drivers = ", ".join(sorted(profiles)) if isinstance(profiles, Mapping) and profiles else "nobody"
    count = len(motion.entities)
    page.lead(
        f"{count} {'entity' if count == 1 else 'entities'}, {motion.end_time:.1f} s (ended by the {motion.ended_by}). "
        + (NOT_CONVERTED if converted is None else f"Converted by xosc-lateral, with lateral movement of {drivers}.")
    )
    page.section(
        "Player",
        "The scenario from above. A lateral stretch above 1 widens the road. Click a vehicle to follow it, point at it "
        "for its values, drag to look elsewhere.",
    )
    page.player(scene_of(motion, network), "Scenario from above")
    page.section("Speed")
    page.figure(
        speeds_over_time(motion),
        "Speed over time. Click to take the player to that time.",
        "Speed over time of every entity",
        over_time=True,
    )
    add_notes(page, motion.notes)
    return page.html(provenance)


NOT_CONVERTED = "The maneuvers are played as the scenario states them; no lateral movement was added to them."


def add_notes(page: Page, notes: Sequence[Note]) -> None:
    """The section on what was not played as the scenario states it."""
    page.section("Not played as written")
    if not notes:
        page.text("Nothing: every action and condition was played as the scenario states it.")
        return
    rows = [
        {"what": note.what, "element": note.element, "file": Path(note.path).name, "line": str(note.line or "")}
        for note in notes
    ]
    page.table(rows, "What was left out or played differently")
