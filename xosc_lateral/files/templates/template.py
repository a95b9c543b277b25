"""A shipped template: its settings, and what they change in the scenario and the road of its name.

The scenario lies as a plain file in the folder ``templates``. Its declared parameters are settings of the same name;
starts, times and speeds that follow from several settings, the road, the side of traffic and the weather are made here.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from xosc_lateral.base.errors import XoscLateralError, did_you_mean
from xosc_lateral.base.plugins import shipped_folder


@dataclass(frozen=True, slots=True)
class Number:
    """A number within a range."""

    name: str
    default: float  # default, low, high: the range includes its borders [unit]
    low: float
    high: float
    unit: str  # ``-`` for none
    what: str  # one line for the user

    def read(self, text: str) -> float:
        """Value of ``--set NAME=text``; `XoscLateralError` when it is not a number or out of range."""
        try:
            value = float(text)
        except ValueError:
            raise XoscLateralError(f"{self.name}: {text!r} is not a number ({self.allowed})") from None
        if not (math.isfinite(value) and self.low <= value <= self.high):
            raise XoscLateralError(f"{self.name}: {text} is out of range ({self.allowed})")
        return value

    @property
    def allowed(self) -> str:
        """Valid range in words."""
        unit = "" if self.unit == "-" else f" {self.unit}"
        return f"{self.low:g} to {self.high:g}{unit}"

    @property
    def shown_default(self) -> str:
        """Default as text."""
        return f"{self.default:g}"

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        known = {"name": self.name, "default": self.default, "what": self.what}
        return known | {"unit": self.unit, "low": self.low, "high": self.high}


@dataclass(frozen=True, slots=True)
class Word:
    """One of a few words, or a value of a type, as a plain scenario declares it."""

    name: str
    default: str
    options: tuple[str, ...] = ()
    what: str = "Parameter of the scenario."  # one line for the user
    kind: str = ""  # OpenSCENARIO's parameter type
    unit: str = "-"

    def read(self, text: str) -> str:
        """Value of ``--set NAME=text``; `XoscLateralError` when it is none of the options, or not of the type."""
        if self.options and text not in self.options:
            raise XoscLateralError(f"{self.name}: {text!r} is none of {self.allowed}")
        if self.kind in _TYPES and not _TYPES[self.kind].fullmatch(text):
            raise XoscLateralError(f"{self.name}: {text!r} is no {self.kind}")
        return text

    @property
    def allowed(self) -> str:
        """What it may be, in words."""
        return ", ".join(self.options) or self.kind

    @property
    def shown_default(self) -> str:
        """Default as text."""
        return self.default

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        known = {"name": self.name, "default": self.default, "what": self.what}
        return known | ({"options": list(self.options)} if self.options else {"type": self.kind})


Parameter = Number | Word

_INTEGER_PATTERNS, _UNSIGNED = r"[+-]?[0-9]+", r"\+?[0-9]+"

_TYPES: dict[str, re.Pattern[str]] = {
    "double": re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?"),
    "integer": re.compile(_INTEGER_PATTERNS),
    "int": re.compile(_INTEGER_PATTERNS),
    "unsignedInt": re.compile(_UNSIGNED),
    "unsignedShort": re.compile(_UNSIGNED),
    "boolean": re.compile("true|false|1|0"),
}
"""OpenSCENARIO's parameter types that not every text is a value of, as XML Schema writes their values."""


class Settings:
    """Values of a template's parameters: the defaults, and what the user chose, as text. Raises `XoscLateralError`."""

    __slots__ = ("_values",)

    def __init__(self, parameters: Iterable[Parameter], chosen: Mapping[str, str]) -> None:
        by_name = {parameter.name: parameter for parameter in parameters}
        for name in chosen:
            if name not in by_name:
                there = f"there are {', '.join(sorted(by_name)) or 'none'}"
                raise XoscLateralError(f"unknown setting {name!r}{did_you_mean(name, by_name)}; {there}")
        self._values: dict[str, float | str] = {
            name: parameter.read(chosen[name]) if name in chosen else parameter.default
            for name, parameter in by_name.items()
        }

    def number(self, name: str) -> float:
        """Value of a `Number`."""
        value = self._values[name]
        assert isinstance(value, float | int), f"{name} is not a number"
        return float(value)

    def text(self, name: str) -> str:
        """Value of a `Word`."""
        value = self._values[name]
        assert isinstance(value, str), f"{name} is no word"
        return value

    def need_more(self, name: str, other: str) -> None:
        """Refuse settings under which nothing would happen: `name` has to be larger than `other`."""
        if self.number(name) <= self.number(other):
            raise XoscLateralError(
                f"{name}: {self.number(name):g} has to be more than {other} ({self.number(other):g})"
            )


