"""Make the references of a scenario hold from another folder."""

from __future__ import annotations

import os
from pathlib import Path

from lxml import etree

from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.formats.openscenario.read import is_town
from xosc_lateral.scenario import Scenario
from xosc_lateral.scenario.expressions import ExpressionError
from xosc_lateral.scenario.parameters import Scope

REFERENCES = {
    "Directory": "path",
    "LogicFile": "filepath",
    "SceneGraphFile": "filepath",
    "File": "filepath",
    "DomeFile": "filepath",
}


def rewrite_paths(root: etree._Element, scenario: Scenario, output: Path, scope: Scope) -> None:
    """Rewrite relative file references so that they lead from the output's folder to where they led before.

    Nothing changes when the output lies beside the input, but for the road and a catalog that the reader found
    elsewhere than written: their references are repaired.
    """
    old, new = _absolute(scenario.path).parent, _absolute(output).parent
    found_elsewhere = _catalogs_found_elsewhere(scenario)
    for element in root.iter("{*}*"):  # no comments
        tag = local_name(element)
        if tag == "LogicFile" and scenario.road_file is not None and _names_a_town(element, scope):
            continue
        if tag == "LogicFile" and scenario.road_file is not None:
            _redirect(element, "filepath", _absolute(scenario.road_file), old, new, scope)
        elif tag == "Directory" and len(found_elsewhere) == 1 and not _leads_somewhere(element, old, scope):
            _redirect(element, "path", found_elsewhere.pop(), old, new, scope)
        elif tag in REFERENCES and old != new:
            _redirect(element, REFERENCES[tag], None, old, new, scope)
        elif old != new and element.get("model3d"):
            _redirect(element, "model3d", None, old, new, scope, only_existing=True)


def _catalogs_found_elsewhere(scenario: Scenario) -> list[Path]:
    """Folders of catalogs that lie in none of the scenario's catalog locations."""
    known = [_absolute(path) for path in scenario.catalog_locations.values()]
    known += [path.parent for path in known if path.suffix.lower() == ".xosc"]
    folders = dict.fromkeys(_absolute(path).parent for path in scenario.input_files[1:])
    return [folder for folder in folders if folder not in known]


def _leads_somewhere(element: etree._Element, folder: Path, scope: Scope) -> bool:
    try:
        return (folder / scope.fill(element.get("path") or "").replace("\\", "/")).exists()
    except ExpressionError:
        return True


def _names_a_town(element: etree._Element, scope: Scope) -> bool:
    """A road by its name in CARLA ("Town04") stays one."""
    try:
        return is_town(scope.fill(element.get("filepath") or ""))
    except ExpressionError:
        return False


def _absolute(path: Path) -> Path:
    """Absolute and without dots, links not followed: what a player would do with the reference."""
    return Path(os.path.normpath(path.absolute()))


def _redirect(
    element: etree._Element,
    attribute: str,
    target: Path | None,
    old: Path,
    new: Path,
    scope: Scope,
    *,
    only_existing: bool = False,
) -> None:
    written = element.get(attribute)
    if not written:
        return
    try:
        text = scope.fill(written).replace("\\", "/")
    except ExpressionError:
        return
    led_to = Path(os.path.normpath(old / text))
    if target is None:
        target = led_to
    absolute = Path(text).is_absolute() or (len(text) > 1 and text[1] == ":")
    if target == led_to and (old == new or absolute):
        return
    if only_existing and not target.exists():
        return
    element.set(attribute, Path(os.path.relpath(target, new)).as_posix())
