"""What older versions of the standard call differently, and what they ask for that newer ones do not.

`RENAME` goes before what is new is taken out, `COMPLETE` after it. Values that are filled in say what their absence
meant, or, for weather that a scene has to have in 1.0, a clear noon, which is noted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from math import radians

from lxml import etree

from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.formats.openscenario.write.losses import Losses, remove, tidy

VALUES: Mapping[tuple[str, str], str] = {
    ("rule", "greaterOrEqual"): "greaterThan",
    ("rule", "lessOrEqual"): "lessThan",
    ("priority", "override"): "overwrite",
    ("parameterType", "int"): "integer",
    ("relativeDistanceType", "euclidianDistance"): "cartesianDistance",
    ("vehicleCategory", "motorcycle"): "motorbike",
    ("vehicleCategory", "heavyTruck"): "truck",
    ("vehicleCategory", "semitractor"): "truck",
    ("role", "fireBrigade"): "fire",
    ("role", "roadsideAssistance"): "roadAssistance",
}
"""(attribute, value) -> the same in the version before."""

FALLBACK: Mapping[str, str] = {"vehicleCategory": "car", "category": "car", "role": "none"}
"""Attribute -> value for the others."""

_OKTAS = {"zero": "free", "one": "free", "two": "free", "three": "cloudy", "four": "cloudy", "five": "cloudy"}
_CLOUDS = {f"{number}Oktas": state for number, state in _OKTAS.items()}
_CLEAR = {
    "TimeOfDay": {"animation": "false", "dateTime": "2020-06-21T12:00:00"},
    "RoadCondition": {"frictionScaleFactor": "1"},
    "Sun": {"intensity": "100000", "azimuth": "0", "elevation": "1.05"},
    "Fog": {"visualRange": "100000"},
    "Precipitation": {"precipitationType": "dry", "intensity": "0"},
}
"""A clear summer noon: direct sunlight of about 100,000 lx (standard, class Sun)."""
_HEAVY_RAIN = 50.0
"""Violent rain: the full intensity of version 1.0. [mm/h] (WMO-No. 8, 2018, table 14.A)"""
_BOTH = {
    "AppearanceAction": ("LightStateAction", "AnimationAction"),
    "LightType": ("VehicleLight", "UserDefinedLight"),
    "ComponentAnimation": ("VehicleComponent", "UserDefinedComponent"),
}
"""Sequences in the schema of 1.2 that were meant as, and became, choices."""
_PEDALS = ("Throttle", "Brake", "Clutch", "ParkingBrake", "SteeringWheel")


def _found(root: etree._Element, *tags: str) -> list[etree._Element]:
    return [item for item in root.iter() if isinstance(item.tag, str) and local_name(item) in tags]


def _children(item: etree._Element) -> Iterator[etree._Element]:
    return (child for child in item if isinstance(child.tag, str))


def _child(item: etree._Element, tag: str) -> etree._Element | None:
    return next((child for child in _children(item) if local_name(child) == tag), None)


def _number(item: etree._Element, name: str) -> float | None:
    """A number, where one is written."""
    try:
        return float(item.get(name) or "")
    except ValueError:
        return None


def _move(item: etree._Element, name: str, former: str) -> None:
    """An attribute by its former name, unless that is there, too."""
    value = _taken(item, name)
    if value is not None and former not in item.attrib:
        item.set(former, value)


def _taken(item: etree._Element, name: str) -> str | None:
    """An attribute's value, taken off."""
    value = item.get(name)
    if value is not None:
        del item.attrib[name]
    return value


def overrides_nothing(action: etree._Element) -> bool:
    """An override of controller values with none active: what 1.0 asks for beside an assignment."""
    return local_name(action) == "OverrideControllerValueAction" and all(
        (child.get("active") or "").lower() in ("false", "0") for child in _children(action)
    )


def _rename_3(losses: Losses) -> None:
    for item in _found(losses.root, "TrafficSignalGroupState"):
        item.tag = "TrafficeSignalGroupState"
    for vehicle in _found(losses.root, "Vehicle"):
        trailer = _child(vehicle, "Trailer")
        inner = None if trailer is None else _child(trailer, "Trailer")
        holder = vehicle.getparent()
        if inner is not None and holder is not None and local_name(holder) == "ScenarioObject":
            inner.tag = "ScenarioObject"
            inner.set("name", f"{holder.get('name')}+")  # as the reader and the reference player call it
            owner = holder.getparent()
            assert owner is not None
            build.insert_indented(owner, owner.index(holder) + 1, inner)
    for assign in _found(losses.root, "AssignControllerAction"):
        controller = _child(assign, "ObjectController")
        if controller is not None:
            assign[:] = list(_children(controller))


