"""Write a scenario in another version of the standard: what the other one calls differently, asks for, or lacks.

Every version since 1.0 takes what the ones before it wrote, but for a few choices that 1.3 made strict; so going up is
a matter of those. Going down, names are put back, what was made optional is filled in with what it meant, and
the rest of what the version before lacks is taken out and named. What each version lacks are facts of the schemas: they
stand in `resources/openscenario_versions.toml`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from math import radians
from pathlib import Path
from typing import Any

from lxml import etree

from xosc_lateral.files.openscenario.element import child_of, children_of, elements, local_name, parent_of
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.build import Version
from xosc_lateral.files.openscenario.write.draft import Losses, remove, tidy

_VERSIONS_FILE = Path(__file__).resolve().parents[3] / "resources" / "openscenario_versions.toml"

NEWEST_MINOR = 4

_STRICT_SINCE_MINOR = 3
"""From this version on, choices hold exactly one element, and an orientation without a type is relative."""


@cache
def version_facts() -> Mapping[str, Any]:
    """What each version has that the one before lacks, by ``version_1_MINOR``, and former words for values."""
    import tomllib

    return tomllib.loads(_VERSIONS_FILE.read_text(encoding="utf-8"))


def additions(minor: int, kind: str) -> Mapping[str, Any]:
    """A table of what a version has that the one before lacks: elements, attributes, values, renamed, required."""
    return version_facts()[f"version_1_{minor}"].get(kind, {})  # type: ignore[no-any-return]


def fit_version(losses: Losses, source: Version, version: Version) -> None:
    """Make a scenario one of another version; `FormatError` for a condition or a reactive maneuver that it lacks."""
    was_strict, is_strict = (one[1] >= _STRICT_SINCE_MINOR for one in (source, version))
    for item in elements(losses.root, "Orientation") if was_strict != is_strict else ():
        item.set("type", item.get("type") or ("relative" if was_strict else "absolute"))  # what it meant without
    if is_strict:
        _be_strict(losses)
    for minor in range(NEWEST_MINOR, version[1], -1):
        _take_back(losses, minor)
    if version[1] == 2:
        complete_choices(losses)
    header = child_of(losses.root, "FileHeader")
    if header is not None:
        header.set("revMajor", str(version[0]))
        header.set("revMinor", str(version[1]))


def newer_than(element: etree._Element, version: Version) -> str | None:
    """Name of something inside an element that a version does not know; None if it knows everything."""
    for minor in range(NEWEST_MINOR, version[1], -1):
        news = additions(minor, "elements")
        for item in elements(element):
            parent, tag = item.getparent(), local_name(item)
            if parent is not None and tag in news.get(local_name(parent), ()) and tag != "TrajectoryRef":
                return tag
    return None


def _take_back(losses: Losses, minor: int) -> None:
    """From 1.`minor` to the version before it."""
    rename(losses, minor, additions(minor, "renamed"))
    new_elements, new_attributes = additions(minor, "elements"), additions(minor, "attributes")
    new_values = additions(minor, "values")
    for item in elements(losses.root):
        parent, tag = item.getparent(), local_name(item)
        if item is not losses.root and not losses.has(item):
            continue
        if parent is not None and tag in new_elements.get(local_name(parent), ()):
            losses.element(item)
            continue
        for name in new_attributes.get(tag, ()):
            if name in item.attrib:
                losses.attribute(item, name)
        for name in list(map(str, item.attrib)):
            if item.get(name) in new_values.get(f"{tag}/{name}", ()):
                _write_older_value(losses, item, name)
    complete(losses, minor, additions(minor, "required"))


def _write_older_value(losses: Losses, item: etree._Element, name: str) -> None:
    value, facts = item.get(name) or "", version_facts()
    former = facts["former"].get(name, {}).get(value)
    if former is None and name in facts["fallback"]:
        former = facts["fallback"][name]
        losses.note(f"{local_name(item)}/@{name} '{value}': written as '{former}' ({losses.target} has none)")
    if former is not None:
        item.set(name, former)
    elif local_name(item) == "ByType" and name == "objectType":
        losses.element(item)
    elif any(local_name(owner) == "Condition" for owner in item.iterancestors()):
        losses.refuse(item, f"{name} '{value}'")
    else:
        losses.action(item, f"{losses.target} has no {name} '{value}'")


def _be_strict(losses: Losses) -> None:
    """One action in an action: a controller assigned and its values overridden are two; an empty one is none."""
    for item in elements(losses.root, "ControllerAction"):
        _split_controller_action(item)
    for item in elements(losses.root, "Action", "PrivateAction"):
        if not children_of(item):
            losses.action(item, "it is empty")
    for item in elements(losses.root, "TrafficeSignalGroupState"):
        item.tag = "TrafficSignalGroupState"


def _split_controller_action(item: etree._Element) -> None:
    parts = children_of(item)
    if not parts:
        remove(item)
        return
    inactive = [part for part in parts if len(parts) > 1 and overrides_nothing(part)]
    for part in inactive:
        remove(part)
    for part in [part for part in parts if part not in inactive][1:]:
        # Into a controller action of its own, right after the one that it was in.
        item.remove(part)
        after = parent_of(item)
        another = etree.Element("PrivateAction")
        holder = another
        if local_name(parent_of(after)) == "Action":
            after = parent_of(after)
            another = etree.Element("Action", {"name": f"{after.get('name')} {local_name(part)}"})
            holder = build.sub(another, "PrivateAction")
        build.sub(holder, "ControllerAction").append(part)
        build.insert_after(after, another)


# ---- what older versions call differently, and what they ask for that newer ones do not ----
# `rename` goes before what is new is taken out, `complete` after it. Values that are filled in say what their absence
# meant, or, for weather that a scene has to have in 1.0, a clear noon, which is noted.
_OKTAS = {"zero": "free", "one": "free", "two": "free", "three": "cloudy", "four": "cloudy", "five": "cloudy"}
_CLEAR_NOON = {
    "TimeOfDay": {"animation": "false", "dateTime": "2020-06-21T12:00:00"},
    "RoadCondition": {"frictionScaleFactor": "1"},
    "Sun": {"intensity": "100000", "azimuth": "0", "elevation": "1.05"},
    "Fog": {"visualRange": "100000"},
    "Precipitation": {"precipitationType": "dry", "intensity": "0"},
}
"""A clear summer noon: direct sunlight of about 100,000 lx (standard, class Sun)."""
_HEAVY_RAIN = 50.0
"""Violent rain: the full intensity of version 1.0. [mm/h] (WMO-No. 8, 2018, table 14.A)"""
_SEQUENCES_MEANT_AS_CHOICES = {
    "AppearanceAction": ("LightStateAction", "AnimationAction"),
    "LightType": ("VehicleLight", "UserDefinedLight"),
    "ComponentAnimation": ("VehicleComponent", "UserDefinedComponent"),
}
"""Sequences in the schema of 1.2 that were meant as, and became, choices."""
PEDALS = ("Throttle", "Brake", "Clutch", "ParkingBrake", "SteeringWheel")


def rename(losses: Losses, minor: int, attributes: Mapping[str, str]) -> None:
    """Put back what version 1.`minor` calls otherwise than the one before, unless that is there, too."""
    if minor in _RENAMED:
        _RENAMED[minor](losses)
    for path, former in attributes.items():
        tag, name = path.split("/")
        for item in elements(losses.root, tag):
            value = _taken(item, name)
            if value is not None and former not in item.attrib:
                item.set(former, value)


def complete(losses: Losses, minor: int, attributes: Mapping[str, str]) -> None:
    """Fill in what the version before 1.`minor` asks for, or take out what can't be without it."""
    if minor in _COMPLETED:
        _COMPLETED[minor](losses)
    for path, value in attributes.items():
        tag, name = path.split("/")
        for item in elements(losses.root, tag):
            item.set(name, item.get(name) or value)


