"""Make a written scenario one of its target's: another version of the standard, a player's own ways; and write it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from xosc_lateral.files.openscenario.element import elements, local_name
from xosc_lateral.files.openscenario.provenance import mark, write_sealed
from xosc_lateral.files.openscenario.read import is_town
from xosc_lateral.files.openscenario.write.build import named
from xosc_lateral.files.openscenario.write.carla import fit_carla
from xosc_lateral.files.openscenario.write.draft import Draft, Player, WrittenScenario
from xosc_lateral.files.openscenario.write.literal import fill_in, inline_catalogs
from xosc_lateral.files.openscenario.write.losses import Losses
from xosc_lateral.files.openscenario.write.versions import fit_version
from xosc_lateral.world.scenario.expressions import ExpressionError
from xosc_lateral.world.scenario.scenario import Scenario


def fit(draft: Draft, converted: Sequence[str] | None) -> None:
    """Change what the target does not know, and note it; `FormatError` for what the scenario can't do without.

    Its file references are still as seen from the scenario; `converted`: entities that follow trajectories; None:
    maneuvers are still maneuvers.
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


# ---- files that a scenario names, as seen from the folder that it is written to ----
_REFERENCES = {"Directory": "path"} | dict.fromkeys(("LogicFile", "SceneGraphFile", "File", "DomeFile"), "filepath")
"""Element -> the attribute that names a file; models have another one."""


def rewrite_paths(draft: Draft, output: Path) -> None:
    """Rewrite relative file references so that they lead from the output's folder to where they led before.

    Nothing changes when the output lies beside the input, but for the road and a catalog that the reader found
    elsewhere than written: their references are repaired.
    """
    scenario = draft.scenario
    old, new = _absolute(scenario.path).parent, _absolute(output).parent
    found_elsewhere = _catalogs_found_elsewhere(scenario)
    for element in elements(draft.root):
        tag = local_name(element)
        attribute = _REFERENCES.get(tag, "model3d")
        if not (written := element.get(attribute)):
            continue
        try:
            text = draft.scope.fill(written).replace("\\", "/")
        except ExpressionError:
            continue
        leads_to = target = Path(os.path.normpath(old / text))
        if tag == "LogicFile" and scenario.road_file is not None:
            if is_town(text):
                continue
            target = _absolute(scenario.road_file)
        elif tag == "Directory" and len(found_elsewhere) == 1 and not leads_to.exists():
            target = found_elsewhere.pop()
        elif attribute == "model3d" and not leads_to.exists():
            continue
        stays = old == new or Path(text).is_absolute() or text[1:2] == ":"
        if text and not (target == leads_to and stays):
            element.set(attribute, Path(os.path.relpath(target, new)).as_posix())


def _catalogs_found_elsewhere(scenario: Scenario) -> list[Path]:
    """Folders of catalogs that lie in none of the scenario's catalog locations."""
    known = [_absolute(path) for path in scenario.catalog_locations.values()]
    known += [path.parent for path in known if path.suffix.lower() == ".xosc"]
    folders = dict.fromkeys(_absolute(path).parent for path in scenario.input_files[1:])
    return [folder for folder in folders if folder not in known]


def _absolute(path: Path) -> Path:
    """Absolute and without dots, links not followed: what a player would do with the reference."""
    return Path(os.path.normpath(path.absolute()))


# ---- what esmini (3.6.0) wants: the one place of its quirks ----
# All outputs are written such that it plays them to the millimetre, since other players mind none of that: vertices
# at least 0.1 m apart, which it would merge (`path_pieces`), and paths cut where a car stands; lane offsets as half
# cosines whose duration follows from the lateral acceleration (`offset_chain`); triggers without an edge, which it
# would miss in its first frame. It reads every version, and passes over the `Motion` of vertices, since their times
# say the same.
_STOPS_AT = {
    ("Polyline", "Interpolation"),
    ("RoutingAction", "PreferredLaneLayerAction"),
    ("RoutingAction", "RandomRouteAction"),
    ("EntityCondition", "RelativeAngleCondition"),
    ("ScenarioObject", "ExternalObjectReference"),
    ("Position", "GeoPosition"),
}
"""(tag above, tag): it ends with an error where it reads one."""


def fit_esmini(losses: Losses) -> None:
    """Take out what stops esmini; `FormatError` in a condition, an entity, or a maneuver that stays reactive."""
    for item in list(losses.root.iter("{*}*")):
        parent = item.getparent()
        if parent is None or (local_name(parent), local_name(item)) not in _STOPS_AT:
            continue
        if local_name(item) == "ExternalObjectReference":
            losses.refuse(item, local_name(item), hint="")
        losses.element(item, "esmini would stop there")