def complete_choices(losses: Losses) -> None:
    """Take out what is valid in no version but those that came after 1.2, whose schema asks for two at once."""
    for item in _found(losses.root, *_BOTH):
        if len({local_name(child) for child in _children(item)}) < 2:
            both = " and ".join(_BOTH[local_name(item)])
            losses.action(item, f"the schema of {losses.target} asks for {both} at once")


def _complete_3(losses: Losses) -> None:
    for item in _found(losses.root, "TrafficSourceAction", "TrafficSwarmAction"):
        if _child(item, "TrafficDefinition") is None:
            losses.action(item, f"{losses.target} asks for a TrafficDefinition")
    for item in _found(losses.root, "Vehicle", "Pedestrian", "MiscObject", "Controller"):
        if _child(item, "Properties") is None:
            build.insert_indented(item, len(item), etree.Element("Properties"))
    for axles in _found(losses.root, "Axles"):
        rear = _child(axles, "RearAxle")
        if rear is not None and _child(axles, "FrontAxle") is None:
            front = etree.Element("FrontAxle", {str(name): str(value) for name, value in rear.attrib.items()})
            front.set("maxSteering", "0")
            build.insert_indented(axles, 0, front)
    for storyboard in _found(losses.root, "Storyboard"):
        if _child(storyboard, "StopTrigger") is None:
            build.insert_indented(storyboard, len(storyboard), etree.Element("StopTrigger"))
    for act in _found(losses.root, "Act"):
        if _child(act, "StartTrigger") is None:
            _start_at_once(act, "ManeuverGroup")


def _start_at_once(owner: etree._Element, after: str) -> None:
    """A trigger that is true from the start, where it was left out."""
    holder = etree.Element("holder")
    trigger = build.time_trigger(holder, "StartTrigger", 0.0, (1, 0))
    last = max(owner.index(child) for child in _children(owner) if local_name(child) == after)
    build.insert_indented(owner, last + 1, trigger)


def _rename_2(losses: Losses) -> None:
    for sun in _found(losses.root, "Sun"):
        _move(sun, "illuminance", "intensity")
    for weather in _found(losses.root, "Weather"):
        oktas = _taken(weather, "fractionalCloudCover")
        if oktas is not None and "cloudState" not in weather.attrib:
            weather.set("cloudState", _CLOUDS.get(oktas, "overcast"))
    for position in _found(losses.root, "GeoPosition"):
        _rename_geo(position)
    for pedal in _found(losses.root, "Brake", "ParkingBrake"):
        percent = _child(pedal, "BrakePercent")
        if percent is not None:
            pedal.set("value", percent.get("value") or "0")
            remove(percent)
    for gear in _found(losses.root, "Gear"):
        manual = _child(gear, "ManualGear")
        if manual is not None:
            gear.set("number", manual.get("number") or "0")
            remove(manual)


def _rename_geo(position: etree._Element) -> None:
    """In radians, and with a height."""
    for name in ("latitude", "longitude"):
        degrees = _number(position, f"{name}Deg")
        if degrees is not None:
            position.set(name, build.decimal(radians(degrees), 12))
            del position.attrib[f"{name}Deg"]
    _move(position, "altitude", "height")


def _complete_2(losses: Losses) -> None:
    for item in _found(losses.root, "ScenarioObject"):
        controllers = [child for child in _children(item) if local_name(child) == "ObjectController"]
        for controller in controllers[1:]:
            losses.note(f"'{item.get('name')}': one ObjectController of {len(controllers)} kept ({losses.target})")
            remove(controller)
    for storyboard in _found(losses.root, "Storyboard"):
        if _child(storyboard, "Story") is None:
            story = build.story("nothing")
            act = build.sub(story, "Act", name="nothing")
            build.maneuver_group(act, "nothing", None)
            build.time_trigger(act, "StartTrigger", 0.0, (1, 0))
            init = _child(storyboard, "Init")
            build.insert_indented(storyboard, 0 if init is None else storyboard.index(init) + 1, story)


