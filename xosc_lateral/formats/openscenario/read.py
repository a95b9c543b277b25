"""Read an OpenSCENARIO file, leniently: what field files leave out or misspell is taken as meant where it is clear."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path, PureWindowsPath

from lxml import etree
from msgspec import Struct

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.openscenario.catalogs import Boundary, Catalogs, allowed_roots
from xosc_lateral.formats.openscenario.context import Context, read_struct
from xosc_lateral.formats.openscenario.declarations import read_declarations, read_variables
from xosc_lateral.formats.openscenario.element import XmlElement, local_name, means_true
from xosc_lateral.formats.openscenario.entities import read_entities
from xosc_lateral.formats.openscenario.storyboard import READERS
from xosc_lateral.formats.xml import read_document
from xosc_lateral.scenario import (
    FileHeader,
    Scenario,
    Storyboard,
    TrafficSignalController,
    TrafficSignalPhase,
    Unsupported,
)
from xosc_lateral.scenario.parameters import Scope
from xosc_lateral.scenario.place import Place

BOOLEANS = frozenset(
    {
        *("activateAnimation", "activateLateral", "activateLighting", "activateLongitudinal", "active", "alongRoute"),
        *("animation", "closed", "continuous", "freeSpace", "freespace", "graphics", "lateral", "lighting"),
        *("longitudinal", "loop", "oppositeLanes", "selectTriggeringEntities", "sensors", "traffic"),
    }
)
"""Attributes that the standard calls Boolean, all versions."""

_STANDARD = frozenset({"true", "1"})


def remark_spellings(root: XmlElement) -> list[Unsupported]:
    """One remark for each attribute and word such as ``freespace="True"``, at its first place."""
    first: dict[tuple[str, str], Place] = {}
    count: Counter[tuple[str, str]] = Counter()
    for item in root.xml.iter("{*}*"):
        _count(item, root, first, count)
    return [
        Unsupported(
            place.element,
            place,
            f"{name}='{word}' is read as true{'' if count[name, word] == 1 else f' ({count[name, word]} times)'}; "
            "the standard's word is 'true', and the reference player takes this one for false",
        )
        for (name, word), place in first.items()
    ]


def _count(
    item: etree._Element, root: XmlElement, first: dict[tuple[str, str], Place], count: Counter[tuple[str, str]]
) -> None:
    """One element's attributes."""
    is_truth = item.get("parameterType") == "boolean"
    for name, value in item.attrib.items():
        key = str(name), str(value).strip()
        is_boolean = key[0] in BOOLEANS or (is_truth and key[0] == "value")
        if is_boolean and means_true(key[1]) and key[1] not in _STANDARD:
            count[key] += 1
            first.setdefault(key, XmlElement(item, root.path, root.scope).place())


NEWEST = (1, 3)

LEFT_HANDED = "written for CARLA: its left-handed coordinates are mirrored, its offsets count to the right"


class RoadSearch(Struct, frozen=True):
    """Where a road may lie besides where the scenario says: what the user names is allowed.

    Raises `FormatError`: No such file, no such folder.

    Parameters
    ----------
    file : Path or None
        The road, whatever the scenario says.
    folders : tuple of Path
        Looked through for a file of the road's name.
    """

    file: Path | None = None
    folders: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        for folder in self.folders:
            if not folder.is_dir():
                raise FormatError("no such folder to look for roads in", path=folder)
        if self.file is not None and not self.file.is_file():
            raise FormatError("no such road", path=self.file)


NO_ROADS = RoadSearch()


def read_scenario(
    path: Path | str,
    parameters: Mapping[str, str] | None = None,
    *,
    allowed: Iterable[Path] = (),
    strict: bool = False,
    roads: RoadSearch = NO_ROADS,
) -> Scenario:
    """Read a scenario with all that it takes from catalogs.

    Raises `FormatError`: File, line, element and what is wrong: no XML, no scenario, a missing or malformed value, an
    unknown entity, catalog or parameter, a reference that leads outside, a missing road file.

    Parameters
    ----------
    path : path
        The ``.xosc`` file.
    parameters : mapping of str to str, optional
        Values that override those of the file's parameter declarations.
    allowed : iterable of path
        Folders, besides the scenario's own and the two above it, that roads and catalogs may lie in.
    strict : bool
        Refuse a scenario whose vehicle catalog is missing, instead of playing a usual car and remarking it.
    roads : RoadSearch
        Where else its road may lie.

    Returns
    -------
    Scenario
    """
    path = Path(path)
    document = read_document(path)
    root = open_scenario(document.root, path)
    if root.child("ParameterValueDistribution") is not None:
        root.fail("is a parameter value distribution, not a scenario: read the scenarios that it stands for")
    if root.child("Storyboard") is None and root.child("Catalog") is not None:
        root.fail("is a catalog, not a scenario")
    remarks: list[Unsupported] = []
    header = read_header(root)
    if header.version > NEWEST:
        remarks.append(Unsupported("FileHeader", root.place(), f"version 1.{header.minor} is read as 1.{NEWEST[1]}"))
    remarks.extend(remark_spellings(root))
    scope, values = read_declarations(root, dict(parameters or {}), remarks)
    root = root.within(scope)
    boundary = Boundary(path.parent, allowed_roots(path, allowed))
    locations = _catalog_locations(root)
    catalogs = Catalogs(locations, boundary, remarks)
    context = Context(
        header.version,
        catalogs,
        remarks,
        {**READERS, TrafficSignalPhase: _phase},
        strict=strict,
        left_handed=header.is_left_handed,
    )
    if header.is_left_handed:
        remarks.append(Unsupported("FileHeader", root.place(), LEFT_HANDED))
    road_file, road_place, scene_graph, signals = _road_network(root, boundary, context, roads)
    entities = read_entities(root, context)
    storyboard = read_struct(Storyboard, root.required("Storyboard"), context)
    return Scenario(
        path=path,
        header=header,
        parameters=values,
        variables=read_variables(root),
        catalog_locations={kind: path.parent / written for kind, (written, _) in locations.items()},
        road_file=road_file,
        road_place=road_place,
        scene_graph_file=scene_graph,
        traffic_signal_controllers=signals,
        entities=entities,
        storyboard=storyboard,
        remarks=tuple(remarks),
        input_hashes={path: document.sha256, **catalogs.used},
        source=document.data,
    )


