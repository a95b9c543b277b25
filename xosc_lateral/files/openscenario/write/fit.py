"""Write a played scenario with lateral movement in it: its motion changed, and made one of its target's."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from xosc_lateral.base.track import Track
from xosc_lateral.files.held import exists
from xosc_lateral.files.openscenario.element import elements, local_name
from xosc_lateral.files.openscenario.provenance import mark, write_sealed
from xosc_lateral.files.openscenario.read import is_town
from xosc_lateral.files.openscenario.write.build import version_text
from xosc_lateral.files.openscenario.write.carla import fit_carla
from xosc_lateral.files.openscenario.write.draft import STANDARD, Draft, Losses, Player, TargetPlayer, WrittenScenario
from xosc_lateral.files.openscenario.write.literal import fill_in, inline_catalogs
from xosc_lateral.files.openscenario.write.reactive import LateralActions, add_paths
from xosc_lateral.files.openscenario.write.replay import replay
from xosc_lateral.files.openscenario.write.versions import fit_version
from xosc_lateral.files.remote import leads_from
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.motion.offset_path import OffsetPath
from xosc_lateral.world.scenario.parameters import ExpressionError
from xosc_lateral.world.scenario.scenario import Scenario


def write_converted(
    scenario: Scenario,
    motion: NominalMotion,
    trajectories: Mapping[str, Track],
    output: Path | str,
    *,
    paths: Sequence[OffsetPath] | None = None,
    lateral: LateralActions | None = None,
    provenance: Mapping[str, Any],
    summary: str,
    save: bool = True,
    target: TargetPlayer = STANDARD,
) -> WrittenScenario:
    """Write a scenario in which entities follow trajectories, or keep their maneuvers and get lane offsets on top.

    - `motion`: the run; gives the times of kept actions, standstill, teleports and the end; how often an action runs
    - `trajectories`: per entity, on the rows of `motion`; those of trailers are ignored in a replay
    - `paths`: of those who keep their maneuvers, from their start and after each lateral action: the scenario stays
      reactive. None: a replay, in which all that is no trajectory happens when it happened in the run
    - `lateral`: actions of the scenario, where they are known; `provenance`: JSON values
    - `summary`: of the provenance, for the header's description; `save`: else the bytes are only handed back

    Raises `FormatError`: it was converted before, or can't be expressed for the target; `OSError`: nothing is left
    half-written; `ValueError`: a trajectory holds NaN or does not fit the motion.
    """
    draft = Draft(scenario, motion, target)
    if paths is None:
        converted = replay(draft, trajectories)
    else:
        converted = add_paths(draft, paths, lateral or LateralActions.of(scenario), trajectories)
    draft.override_parameters()
    _fit(draft, converted, is_reactive=paths is not None)
    rewrite_paths(draft, Path(output))
    mark(draft.root, provenance, summary)
    sha256, content, data = write_sealed(Path(output), draft.vertices.document(draft.root), save=save)
    return WrittenScenario(sha256, content, converted, data, tuple(draft.notes))


def _fit(draft: Draft, converted: Sequence[str], *, is_reactive: bool) -> None:
    """Change what the target does not know, and note it; `FormatError` for what the scenario can't do without."""
    scenario = draft.scenario
    losses = Losses(draft.root, scenario.path, f"version {version_text(draft.version)}", is_reactive, draft.notes)
    if draft.is_adapted:
        inline_catalogs(losses, draft)
        if draft.version == (1, 0):
            fill_in(losses, draft.scope, parameters=draft.player is Player.CARLA)
        fit_version(losses, scenario.header.version, draft.version)
    if draft.player is Player.ESMINI:
        losses.target = "esmini"
        fit_esmini(losses)
    elif draft.player is Player.CARLA:
        losses.target = "CARLA's ScenarioRunner"
        fit_carla(losses, draft, () if is_reactive else converted)


# ---- files that a scenario names, as seen from the folder that it is written to ----
_REFERENCES = {"Directory": "path"} | dict.fromkeys(("LogicFile", "SceneGraphFile", "File", "DomeFile"), "filepath")
"""Element -> the attribute that names a file; models have another one."""


def rewrite_paths(draft: Draft, output: Path) -> None:
    """Rewrite relative file references: they lead where they led before; a road found elsewhere is repaired."""
    scenario = draft.scenario
    old, new = (_absolute(path).parent for path in (scenario.path, leads_from(scenario.path, output)))
    # Folders of catalogs that lie in none of the scenario's catalog locations.
    known = [_absolute(path) for path in scenario.catalog_locations.values()]
    known += [path.parent for path in known if path.suffix.lower() == ".xosc"]
    folders = dict.fromkeys(_absolute(path).parent for path in scenario.input_files[1:])
    found_elsewhere = [folder for folder in folders if folder not in known]
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
        elif tag == "Directory" and len(found_elsewhere) == 1 and not exists(leads_to):
            target = found_elsewhere.pop()
        elif attribute == "model3d" and not exists(leads_to):
            continue
        stays = old == new or Path(text).is_absolute() or text[1:2] == ":"
        if text and not (target == leads_to and stays):
            element.set(attribute, Path(os.path.relpath(target, new)).as_posix())


def _absolute(path: Path) -> Path:
    """Absolute and without dots, links not followed: what a player would do with the reference."""
    return Path(os.path.normpath(path.absolute()))


# ---- what esmini (3.6.0) wants: the one place of its quirks ----
# All outputs are written such that it plays them to the millimetre, since other players mind none of that: vertices
# at least 0.1 m apart, which it would merge (`path_pieces`), and paths cut where a car stands; triggers without
# an edge, which it would miss in its first frame. It reads every version, and passes over the `Motion` of vertices,
# since their times say the same.
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