def _rename_1(losses: Losses) -> None:
    _unwrap_trajectories(losses)
    for clothoid in _found(losses.root, "Clothoid"):
        _move(clothoid, "curvaturePrime", "curvatureDot")
    _rename_rain(losses)
    for item in _found(losses.root, "Pedestrian"):
        _move(item, "model3d", "model")
        item.set("model", item.get("model") or item.get("name") or "")
    for position in _found(losses.root, "RelativeLanePosition"):
        _move(position, "dsLane", "ds")
    for condition in _found(losses.root, "TimeHeadwayCondition", "DistanceCondition", "TimeToCollisionCondition"):
        _along_route(losses, condition)
    for item in _found(losses.root, "ExternalObjectReference"):
        losses.refuse(item, "ExternalObjectReference", hint="")
    for action in _found(losses.root, "ControllerAction"):
        _whole_controller_action(action)


def _rename_rain(losses: Losses) -> None:
    """An amount in mm/h was a share of heavy rain."""
    for rain in _found(losses.root, "Precipitation"):
        amount = _number(rain, "precipitationIntensity")
        if amount is not None:
            rain.set("intensity", build.decimal(min(amount / _HEAVY_RAIN, 1.0), 4))
            del rain.attrib["precipitationIntensity"]


def _unwrap_trajectories(losses: Losses) -> None:
    """Trajectories lay right in their action before there was a reference around them."""
    for reference in _found(losses.root, "TrajectoryRef"):
        follow = reference.getparent()
        if follow is not None and local_name(follow) == "FollowTrajectoryAction":
            for child in _children(reference):
                follow.insert(follow.index(reference), child)
            remove(reference)


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


def _whole_controller_action(action: etree._Element) -> None:
    """Version 1.0 wants an assignment and an override in one; activation stood alone."""
    activate, holder = _child(action, "ActivateControllerAction"), action.getparent()
    assert holder is not None
    if activate is not None:
        holder.append(activate)
        holder.remove(action)
        return
    override = _child(action, "OverrideControllerValueAction")
    if override is None:
        override = build.sub(action, "OverrideControllerValueAction")
    for pedal in _PEDALS:
        if _child(override, pedal) is None:
            build.sub(override, pedal, value="0", active="false")
    if _child(override, "Gear") is None:
        build.sub(override, "Gear", number="0", active="false")


def _complete_1(losses: Losses) -> None:
    for item in _found(losses.root, "FileHeader", "ParameterDeclaration"):
        tidy(item)
    for action in _found(losses.root, "ControllerAction"):
        if _child(action, "AssignControllerAction") is None:
            losses.action(action, f"{losses.target} overrides values only of a controller that it assigns")
    for vertex in _found(losses.root, "Vertex"):
        vertex.set("time", vertex.get("time") or "0")
    for clothoid in _found(losses.root, "Clothoid"):
        clothoid.set("curvatureDot", clothoid.get("curvatureDot") or "0")
    for position in _found(losses.root, "RelativeLanePosition"):
        position.set("ds", position.get("ds") or "0")
    for event in _found(losses.root, "Event"):
        if _child(event, "StartTrigger") is None:
            _start_at_once(event, "Action")
    _complete_environments(losses)


def _complete_environments(losses: Losses) -> None:
    """What version 1.0 wants to be stated of the weather."""
    for environment in _found(losses.root, "Environment"):
        _fill(losses, environment, ("TimeOfDay", "Weather", "RoadCondition"))
    for weather in _found(losses.root, "Weather"):
        _fill(losses, weather, ("Sun", "Fog", "Precipitation"))
        weather.set("cloudState", weather.get("cloudState") or "free")
    for sun in _found(losses.root, "Sun"):
        sun.set("intensity", sun.get("intensity") or _CLEAR["Sun"]["intensity"])
    for rain in _found(losses.root, "Precipitation"):
        rain.set("intensity", rain.get("intensity") or "0")


def _fill(losses: Losses, owner: etree._Element, tags: tuple[str, ...]) -> None:
    for tag in tags:
        if _child(owner, tag) is None:
            build.insert_indented(owner, len(owner), etree.Element(tag, _CLEAR.get(tag, {})))
            if tag != "Weather":
                losses.note(f"{tag}: that of a clear noon ({losses.target} asks for one)")


Step = Callable[[Losses], None]
RENAME: Mapping[int, Step] = {1: _rename_1, 2: _rename_2, 3: _rename_3}
COMPLETE: Mapping[int, Step] = {1: _complete_1, 2: _complete_2, 3: _complete_3}