def open_scenario(document: etree._Element, path: Path) -> XmlElement:
    """Root element of any OpenSCENARIO file."""
    root = XmlElement(document, path, Scope({}))
    if local_name(document).lower() != "openscenario":
        root.fail(f"the root element is '{local_name(document)[:40]}', not OpenSCENARIO")
    return root


def read_header(root: XmlElement) -> FileHeader:
    """File header; versions before 1.0 and after 1 are refused."""
    header = root.child("FileHeader")
    if header is None:
        root.fail("FileHeader is missing")
    # tools have written "1+" for what came after 1.1
    minor_text = header.text("revMinor", "0").strip()
    minor = int(minor_text[:-1]) if re.fullmatch(r"\d{1,3}\+", minor_text) else header.integer("revMinor", 0)
    major = header.integer("revMajor", 1)
    if major != 1:
        header.fail(f"OpenSCENARIO {major}.{minor} is not read; versions 1.0 to 1.3 are, later 1.x as 1.3")
    return FileHeader(major, minor, header.text("author", ""), header.text("description", ""), header.text("date", ""))


def _catalog_locations(root: XmlElement) -> dict[str, tuple[str, Place]]:
    owner = root.child("CatalogLocations")
    locations = {}
    for location in owner.children() if owner else ():
        directory = location.child("Directory")
        if directory is not None and directory.text("path", ""):
            locations[location.tag] = (directory.text("path"), directory.place())
    return locations


def _road_network(
    root: XmlElement, boundary: Boundary, context: Context, roads: RoadSearch
) -> tuple[Path | None, Place | None, str | None, tuple[TrafficSignalController, ...]]:
    network = root.child("RoadNetwork")
    if network is None:
        return None, None, None, ()
    logic = network.child("LogicFile", "Logics")
    road: Path | None = None
    if logic is not None and logic.text("filepath", "").strip():
        road = _road_file(logic, boundary, context.remarks, roads)
    elif roads.file is not None:
        road = roads.file
    graph = network.child("SceneGraphFile")
    signals = network.child("TrafficSignals")
    found = () if signals is None else signals.children("TrafficSignalController")
    controllers = tuple(read_struct(TrafficSignalController, one, context) for one in found)
    return road, logic.place() if logic else None, graph.text("filepath", "") if graph else None, controllers


def _road_file(logic: XmlElement, boundary: Boundary, remarks: list[Unsupported], roads: RoadSearch) -> Path:
    """The road where the scenario says, or else, like the reference player, a file of that name near the scenario.

    Scenarios for CARLA name a town, without a suffix.
    """
    written = logic.text("filepath")
    if roads.file is not None:
        return roads.file
    try:
        road = boundary.inside(written, logic.place())
        if road.is_file():
            return road
        missing = FormatError(
            f"road file '{written}' does not exist (looked for {road})",
            path=logic.path,
            line=logic.place().line,
            element=logic.label(),
        )
    except FormatError as error:
        missing = error
    name = PureWindowsPath(written.strip()).name
    if is_town(written):
        name += ".xodr"
        missing = FormatError(
            f"road '{written}' is not beside the scenario; name its folder by --road-path or the file by --road",
            path=logic.path,
            line=logic.place().line,
            element=logic.label(),
        )
    found = _road_nearby(logic, name, written, boundary, remarks, roads)
    if found is not None:
        return found
    raise missing


def _road_nearby(
    logic: XmlElement, name: str, written: str, boundary: Boundary, remarks: list[Unsupported], roads: RoadSearch
) -> Path | None:
    """A file of that name beside the scenario or in the folders that were named; remarked."""
    folder = boundary.folder
    beside = [near for near in (folder, folder / "xodr", folder.parent / "xodr") if boundary.holds(near / name)]
    for near in (*beside, *roads.folders):
        if name and (near / name).is_file():
            remarks.append(Unsupported("LogicFile", logic.place(), f"'{written}' is taken from {near / name}"))
            return near / name
    return None


def is_town(reference: str) -> bool:
    """A road by its name in CARLA ("Town04"), not by its file."""
    return bool(reference.strip()) and not any(sign in reference for sign in "./\\")


def _phase(element: XmlElement, context: Context) -> TrafficSignalPhase:
    shown = element.children("TrafficSignalState")
    states = tuple((state.text("trafficSignalId"), state.text("state")) for state in shown)
    return read_struct(TrafficSignalPhase, element, context, states=states)
