"""Make a written scenario one of its target's: another version of the standard, a player's own ways; and write it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from xosc_lateral.files.openscenario.provenance import mark, write_sealed
from xosc_lateral.files.openscenario.write.build import named
from xosc_lateral.files.openscenario.write.carla import fit_carla
from xosc_lateral.files.openscenario.write.draft import Draft, WrittenScenario
from xosc_lateral.files.openscenario.write.esmini import fit_esmini
from xosc_lateral.files.openscenario.write.file_references import rewrite_paths
from xosc_lateral.files.openscenario.write.literal import fill_in, inline_catalogs
from xosc_lateral.files.openscenario.write.losses import Losses
from xosc_lateral.files.openscenario.write.target import Player
from xosc_lateral.files.openscenario.write.versions import fit_version


def fit(draft: Draft, converted: Sequence[str] | None) -> None:
    """Change what the target does not know, and note it.

    Parameters
    ----------
    draft : Draft
        Its file references still as seen from the scenario.
    converted : sequence of str, optional
        Entities that follow trajectories; None: maneuvers are still maneuvers.

    Raises
    ------
    FormatError
        For what the target does not know and the scenario can't do without.
    """
    target, scenario = draft.target, draft.scenario
    losses = Losses(draft.root, scenario.path, f"version {named(draft.version)}", converted is None, draft.notes)
    if target.adapts(scenario):
        inline_catalogs(losses, draft)
        if draft.version == (1, 0):
            fill_in(losses, draft.scope, parameters=target.player is Player.CARLA)
        fit_version(losses, scenario.header.version, draft.version)
    if target.player is Player.ESMINI:
        losses.target = "esmini"
        fit_esmini(losses)
    elif target.player is Player.CARLA:
        losses.target = "CARLA's ScenarioRunner"
        fit_carla(losses, draft, converted or ())


def finish(
    draft: Draft,
    output: Path,
    converted: Sequence[str],
    *,
    reactive: bool,
    provenance: Mapping[str, Any],
    summary: str,
    save: bool,
) -> WrittenScenario:
    """Fit a draft to its target, mark it as ours and write it; see the writers."""
    draft.override_parameters()
    fit(draft, None if reactive else converted)
    rewrite_paths(draft, output)
    mark(draft.root, provenance, summary)
    sha256, content, data = write_sealed(output, draft.vertices.document(draft.root), save=save)
    return WrittenScenario(output, sha256, content, tuple(converted), tuple(draft.removed), data, tuple(draft.notes))
