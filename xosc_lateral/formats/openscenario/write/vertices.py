"""Vertices of trajectories, which become text only while the document is written: as elements they take 3 kB each."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from lxml import etree
from msgspec import Struct

from xosc_lateral.arrays import FloatArray
from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.formats.openscenario.read import is_town
from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.rows import give_back
from xosc_lateral.scenario import Scenario
from xosc_lateral.scenario.expressions import ExpressionError
from xosc_lateral.scenario.parameters import Scope

BLOCK = 1000
"""Vertices that are text at a time."""

_POSE, _MOTION = ("x", "y", "z", "h", "p", "r"), ("speed_longitudinal", "acceleration_longitudinal")

_DIGITS = (6, 5, 5, 5, 6, 6, 6, 4, 4)
"""Decimals of the time and of these."""


ColumnsOf = Callable[[slice], Sequence[FloatArray]]


class TimedVertices(Struct, frozen=True, eq=False):
    """Vertices of one trajectory.

    Parameters
    ----------
    count : int
        How many they are.
    columns_of : callable
        Gives, for some of them, time [s], x, y, z [m], heading, pitch, roll [rad] and, where vertices have a motion,
        speed [m/s] and acceleration [m/s2]; shape (n,) each.
    """

    count: int
    columns_of: ColumnsOf

    def text(self, indent: str, unit: str) -> Iterator[str]:
        """XML of the vertices, set out at `indent`, each level below by `unit` more; the first without its indent."""
        inner, innermost = f"\n{indent}{unit}", f"\n{indent}{unit}{unit}"
        for begin in range(0, self.count, BLOCK):
            block = np.stack(self.columns_of(slice(begin, begin + BLOCK)))
            varies = np.ptp(block, axis=1) != 0.0
            digits = _DIGITS[: len(block)]
            time, *values = ("%s" if varies[k] else build.decimal(block[k, 0], count) for k, count in enumerate(digits))
            pose, motion = (
                "".join(f' {name}="{value}"' for name, value in zip(names, part, strict=True))
                for names, part in ((_POSE, values[:6]), (_MOTION[: len(values) - 6], values[6:]))
            )
            vertex = (
                f'<Vertex time="{time}">{inner}<Position>{innermost}<WorldPosition{pose}/>{inner}</Position>'
                + (f"{inner}<Motion{motion}/>" if motion else "")
                + f"\n{indent}</Vertex>"
            )
            numbers = build.decimals(block[varies].T, [_DIGITS[k] for k in np.flatnonzero(varies)])
            text = f"\n{indent}".join([vertex] * block.shape[1]) % numbers
            yield (f"\n{indent}" if begin else "") + text
            give_back()


class Vertices:
    """Polylines of a document, and where in it they go.

    Parameters
    ----------
    source : bytes
        The document before: no mark of ours can be in it by chance or by malice, for its hash is part of the mark.
    """

    def __init__(self, source: bytes) -> None:
        self._mark = f"vertices-{hashlib.sha256(source).hexdigest()[:32]}"
        self._polylines: list[TimedVertices] = []

    def add(self, owner: etree._Element, polyline: TimedVertices) -> None:
        """Let an element hold these vertices and nothing else."""
        owner.append(etree.ProcessingInstruction(self._mark, str(len(self._polylines))))
        self._polylines.append(polyline)

    def document(self, root: etree._Element) -> Iterator[bytes]:
        """The whole file in pieces; see `build.document`."""
        unit = build.indentation(root)
        rest = build.document(root)
        begin, end = f"<?{self._mark} ".encode(), b"?>"
        while (at := rest.find(begin)) >= 0:
            number, _, after = rest[at + len(begin) :].partition(end)
            before = rest[:at]
            yield before
            indent = before[before.rfind(b"\n") + 1 :].decode()
            for text in self._polylines[int(number)].text(indent, unit):
                yield text.encode()
            rest = after
        yield rest


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
