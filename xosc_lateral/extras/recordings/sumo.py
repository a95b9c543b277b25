"""SUMO's networks and vehicle types, as far as a recording of a run needs them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.source import open_source
from xosc_lateral.files.tables import unpacked_text
from xosc_lateral.files.xml import root_tag

if TYPE_CHECKING:
    from lxml import etree

LANE_WIDTH = 3.2  # of SUMO's lanes [m]

LENGTHS = {
    "trailer": 16.5, "truck": 7.1, "lkw": 7.1, "coach": 14.0, "bus": 12.0, "delivery": 6.5, "emergency": 6.5,
    "army": 6.5, "motorcycle": 2.2, "moped": 2.1, "bicycle": 1.6, "tram": 22.0,
}  # fmt: skip
"""Of SUMO's vehicle classes (Vehicle Type Parameter Defaults); 5 m of all others. FCD output has no lengths. [m]"""

ON_FOOT = frozenset({"pedestrian", "bicycle", "wheelchair", "scooter", "rail", "tram", "rail_urban", "subway", "ship"})
"""A lane for these alone is no driving lane."""


@dataclass(frozen=True, slots=True)
class SumoLane:
    """A lane of a network: the edge that it is of, and its number there, from the kerb."""

    edge: str
    index: int
    width: float  # [m]
    length: float  # [m]
    is_driving: bool
    shape: str = ""  # points of its middle, as written


@dataclass(slots=True)
class SumoNet:
    """Lanes by their ids, inner ones of junctions included, and the lanes that each leads to, straight on first."""

    left_hand: bool = False
    lanes: dict[str, SumoLane] = field(default_factory=dict)
    following: dict[str, list[str]] = field(default_factory=dict)


def read_sumo_net(path: Path) -> SumoNet:
    """Raises `FormatError`: no SUMO network."""
    net, links = SumoNet(), list[tuple[bool, str, str]]()
    for event, element in elements(path, ("net", "lane", "connection")):
        if event == "end":
            continue
        if element.tag == "net":
            net.left_hand = element.get("lefthand", "false") in ("true", "1", "yes")
        elif element.tag == "lane" and (name := element.get("id")):
            edge, _, index = name.rpartition("_")
            allowed, denied = (set(element.get(key, "").split()) for key in ("allow", "disallow"))
            is_driving = not (allowed and allowed <= ON_FOOT) and "all" not in denied
            shape = element.get("shape", "")
            width = LANE_WIDTH if element.get("width") is None else number_of(element, "width", path)
            net.lanes[name] = SumoLane(edge, int(index), width, number_of(element, "length", path), is_driving, shape)
        elif element.tag == "connection" and element.get("from") is not None:
            here, there = (f"{element.get(end)}_{element.get(f'{end}Lane')}" for end in ("from", "to"))
            links.append((element.get("dir") != "s", here, element.get("via") or there))
    if not net.lanes:
        raise FormatError("no lane: not a SUMO network", path=path)
    for _, here, there in sorted(links):
        net.following.setdefault(here, []).append(there)
    return net


def fcd_vehicles(path: Path) -> Iterator[tuple[float, Any]]:
    """Time and element of each vehicle in FCD output. Raises `FormatError`: it is none; one is outside of a time."""
    if (tag := root_tag(path)) != "fcd-export":
        what = f"its root element is {tag!r}" if tag else "it is no XML"
        raise FormatError(f"no FCD output of SUMO: {what}", path=path)
    time = float("nan")
    for event, element in elements(path, ("timestep", "vehicle")):
        if event == "end":
            if element.tag == "timestep":
                element.clear()
        elif element.tag == "timestep":
            time = number_of(element, "time", path)
        elif np.isfinite(time):
            yield time, element
        else:
            raise wrong_element("a vehicle outside a timestep", element, path)


def is_left_handed(path: Path) -> bool:
    """Whether a network is of left-hand traffic, in which SUMO counts lanes and sides from the left kerb."""
    return next((element.get("lefthand") in ("true", "1", "yes") for _, element in elements(path, ("net",))), False)


def read_vehicle_types(path: Path | None) -> dict[str, tuple[float, str]]:
    """Length [m] and class of the vehicle types in a route or additional file; of none, nothing."""
    types = {}
    for event, element in elements(path, ("vType",)) if path is not None else ():
        if event == "start" and element.get("id"):
            kind = element.get("vClass", "passenger")
            length = usual_length(kind) if element.get("length") is None else number_of(element, "length", path)
            types[str(element.get("id"))] = length, kind
    if path is not None and not types:
        raise FormatError("no vType: not a file of SUMO's vehicle types", path=path)
    return types


def usual_length(name: str) -> float:
    """Of a vehicle whose type or class has such a name. [m]"""
    return next((length for word, length in LENGTHS.items() if word in name.lower()), 5.0)


def elements(path: Path, tags: tuple[str, ...]) -> Iterator[tuple[str, etree._Element]]:
    """Starts and ends of some elements of an XML file, packed or not."""
    from lxml import etree

    try:
        with open_source(path) as source:
            yield from etree.iterparse(
                unpacked_text(source), events=("start", "end"), tag=tags,
                resolve_entities=False, no_network=True, load_dtd=False,
            )  # fmt: skip
    except etree.XMLSyntaxError as error:
        raise FormatError(f"not XML: {error.msg}", path=path, line=error.lineno) from error


def wrong_element(what: str, element: etree._Element, path: Path | None) -> FormatError:
    """With the element's line."""
    line: Any = element.sourceline  # int or None; its stubs say otherwise
    return FormatError(what, path=path, line=line, element=str(element.tag))


def number_of(element: etree._Element, name: str, path: Path | None) -> float:
    """An attribute. Raises `FormatError`: it is no finite number."""
    text = element.get(name, "")
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise wrong_element(f"{name}={text!r}", element, path)
    return value