# ---- what they change in the scenario and the road ----
COMMON_SETTINGS: tuple[Parameter, ...] = (
    Word("traffic", "right", ("right", "left"), "Side of the road that traffic keeps to."),
    Word("version", "1.2", ("1.2", "1.3"), "Version of OpenSCENARIO that is written."),
    Number("lane_width", 3.75, 3.25, 4.25, "m", "Width of a driving lane."),
    Number("wind_speed", 3.0, 0.0, 30.0, "m/s", "Mean speed of the wind."),
    Number("wind_direction", 90.0, 0.0, 360.0, "deg", "Where it blows to at the road's start: 90 left, 270 right."),
    Number("rain", 0.0, 0.0, 50.0, "mm/h", "Rain; the road is wet from 0.1 on."),
    Number("time_of_day", 10.0, 0.0, 23.99, "h", "Time of day; the sun follows it."),
)
"""Settings of all templates."""

_WET_GRIP = 0.7  # friction on a wet road over that on a dry one [-]
_NOON_LIGHT = 100_000.0  # illuminance under a clear sky at noon [lx]
_NIGHT_LIGHT = 1.0  # [lx]


def motorway(settings: Settings, *alignment: Straight | Bend, reach: float, lanes: int = 2) -> Motorway:
    """A road that goes on straight behind its bends until it is `reach` [m] long, by 100 m at least."""
    rest = Straight(max(100.0, reach - sum(part.length for part in alignment)))
    left_hand = settings.text("traffic") == "left"
    return Motorway((*alignment, rest), lanes, settings.number("lane_width"), left_hand)


@dataclass(frozen=True, slots=True)
class Plot:
    """What settings make of a template, by the names of its vehicles and events."""

    motorway: Motorway
    starts: Mapping[str, float] = field(default_factory=dict)  # vehicle -> s at the start [m]
    speeds: Mapping[str, float] = field(default_factory=dict)  # vehicle or event -> target speed [m/s]
    times: Mapping[str, float] = field(default_factory=dict)  # event -> time before which it does not begin [s]
    distances: Mapping[str, float] = field(default_factory=dict)  # event -> distance below which it begins [m]


