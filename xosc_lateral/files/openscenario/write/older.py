"""What older versions of the standard call differently, and what they ask for that newer ones do not.

`rename` goes before what is new is taken out, `complete` after it. Values that are filled in say what their absence
meant, or, for weather that a scene has to have in 1.0, a clear noon, which is noted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import radians

from lxml import etree

from xosc_lateral.files.openscenario.element import child_of, children_of, elements, local_name, parent_of
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.losses import Losses, remove, tidy

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