def complete_choices(losses: Losses) -> None:
    """Take out what is valid in no version but those that came after 1.2, whose schema asks for two at once."""
    for item in elements(losses.root, *_SEQUENCES_MEANT_AS_CHOICES):
        if len({local_name(child) for child in children_of(item)}) < 2:
            both = " and ".join(_SEQUENCES_MEANT_AS_CHOICES[local_name(item)])
            losses.action(item, f"the schema of {losses.target} asks for {both} at once")


def overrides_nothing(action: etree._Element) -> bool:
    """An override of controller values with none active: what 1.0 asks for beside an assignment."""
    return local_name(action) == "OverrideControllerValueAction" and all(
        (child.get("active") or "").lower() in ("false", "0") for child in children_of(action)
    )


def add_missing_overrides(action: etree._Element) -> None:
    """An override of controller values, none of them active: version 1.0 wants all."""
    override = child_of(action, "OverrideControllerValueAction")
    if override is None:
        override = build.sub(action, "OverrideControllerValueAction")
    for tag, value in (*((pedal, "value") for pedal in PEDALS), ("Gear", "number")):
        if child_of(override, tag) is None:
            build.sub(override, tag, **{value: "0", "active": "false"})


def _rename_3(losses: Losses) -> None:
    for item in elements(losses.root, "TrafficSignalGroupState"):
        item.tag = "TrafficeSignalGroupState"
    for vehicle in elements(losses.root, "Vehicle"):
        inner, holder = vehicle.find("{*}Trailer/{*}Trailer"), parent_of(vehicle)
        if inner is not None and local_name(holder) == "ScenarioObject":
            inner.tag = "ScenarioObject"
            inner.set("name", f"{holder.get('name')}+")  # as the reader and the reference player call it
            build.insert_after(holder, inner)
    for controller in losses.root.findall(".//{*}AssignControllerAction/{*}ObjectController"):
        parent_of(controller)[:] = children_of(controller)


