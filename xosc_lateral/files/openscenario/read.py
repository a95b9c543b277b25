"""Read an OpenSCENARIO file, leniently: what field files leave out or misspell is taken as meant where it is clear."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path, PureWindowsPath

from lxml import etree
from msgspec import Struct

from xosc_lateral.base.errors import FormatError, absent, meant_for
from xosc_lateral.base.note import Note, remarked_before
from xosc_lateral.files.held import is_file
from xosc_lateral.files.openscenario import references
from xosc_lateral.files.openscenario.context import Context, read_struct
from xosc_lateral.files.openscenario.element import XmlElement, local_name, means_true
from xosc_lateral.files.openscenario.entities import read_entities
from xosc_lateral.files.openscenario.references import Boundary
from xosc_lateral.files.openscenario.storyboard import READERS
from xosc_lateral.files.xml import document_of, read_document
from xosc_lateral.world.scenario.parameters import Scope
from xosc_lateral.world.scenario.place import Place
from xosc_lateral.world.scenario.scenario import FileHeader, Scenario, Storyboard, TrafficSignalController

BOOLEANS = frozenset(
    {
        *("activateAnimation", "activateLateral", "activateLighting", "activateLongitudinal", "active", "alongRoute"),
        *("animation", "closed", "continuous", "freeSpace", "freespace", "graphics", "lateral", "lighting"),
        *("longitudinal", "loop", "oppositeLanes", "selectTriggeringEntities", "sensors", "traffic"),
    }
)
"""Attributes that the standard calls Boolean, all versions."""


def note_spellings(root: XmlElement) -> list[Note]:
    """One remark for each attribute and word such as ``freespace="True"``, at its first place."""
    elements: dict[tuple[str, str], list[etree._Element]] = {}
    asked = BOOLEANS | {"parameterType"}
    for item in (one for one in root.xml.iter("{*}*") if not asked.isdisjoint(one.keys())):
        declares = item.get("parameterType") == "boolean"
        for name, value in item.attrib.items():
            word = str(value).strip()
            is_boolean = name in BOOLEANS or (declares and name == "value")
            if is_boolean and means_true(word) and word not in ("true", "1"):
                elements.setdefault((str(name), word), []).append(item)
    notes = []
    for (name, word), items in elements.items():
        place = XmlElement(items[0], root.path, root.scope).place()
        times = "" if len(items) == 1 else f" ({len(items)} times)"
        why = "the standard's word is 'true', and the reference player takes this one for false"
        notes.append(place.note(f"{name}='{word}' is read as true{times}; {why}"))
    return notes


_NEWER = {
    "Interpolation": "leaves the way between vertices to the player: straight pieces join them",
    "Motion": "is not read: vertices without a time are driven through at the entity's own speed",
    "layer": "is not read: roads have the lanes of their permanent layer alone",
}
"""Since version 1.4: elements, and an attribute of lanes."""


def note_newer(root: XmlElement) -> list[Note]:
    """One remark for each kind of what version 1.4 has and nobody plays, at its first place."""
    elements: dict[str, etree._Element] = {}
    for item in root.xml.iter("{*}*"):
        name = "layer" if item.get("layer") == "temporary" else local_name(item)
        parent = item.getparent()
        is_timed = name == "Motion" and parent is not None and parent.get("time") is not None
        if name in _NEWER and not is_timed:
            elements.setdefault(name, item)
    places = ((name, XmlElement(item, root.path, root.scope).place()) for name, item in elements.items())
    return [place.note(f"{name} {_NEWER[name]}") for name, place in places]


NEWEST_VERSION = (1, 3)

LEFT_HANDED = "written for CARLA: its left-handed coordinates are mirrored, its offsets count to the right"


class RoadSearch(Struct, frozen=True):
    """Where a road may lie besides where the scenario says; `FormatError` where there is no such file or folder."""

    file: Path | None = None  # the road, whatever the scenario says
    folders: tuple[Path, ...] = ()  # looked through for a file of the road's name

    def __post_init__(self) -> None:
        for folder in self.folders:
            if not folder.is_dir():
                raise FormatError("no such folder to look for roads in", path=folder)
        if self.file is not None and not is_file(self.file):
            raise FormatError(absent(self.file), path=self.file)


NO_ROADS = RoadSearch()


def read_scenario(
    path: Path | str,
    parameters: Mapping[str, str] | None = None,
    *,
    allowed: Iterable[Path] = (),
    strict: bool = False,
    roads: RoadSearch = NO_ROADS,
    data: bytes | None = None,
) -> Scenario:
    """Read a scenario with all that it takes from catalogs.

    - `parameters`: override those that the file declares; `data`: its content, where nothing is at the path as yet
    - `allowed`: folders, besides those around the scenario, that roads and catalogs may lie in; `roads`: where else its
      road may lie
    - `strict`: refuse a scenario whose vehicle catalog is missing, instead of playing a usual car and remarking it

    Raises `FormatError`: File, line, element and what is wrong: no XML, no scenario, a missing or malformed value, an
    unknown entity, catalog or parameter, a reference that leads outside, a missing road file.
    """
    path = Path(path)
    document = read_document(path) if data is None else document_of(data, path)
    root = open_scenario(document.root, path)
    if root.child("ParameterValueDistribution") is not None:
        root.fail("is a parameter value distribution, not a scenario: read the scenarios that it stands for")
    if root.child("Storyboard") is None and root.child("Catalog") is not None:
        root.fail("is a catalog, not a scenario")
    notes: list[Note] = []
    with remarked_before(lambda: notes):
        header = read_header(root)
        if header.version > NEWEST_VERSION:
            notes.append(root.place().note(f"version 1.{header.minor} is read as 1.{NEWEST_VERSION[1]}"))
            notes.extend(note_newer(root))
        notes.extend(note_spellings(root))
        scope, values = references.read_declarations(root, dict(parameters or {}), notes)
        root = root.within(scope)
        boundary = Boundary(path.parent, references.allowed_roots(path, allowed))
        locations = _catalog_locations(root)
        catalogs = references.Catalogs(locations, boundary, notes)
        context = Context(header.version, catalogs, notes, READERS, strict=strict, left_handed=header.is_left_handed)
        if header.is_left_handed:
            notes.append(root.place().note(LEFT_HANDED))
        network = root.child("RoadNetwork")
        logic = network.child("LogicFile", "Logics") if network else None
        written = logic.text("filepath", "") if logic else ""
        road_file = roads.file if network else None
        if road_file is None and logic and written.strip():
            road_file = _road_file(logic, written, boundary, notes, roads)
        listed_controllers = network.listed("TrafficSignals", "TrafficSignalController") if network else ()
        controllers = tuple(read_struct(TrafficSignalController, each, context) for each in listed_controllers)
        entities = read_entities(root, context)
        storyboard = read_struct(Storyboard, root.required("Storyboard"), context)
        return Scenario(
            path=path,
            header=header,
            parameters=values,
            variables=references.read_variables(root),
            catalog_locations={kind: path.parent / written for kind, (written, _) in locations.items()},
            road_file=road_file,
            traffic_signal_controllers=controllers,
            entities=entities,
            storyboard=storyboard,
            notes=tuple(notes),
            input_hashes={path: document.sha256, **catalogs.used},
            source=document.data,
        )


def open_scenario(document: etree._Element, path: Path) -> XmlElement:
    """Root element of any OpenSCENARIO file."""
    root = XmlElement(document, path, Scope({}))
    if local_name(document).lower() != "openscenario":
        name = local_name(document)[:40]
        root.fail(f"the root element is '{name}', not OpenSCENARIO{meant_for('.xodr') if name == 'OpenDRIVE' else ''}")
    return root


def read_header(root: XmlElement) -> FileHeader:
    """File header; versions before 1.0 and after 1 are refused."""
    header = root.child("FileHeader")
    if header is None:
        root.fail("FileHeader is missing")
    # tools have written "1+" for what came after 1.1
    minor_text = header.text("revMinor", "0").strip()
    minor = int(minor_text[:-1]) if re.fullmatch(r"\d{1,3}\+", minor_text) else header.value("revMinor", int, 0)
    major = header.value("revMajor", int, 1)
    if major != 1:
        header.fail(f"OpenSCENARIO {major}.{minor} is not read; versions 1.0 to 1.3 are, later 1.x as 1.3")
    return FileHeader(major, minor, header.text("description", ""))


def _catalog_locations(root: XmlElement) -> dict[str, tuple[str, Place]]:
    owner = root.child("CatalogLocations")
    locations = {}
    for location in owner.children() if owner else ():
        directory = location.child("Directory")
        if directory is not None and directory.text("path", ""):
            locations[location.tag] = (directory.text("path"), directory.place())
    return locations


def _road_file(logic: XmlElement, written: str, boundary: Boundary, notes: list[Note], roads: RoadSearch) -> Path:
    """The road where the scenario says, or else, like the reference player, a file of that name near the scenario."""
    place, name = logic.place(), PureWindowsPath(written.strip()).name
    try:
        road = boundary.inside(written, place)
        if is_file(road):
            return road
        missing = place.error(f"road file '{written}': {absent(road)} (looked for {road}); --road FILE names another")
    except FormatError as error:
        missing = error
    if is_town(written):
        name += ".xodr"
        missing = place.error(f"road '{written}' is not beside the scenario; name its folder or the file by --road")
    folder = boundary.folder
    beside = [near for near in (folder, folder / "xodr", folder.parent / "xodr") if boundary.holds(near / name)]
    for near in (*beside, *roads.folders):
        if name and is_file(near / name):
            notes.append(place.note(f"'{written}' is taken from {near / name}"))
            return near / name
    raise missing


def is_town(reference: str) -> bool:
    """A road by its name in CARLA ("Town04"), not by its file."""
    return bool(reference.strip()) and not any(sign in reference for sign in "./\\")
