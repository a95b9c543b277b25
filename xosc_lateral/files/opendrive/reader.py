"""One OpenDRIVE file into a `RoadNetwork`."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from os import PathLike, fspath
from pathlib import Path

from xosc_lateral.base.grouping import grouped
from xosc_lateral.base.note import remarked_before
from xosc_lateral.files.opendrive.document import RoadFile, XmlElement, plain_root
from xosc_lateral.files.opendrive.lane_sections import read_sections, speed_limit
from xosc_lateral.files.opendrive.plan_view import Record, finish_elements, read_plan_view
from xosc_lateral.files.xml import XmlDocument, document_of, read_document
from xosc_lateral.world.road.geometry import ReferenceElement
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.road.piecewise import HeaderOffset, PiecewiseCubic, Shape, Surface
from xosc_lateral.world.road.road import Connection, Junction, Road, RoadLink

LENGTH_TOLERANCE = 0.01
"""road/@length and the end of its geometry may differ by this without a note. [m]"""

MAXIMUM_COORDINATE = 1e8
"""Largest coordinate; UTM stays below 1e7. [m]"""

MAXIMUM_ROAD_LENGTH = 1e6
"""Longest road. The longest one in the field has 50 km. [m]"""


def read_opendrive(path: str | PathLike[str]) -> RoadNetwork:
    """Read one ``.xodr``; the network's `notes` name what was repaired; `FormatError` for what can't be understood."""
    return _network(read_document(Path(path)), fspath(path))


def parse_opendrive(data: bytes, name: str) -> RoadNetwork:
    """Read a road that is no file of its own, and that messages call by this name; see `read_opendrive`."""
    return _network(document_of(data, name), name)


def _network(document: XmlDocument, path: str) -> RoadNetwork:
    root, source = plain_root(document.root, path), RoadFile(path, document.sha256)
    with remarked_before(lambda: source.notes):
        return _network_at(root, source)


def _network_at(root: XmlElement, source: RoadFile) -> RoadNetwork:
    elements = list(root.iterfind("road"))
    if not elements:
        raise source.error("no road", root)
    seen: set[str] = set()
    for element in elements:
        if (road := element.get("id")) is None:
            raise source.error("attribute 'id' is missing", element)
        if road in seen:
            raise source.error(f"second road with id={road!r}", element)
        seen.add(road)
    plans = [read_plan_view(element, source) for element in elements]
    lines = finish_elements(plans)
    roads = tuple(_read_road(e, plan, line, source) for e, plan, line in zip(elements, plans, lines, strict=True))
    junctions = tuple(_read_junction(element, source) for element in root.iterfind("junction"))
    reference, offset = root.findtext("header/geoReference"), root.find("header/offset")
    for header in root.iterfind("header"):
        for name in ("north", "south", "east", "west"):
            source.number(header, name, 0.0)
    shift = () if offset is None else (source.number(offset, name, 0.0) for name in ("x", "y", "z", "hdg"))
    network = RoadNetwork(
        roads=roads,
        junctions=junctions,
        path=source.path,
        sha256=source.sha256,
        notes=source.notes,
        geo_reference=reference.strip() if reference and reference.strip() else None,
        header_offset=HeaderOffset(*shift),
    )
    _note_contacts(network, elements, source)
    network.notes = source.notes
    return network


MEETING_GAP = 1.0
"""Between ends of roads that meet. [m]"""


def _note_contacts(network: RoadNetwork, elements: Sequence[XmlElement], source: RoadFile) -> None:
    """Say which links touch a road at one end while it lies at this place with its other end."""
    for here, (road, element) in enumerate(zip(network.roads, elements, strict=True)):
        for what, link, s in (("predecessor", road.predecessor, 0.0), ("successor", road.successor, road.length)):
            if link is None or link.element_type != "road" or link.element_id not in network.road_ids:
                continue
            other = network.index_of(link.element_id)
            ends = {"start": 0.0, "end": network.roads[other].length}
            if link.contact not in ends:
                continue
            pose = network.road_pose_at(here, s)
            places = (network.road_pose_at(other, end) for end in (ends.pop(link.contact), *ends.values()))
            gap, opposite = (hypot(there.x - pose.x, there.y - pose.y) for there in places)
            if gap > MEETING_GAP > opposite:
                words = f"contactPoint={link.contact!r} of the {what} of road {road.id!r} contradicts the geometry"
                source.note(
                    f"{words}: road {link.element_id!r} meets it with its other end; followed as written", element
                )


def _read_road(
    element: XmlElement, plan: Sequence[Record], line: tuple[ReferenceElement, ...], source: RoadFile
) -> Road:
    length = _length(element, plan, source)
    rule = element.get("rule", "RHT").upper()
    if rule not in ("RHT", "LHT"):
        raise source.error(f"rule={element.get('rule')!r} is neither RHT nor LHT", element)
    for (s, piece, _), part in zip(plan, line, strict=True):
        for ds in (0.0, 0.5 * piece, piece):
            x, y, _ = part.at(ds)
            if not max(abs(x), abs(y)) <= MAXIMUM_COORDINATE:
                what = f"at s={s + ds:g} m the road lies at x={x:g}, y={y:g}; limit {MAXIMUM_COORDINATE:g} m"
                raise source.error(what, element)
    sections, directions = read_sections(element, length, rule, source)
    junction = element.get("junction", "-1")
    return Road(
        id=element.get("id", ""),
        name=element.get("name", ""),
        length=length,
        rule=rule,
        junction=None if junction in ("-1", "") else junction,
        starts=tuple(s for s, _, _ in plan),
        elements=line,
        sections=sections,
        surface=_read_surface(element, source),
        speeds=tuple(
            sorted((source.number(e, "s", 0.0), speed_limit(e.find("speed"), source)) for e in element.iterfind("type"))
        ),
        directions=directions,
        predecessor=_read_link(element, "predecessor"),
        successor=_read_link(element, "successor"),
        is_motorway=element.find("type[@type='motorway']") is not None,
    )


def _length(element: XmlElement, plan: Sequence[Record], source: RoadFile) -> float:
    """road/@length, or the end of the geometry where the attribute is absent or reaches further."""
    end = plan[-1][0] + plan[-1][1]
    length = source.number(element, "length", end)
    if length <= 0.0:
        raise source.error(f"length={length:g} m is not positive", element)
    if length > MAXIMUM_ROAD_LENGTH:
        raise source.error(f"length={length:g} m; limit {MAXIMUM_ROAD_LENGTH:g} m", element)
    if abs(length - end) > LENGTH_TOLERANCE:
        used = min(length, end)
        source.note(f"length={length:g} m, but the geometry ends at {end:g} m: {used:g} m used", element)
    return min(length, end) if length - end > LENGTH_TOLERANCE else length


def _read_surface(element: XmlElement, source: RoadFile) -> Surface:
    crossfalls = element.findall("lateralProfile/crossfall")
    fall = [(source.number(e, "s"), source.cubic(e), e.get("side", "both")) for e in crossfalls]
    left, right = (
        PiecewiseCubic.from_records([(s, c) for s, c, side in fall if side != other], begin=0.0)
        for other in ("right", "left")
    )
    return Surface(
        elevation=_profile(element, "elevationProfile/elevation", source),
        superelevation=_profile(element, "lateralProfile/superelevation", source),
        crossfall=(left, right) if fall else None,
        shape=_read_shape(element, source),
    )


def _profile(element: XmlElement, tag: str, source: RoadFile) -> PiecewiseCubic:
    records = [(source.number(e, "s"), source.cubic(e)) for e in element.iterfind(tag)]
    return PiecewiseCubic.from_records(records, begin=0.0)


def _read_shape(element: XmlElement, source: RoadFile) -> Shape | None:
    stations = grouped(
        (source.number(e, "s"), (source.number(e, "t"), source.cubic(e)))
        for e in element.iterfind("lateralProfile/shape")
    )
    if not stations:
        return None
    ordered = sorted(stations)
    profiles = (PiecewiseCubic.from_records(stations[s], begin=min(t for t, _ in stations[s])) for s in ordered)
    return Shape(tuple(ordered), tuple(profiles))


def _read_link(element: XmlElement, tag: str) -> RoadLink | None:
    link = element.find(f"link/{tag}")
    if link is None or link.get("elementId") is None:
        return None
    contact = link.get("contactPoint", "")
    return RoadLink(link.get("elementType", "road"), link.get("elementId", ""), contact)


def _read_junction(element: XmlElement, source: RoadFile) -> Junction:
    connections = []
    for e in element.iterfind("connection"):
        connecting = e.get("connectingRoad") or e.get("linkedRoad")
        incoming = e.get("incomingRoad")
        if connecting is None or incoming is None:
            source.note("junction connection without incoming or connecting road left out", e)
            continue
        lanes = tuple((source.integer(k, "from"), source.integer(k, "to")) for k in e.iterfind("laneLink"))
        connections.append(Connection(incoming, connecting, e.get("contactPoint", "start"), lanes))
    return Junction(element.get("id", ""), element.get("name", ""), tuple(connections))
