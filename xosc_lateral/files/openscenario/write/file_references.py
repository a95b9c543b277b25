"""Files that a scenario names, as seen from the folder that it is written to."""

from __future__ import annotations

import os
from pathlib import Path

from xosc_lateral.files.openscenario.element import elements, local_name
from xosc_lateral.files.openscenario.read import is_town
from xosc_lateral.files.openscenario.write.draft import Draft
from xosc_lateral.world.scenario import Scenario
from xosc_lateral.world.scenario.expressions import ExpressionError

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
