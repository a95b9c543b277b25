"""The same OpenDRIVE file told another way: seen in a mirror, moved, or with every road drawn from its other end."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from math import cos, pi, sin
from pathlib import Path
from typing import Any

from lxml import etree

from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.world.road.network import RoadNetwork

BEYOND = 1000.0
"""No profile across a road reaches so far. [m]"""
LETTERS = "abcd"


def retold(path: Path, folder: Path, how: Any, *more: float) -> RoadNetwork:
    """The network that a file becomes."""
    tree = etree.parse(str(path))
    how(tree.getroot(), *more)
    told = folder / f"{how.__name__}_{path.name}"
    tree.write(str(told))
    return read_opendrive(told)


def mirrored(root: Any) -> None:
    """As in a mirror along the x axis: right-hand traffic becomes left-hand traffic."""
    for geometry in root.iter("geometry"):
        _times(geometry, -1.0, "y", "hdg")
        _times(geometry[0], -1.0, "curvature", "curvStart", "curvEnd", *LETTERS, *(f"{x}V" for x in LETTERS))
    for road in root.iter("road"):
        road.set("rule", "RHT" if road.get("rule") == "LHT" else "LHT")
    _swap_sides(root)


def moved(root: Any, x: float, y: float, heading: float) -> None:
    """Turned about the origin, then shifted. [m], [rad]"""
    for geometry in root.iter("geometry"):
        u, v = _number(geometry, "x"), _number(geometry, "y")
        _put(geometry, x=x + u * cos(heading) - v * sin(heading), y=y + u * sin(heading) + v * cos(heading))
        _put(geometry, hdg=_number(geometry, "hdg") + heading)


def turned_round(root: Any, network: RoadNetwork) -> None:
    """Every road drawn from its end to its start: the same roads in the world. For lines, arcs and clothoids."""
    _swap_sides(root)
    for element, (road, told) in enumerate(zip(network.roads, root.iter("road"), strict=True)):
        _turn_line(told, network, element)
        for path in ("elevationProfile/elevation", "lateralProfile/superelevation", "lanes/laneOffset"):
            _turn_records(told.findall(path), "s", road.length)
        for side in ("left", "right"):
            _turn_records(told.findall(f"lateralProfile/crossfall[@side='{side}']"), "s", road.length)
        for shape in told.findall("lateralProfile/shape"):
            _put(shape, s=road.length - _number(shape, "s"))
        _turn_sections(told, road.length)
        _swap_links(told)
    for connection in root.iter("connection"):
        connection.set("contactPoint", {"start": "end", "end": "start"}[connection.get("contactPoint")])


def _turn_line(road: Any, network: RoadNetwork, index: int) -> None:
    plan, length = road.find("planView"), _number(road, "length")
    for geometry in reversed(list(plan)):
        start, run = _number(geometry, "s"), _number(geometry, "length")
        x, y, heading = network.roads[index].elements[list(road.iter("geometry")).index(geometry)].at(run)
        _put(geometry, s=length - start - run, x=x, y=y, hdg=heading + pi)
        shape = geometry[0]
        first, last = -_number(shape, "curvEnd"), -_number(shape, "curvStart")
        if shape.tag == "spiral":
            _put(shape, curvStart=first, curvEnd=last)
        _times(shape, -1.0, "curvature")
    plan[:] = sorted(plan, key=lambda geometry: _number(geometry, "s"))


def _turn_sections(road: Any, length: float) -> None:
    lanes = road.find("lanes")
    sections = lanes.findall("laneSection")
    ends = [*(_number(section, "s") for section in sections[1:]), length]
    for section, end in zip(sections, ends, strict=True):
        own = end - _number(section, "s")
        for lane in section.iter("lane"):
            for name in ("width", "border"):
                _turn_records(lane.findall(name), "sOffset", own)
            for height in lane.findall("height"):
                _put(height, sOffset=own - _number(height, "sOffset"))
            lane[:] = sorted(lane, key=lambda child: _number(child, "sOffset"))
            _swap_links(lane)
        _put(section, s=length - end)
        lanes.remove(section)
    lanes.extend(reversed(sections))


def _swap_links(owner: Any) -> None:
    for link in owner.findall("link"):
        for end in link:
            end.tag = {"predecessor": "successor", "successor": "predecessor"}[end.tag]
            if end.get("contactPoint"):
                end.set("contactPoint", {"start": "end", "end": "start"}[end.get("contactPoint")])


def _swap_sides(root: Any) -> None:
    """+t to the other side: lanes, borders, lane offsets, superelevation, crossfall, shape."""
    names = {"left": "right", "right": "left"}
    for section in root.iter("laneSection"):
        for side in section:
            side.tag = names.get(side.tag, side.tag)
        section[:] = sorted(section, key=lambda side: ("left", "center", "right").index(side.tag))
    for lane in root.iter("lane"):
        _put(lane, id=-int(lane.get("id")))
        for end in lane.findall("link/*"):
            _put(end, id=-int(end.get("id")))
    for link in root.iter("laneLink"):
        _put(link, **{"from": -int(link.get("from")), "to": -int(link.get("to"))})
    for record in root.iter("superelevation", "laneOffset", "border"):
        _times(record, -1.0, *LETTERS)
    for crossfall in root.iter("crossfall"):
        crossfall.set("side", names.get(crossfall.get("side"), crossfall.get("side")))
    for lateral in root.iter("lateralProfile"):
        for s in {_number(shape, "s") for shape in lateral.findall("shape")}:
            _turn_records([shape for shape in lateral.findall("shape") if _number(shape, "s") == s], "t", 0.0)
        lateral[:] = sorted(lateral, key=lambda one: (_number(one, "s"), _number(one, "t")))


def _turn_records(records: Sequence[Any], name: str, length: float) -> None:
    """Cubics of u become cubics of ``length - u``: each about its other end, with odd powers negative."""
    ordered = sorted(records, key=lambda record: _number(record, name))
    if not ordered:
        return
    if name != "t" and _number(ordered[0], name) > 0.0:  # what holds before the first record has to be written now
        first = deepcopy(ordered[0])
        _put(first, **{name: 0.0}, a=_number(first, "a") * (first.tag in ("width", "border")), b=0.0, c=0.0, d=0.0)
        ordered[0].addprevious(first)
        ordered = [first, *ordered]
    lasts = [*(_number(record, name) for record in ordered[1:]), max(length, BEYOND if name == "t" else length)]
    for record, last in zip(ordered, lasts, strict=True):
        step = last - _number(record, name)
        a, b, c, d = (_number(record, letter) for letter in LETTERS)
        value, slope, bend = a + step * (b + step * (c + step * d)), b + step * (2 * c + 3 * step * d), c + 3 * step * d
        _put(record, a=value, b=-slope, c=bend, d=-d, **{name: length - last})


def _number(element: Any, name: str) -> float:
    return float(element.get(name, 0.0))


def _put(element: Any, **values: float) -> None:
    for name, value in values.items():
        element.set(name, repr(value))


def _times(element: Any, factor: float, *names: str) -> None:
    for name in names:
        if element.get(name) is not None:
            _put(element, **{name: factor * _number(element, name)})