def _complete_3(losses: Losses) -> None:
    for item in elements(losses.root, "TrafficSourceAction", "TrafficSwarmAction"):
        if child_of(item, "TrafficDefinition") is None:
            losses.action(item, f"{losses.target} asks for a TrafficDefinition")
    for item in elements(losses.root, "Vehicle", "Pedestrian", "MiscObject", "Controller"):
        if child_of(item, "Properties") is None:
            build.insert_indented(item, len(item), etree.Element("Properties"))
    for axles in elements(losses.root, "Axles"):
        rear = child_of(axles, "RearAxle")
        if rear is not None and child_of(axles, "FrontAxle") is None:
            front = etree.Element("FrontAxle", {str(name): str(value) for name, value in rear.attrib.items()})
            front.set("maxSteering", "0")
            build.insert_indented(axles, 0, front)
    for storyboard in elements(losses.root, "Storyboard"):
        if child_of(storyboard, "StopTrigger") is None:
            build.insert_indented(storyboard, len(storyboard), etree.Element("StopTrigger"))
    _start_at_once(losses, "Act", "ManeuverGroup")


def _start_at_once(losses: Losses, tag: str, after: str) -> None:
    """A trigger that is true from the start, where it was left out."""
    for owner in elements(losses.root, tag):
        if child_of(owner, "StartTrigger") is None:
            trigger = build.time_trigger(etree.Element("holder"), "StartTrigger", 0.0, (1, 0))
            build.insert_after(owner.findall(f"{{*}}{after}")[-1], trigger)


def _rename_2(losses: Losses) -> None:
    for weather in elements(losses.root, "Weather"):
        oktas = _taken(weather, "fractionalCloudCover")
        if oktas is not None and "cloudState" not in weather.attrib:
            weather.set("cloudState", _OKTAS.get(oktas.removesuffix("Oktas"), "overcast"))
    for position in elements(losses.root, "GeoPosition"):
        for name in ("latitude", "longitude"):
            degrees = _number(position, f"{name}Deg")
            if degrees is not None:
                position.set(name, build.decimal(radians(degrees), 12))
                del position.attrib[f"{name}Deg"]
    for item in elements(losses.root, "BrakePercent", "ManualGear"):
        name = "value" if local_name(item) == "BrakePercent" else "number"
        parent_of(item).set(name, item.get(name) or "0")
        remove(item)


def _taken(item: etree._Element, name: str) -> str | None:
    """An attribute's value, taken off."""
    value = item.get(name)
    if value is not None:
        del item.attrib[name]
    return value