@dataclass(frozen=True, slots=True)
class Template:
    """A maneuver-based scenario with its road, parameterised."""

    name: str  # as on the command line, and of the files
    summary: str  # one line
    own_parameters: tuple[Parameter, ...]  # beside the common ones
    plot: Callable[[Settings], Plot]  # settings to a `Plot`

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters, its own ones first."""
        return self.own_parameters + COMMON_SETTINGS

    def files(self, chosen: Mapping[str, str] | None = None) -> dict[str, str]:
        """File name -> text of the scenario and its road by the `chosen` parameters; same settings, same bytes."""
        settings = Settings(self.parameters, chosen or {})
        plot = self.plot(settings)
        scenario = (shipped_folder("templates") / f"{self.name}.xosc").read_text(encoding="utf-8")
        return {
            f"{self.name}.xosc": _filled(ET.fromstring(scenario), plot, settings),
            f"{self.name}.xodr": plot.motorway.to_xml(self.name),
        }


def _filled(root: ET.Element, plot: Plot, settings: Settings) -> str:
    _set(root, "FileHeader", revMinor=settings.text("version").split(".")[1])
    for declared in root.iterfind("ParameterDeclarations/ParameterDeclaration"):
        declared.set("value", f"{settings.number(declared.get('name', '')):g}")
    if plot.motorway.left_hand:
        for tag, attribute in (("LanePosition", "laneId"), ("AbsoluteTargetLane", "value")):
            for lane in root.iter(tag):
                lane.set(attribute, str(-int(lane.get(attribute, ""))))
    _set_surroundings(root, settings)
    vehicle, event = ".//Private[@entityRef='{}']//", ".//Event[@name='{}']//"
    for name, s in plot.starts.items():
        _set(root, vehicle.format(name) + "LanePosition", s=s)
    for name, speed in plot.speeds.items():
        kind = vehicle if root.find(vehicle.format(name)) is not None else event
        _set(root, kind.format(name) + "AbsoluteTargetSpeed", value=speed)
    for name, distance in plot.distances.items():
        _set(root, event.format(name) + "RelativeDistanceCondition", value=distance)
    times = {f"{event.format(name)}StartTrigger//": ("Start", round(time, 3)) for name, time in plot.times.items()}
    for where, (word, time) in {**times, "Storyboard/StopTrigger//": ("Stop", settings.number("duration"))}.items():
        _set(root, f"{where}Condition", name=f"{word}At{time}s")
        _set(root, f"{where}SimulationTimeCondition", value=time)
    return document(root)


def _set(root: ET.Element, path: str, **values: float | str) -> None:
    element = root.find(path)
    assert element is not None, f"the shipped scenario has {path}"
    for name, value in values.items():
        element.set(name, str(value))


def _set_surroundings(root: ET.Element, settings: Settings) -> None:
    """Weather, time of day and grip.

    The sun is that of a midsummer day in middle latitudes: up at 5 h, at noon 60 degrees high, down at 19 h (rounded).
    Azimuth as the standard counts it: 0 north, pi/2 east, pi south; 15 degrees an hour. The wind's direction is where
    it blows to, from world x counter-clockwise; the templates' roads begin towards x.
    """
    rain, hour = settings.number("rain"), settings.number("time_of_day")
    wet, minutes = rain >= 0.1, round(60.0 * hour)
    _set(root, ".//TimeOfDay", dateTime=f"2024-06-21T{minutes // 60:02}:{minutes % 60:02}:00")
    _set(root, ".//Weather", fractionalCloudCover="eightOktas" if wet else "twoOktas")
    height = math.radians(60.0) * math.sin(math.pi * (hour - 5.0) / 14.0)
    light = _NIGHT_LIGHT + (0.2 if wet else 1.0) * _NOON_LIGHT * max(0.0, math.sin(height))
    azimuth = (math.pi + math.radians(15.0) * (hour - 12.0)) % (2.0 * math.pi)
    _set(root, ".//Sun", azimuth=round(azimuth, 6), illuminance=round(light, 1), elevation=round(height, 6))
    _set(root, ".//Fog", visualRange=5000 if wet else 20000)
    kind = "rain" if rain > 0.0 else "dry"
    _set(root, ".//Precipitation", precipitationType=kind, precipitationIntensity=rain)
    direction = math.radians(settings.number("wind_direction")) % (2.0 * math.pi)
    _set(root, ".//Wind", direction=round(direction, 6), speed=settings.number("wind_speed"))
    _set(root, ".//RoadCondition", frictionScaleFactor=_WET_GRIP if wet else 1.0)


FIXED_DATE = datetime(2024, 1, 1)  # written where the formats ask for a date: the same settings give the same bytes


def document(root: ET.Element) -> str:
    """An element tree as an indented document."""
    ET.indent(root, "  ")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


ROAD = 1  # id of the only road
SHOULDER = 3.0  # hard shoulder [m]; RAA 2008 (guidelines for motorways), cross-section RQ 31
MEDIAN = 2.0  # paved margin beside the fast lane, and the grass beyond the shoulder [m]
CROSSFALL = 0.025  # least crossfall for drainage, towards the outer edge [-]; RAA 2008


@dataclass(frozen=True, slots=True)
class Straight:
    """A straight."""

    length: float  # [m]


@dataclass(frozen=True, slots=True)
class Bend:
    """An arc between two clothoids of equal length."""

    radius: float  # of the reference line; positive: a left bend [m]
    arc: float  # arc, clothoid: lengths [m]
    clothoid: float

    @property
    def length(self) -> float:
        """Of all three. [m]"""
        return self.arc + 2.0 * self.clothoid


@dataclass(frozen=True, slots=True)
class Motorway:
    """One carriageway."""

    alignment: tuple[Straight | Bend, ...]  # from s = 0
    lanes: int  # driving lanes
    lane_width: float  # [m]
    left_hand: bool = False  # left-hand traffic
    grade: float = 0.0  # rise over run, the same everywhere [-]

    @property
    def length(self) -> float:
        """[m]"""
        return sum(part.length for part in self.alignment)

    def to_xml(self, name: str) -> str:
        """The road as an OpenDRIVE document, the same bytes each time."""
        from scenariogeneration import xodr

        def lane(kind: Any, width: float, mark: Any = None) -> Any:
            made = xodr.Lane(kind, a=width)
            made.add_roadmark(xodr.RoadMark(xodr.RoadMarkType.none) if mark is None else mark)
            return made

        plan = xodr.PlanView(0, 0, 0)
        for part in self.alignment:
            if isinstance(part, Straight):
                plan.add_geometry(xodr.Line(part.length))
                continue
            curvature = 1.0 / part.radius
            plan.add_geometry(xodr.Spiral(0.0, curvature, part.clothoid))
            plan.add_geometry(xodr.Arc(curvature, part.arc))
            plan.add_geometry(xodr.Spiral(curvature, 0.0, part.clothoid))
        solid = xodr.RoadMark(xodr.RoadMarkType.solid, width=0.3)
        broken = xodr.RoadMark(xodr.RoadMarkType.broken, width=0.15, length=6.0, space=12.0)
        centre = xodr.Lane(xodr.LaneType.none)
        centre.add_roadmark(solid)
        section = xodr.LaneSection(0, centre)
        add_outside, add_inside = section.add_right_lane, section.add_left_lane
        if self.left_hand:
            add_outside, add_inside = add_inside, add_outside
        for number in range(self.lanes):
            mark = solid if number == self.lanes - 1 else broken
            add_outside(lane(xodr.LaneType.driving, self.lane_width, mark))
        add_outside(lane(xodr.LaneType.shoulder, SHOULDER))
        add_outside(lane(xodr.LaneType.border, MEDIAN))
        add_inside(lane(xodr.LaneType.median, MEDIAN))
        lanes = xodr.Lanes()
        lanes.add_lanesection(section)
        rule = xodr.TrafficRule.LHT if self.left_hand else xodr.TrafficRule.RHT
        road = xodr.Road(ROAD, plan, lanes, name=name, rule=rule)
        road.add_type(xodr.RoadType.motorway, 0)
        road.add_elevation(0, 0, self.grade, 0, 0)
        for s, start, slope in self._crossfall():
            road.add_superelevation(s, start, slope, 0, 0)
        file = xodr.OpenDrive(name)
        file.add_road(road)
        file.adjust_roads_and_lanes()
        root = file.get_element()
        header = root.find("header")
        assert header is not None, "scenariogeneration writes a header"
        header.set("date", FIXED_DATE.isoformat())
        return document(root)

    def _crossfall(self) -> list[tuple[float, float, float]]:
        """Superelevation as (s, angle, change per metre), positive to lower the right side: in bends to the inside."""
        outwards = -CROSSFALL if self.left_hand else CROSSFALL
        profile, s = {0.0: (outwards, 0.0)}, 0.0
        for part in self.alignment:
            inwards = outwards
            if isinstance(part, Bend):
                inwards = -CROSSFALL if part.radius > 0.0 else CROSSFALL
            if isinstance(part, Bend) and inwards != outwards:
                turn = (inwards - outwards) / part.clothoid
                profile[s] = (outwards, turn)
                profile[s + part.clothoid] = (inwards, 0.0)
                profile[s + part.clothoid + part.arc] = (inwards, -turn)
                profile[s + part.length] = (outwards, 0.0)
            s += part.length
        return [(s, start, slope) for s, (start, slope) in profile.items()]