def _number(item: etree._Element, name: str) -> float | None:
    """A number, where one is written."""
    try:
        return float(item.get(name) or "")
    except ValueError:
        return None


def _complete_2(losses: Losses) -> None:
    for item in elements(losses.root, "ScenarioObject"):
        controllers = item.findall("{*}ObjectController")
        for controller in controllers[1:]:
            losses.note(f"'{item.get('name')}': one ObjectController of {len(controllers)} kept ({losses.target})")
            remove(controller)
    for storyboard in elements(losses.root, "Storyboard"):
        if child_of(storyboard, "Story") is None:
            story = build.story("nothing")
            act = build.sub(story, "Act", name="nothing")
            build.maneuver_group(act, "nothing", None)
            build.time_trigger(act, "StartTrigger", 0.0, (1, 0))
            init = child_of(storyboard, "Init")
            build.insert_indented(storyboard, 0 if init is None else storyboard.index(init) + 1, story)


def _rename_1(losses: Losses) -> None:
    # Trajectories lay right in their action before there was a reference around them.
    for reference in losses.root.findall(".//{*}FollowTrajectoryAction/{*}TrajectoryRef"):
        for child in children_of(reference):
            reference.addprevious(child)
        remove(reference)
    for rain in elements(losses.root, "Precipitation"):
        amount = _number(rain, "precipitationIntensity")
        if amount is not None:  # it was a share of heavy rain
            rain.set("intensity", build.decimal(min(amount / _HEAVY_RAIN, 1.0), 4))
            del rain.attrib["precipitationIntensity"]
    for item in elements(losses.root, "Pedestrian"):
        model = _taken(item, "model3d") or ""
        item.set("model", item.get("model", model) or item.get("name") or "")
    for condition in elements(losses.root, "TimeHeadwayCondition", "DistanceCondition", "TimeToCollisionCondition"):
        _along_route(losses, condition)
    for item in elements(losses.root, "ExternalObjectReference"):
        losses.refuse(item, "ExternalObjectReference", hint="")
    for action in elements(losses.root, "ControllerAction"):
        # Version 1.0 wants an assignment and an override in one; activation stood alone.
        activate = child_of(action, "ActivateControllerAction")
        if activate is None:
            add_missing_overrides(action)
        else:
            parent_of(action).append(activate)
            parent_of(action).remove(action)


def _along_route(losses: Losses, condition: etree._Element) -> None:
    """What version 1.0 can say of how a distance is measured: along the route, or straight."""
    system = _taken(condition, "coordinateSystem") or "entity"
    kind = _taken(condition, "relativeDistanceType") or "euclidianDistance"
    if "alongRoute" in condition.attrib:
        return
    along = system in ("road", "lane") and kind == "longitudinal"
    if not along and kind != "euclidianDistance":
        losses.refuse(condition, f"{local_name(condition)} with relativeDistanceType '{kind}' in '{system}'")
    condition.set("alongRoute", "true" if along else "false")


def _complete_1(losses: Losses) -> None:
    for item in elements(losses.root, "FileHeader", "ParameterDeclaration"):
        tidy(item)
    for action in elements(losses.root, "ControllerAction"):
        if child_of(action, "AssignControllerAction") is None:
            losses.action(action, f"{losses.target} overrides values only of a controller that it assigns")
    _start_at_once(losses, "Event", "Action")
    for environment in elements(losses.root, "Environment"):
        _fill(losses, environment, ("TimeOfDay", "Weather", "RoadCondition"))
    for weather in elements(losses.root, "Weather"):
        _fill(losses, weather, ("Sun", "Fog", "Precipitation"))


def _fill(losses: Losses, owner: etree._Element, tags: Sequence[str]) -> None:
    """What version 1.0 wants to be stated of the weather."""
    for tag in tags:
        if child_of(owner, tag) is None:
            build.insert_indented(owner, len(owner), etree.Element(tag, _CLEAR_NOON.get(tag, {})))
            if tag != "Weather":
                losses.note(f"{tag}: that of a clear noon ({losses.target} asks for one)")


_RENAMED = {1: _rename_1, 2: _rename_2, 3: _rename_3}
_COMPLETED = {1: _complete_1, 2: _complete_2, 3: _complete_3}
