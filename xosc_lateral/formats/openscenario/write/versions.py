"""Write a scenario in another version of the standard: what the other one calls differently, asks for, or lacks.

Every version since 1.0 takes what the ones before it wrote, but for a few choices that 1.3 made strict; so going up is
a matter of those. Going down, names are put back, what was made optional is filled in with what it meant, and the rest
of what the version before lacks is taken out and named.

What each version has that the one before lacks are facts of the schemas 1.0.0 to 1.4.0: elements by the tag above them,
attributes by the tag that carries them; what lies inside a new element is not listed. `tests/formats/test_versions.py`
compares the table with the schemas.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lxml import etree

from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.formats.openscenario.write import build, older
from xosc_lateral.formats.openscenario.write.build import Version
from xosc_lateral.formats.openscenario.write.losses import Losses, remove

ELEMENTS: Mapping[int, Mapping[str, tuple[str, ...]]] = {
    1: {
        "AbsoluteSpeed": ("TargetDistanceSteadyState", "TargetTimeSteadyState"),
        "ControllerAction": ("ActivateControllerAction",),
        "FileHeader": ("License",),
        "FollowTrajectoryAction": ("TrajectoryRef",),
        "OpenSCENARIO": ("ParameterValueDistribution",),
        "ParameterDeclaration": ("ConstraintGroup",),
        "Position": ("GeoPosition", "TrajectoryPosition"),
        "RelativeSpeedToMaster": ("TargetDistanceSteadyState", "TargetTimeSteadyState"),
        "RoadNetwork": ("UsedArea",),
        "ScenarioObject": ("ExternalObjectReference",),
        "TargetPosition": ("GeoPosition", "TrajectoryPosition"),
        "TargetPositionMaster": ("GeoPosition", "TrajectoryPosition"),
        "TrafficAction": ("TrafficStopAction",),
        "Weather": ("Wind",),
    },
    2: {
        "Brake": ("BrakeForce", "BrakePercent"),
        "ByValueCondition": ("VariableCondition",),
        "EntityCondition": ("RelativeClearanceCondition",),
        "FileHeader": ("Properties",),
        "Gear": ("AutomaticGear", "ManualGear"),
        "GlobalAction": ("VariableAction",),
        "LongitudinalAction": ("SpeedProfileAction",),
        "OpenSCENARIO": ("VariableDeclarations",),
        "ParkingBrake": ("BrakeForce", "BrakePercent"),
        "Phase": ("TrafficeSignalGroupState",),
        "PrivateAction": ("AppearanceAction",),
        "Properties": ("CustomContent",),
        "TrafficDefinition": ("VehicleRoleDistribution",),
        "TrafficSwarmAction": ("DirectionOfTravelDistribution", "InitialSpeedRange"),
        "VisibilityAction": ("SensorReferenceSet",),
        "Weather": ("DomeImage",),
    },
    3: {
        "AssignControllerAction": ("ObjectController",),
        "EntityCondition": ("AngleCondition", "RelativeAngleCondition"),
        "GlobalAction": ("SetMonitorAction",),
        "OpenSCENARIO": ("MonitorDeclarations",),
        "Phase": ("TrafficSignalGroupState",),
        "PrivateAction": ("TrailerAction",),
        "RoutingAction": ("RandomRouteAction",),
        "Shape": ("ClothoidSpline",),
        "StochasticDistribution": ("LogNormalDistribution",),
        "TrafficAction": ("TrafficAreaAction",),
        "TrafficSourceAction": ("TrafficDistribution",),
        "TrafficSwarmAction": ("TrafficDistribution",),
        "Vehicle": ("Trailer", "TrailerCoupler", "TrailerHitch"),
    },
    4: {
        "Catalog": ("TrafficDistributionEntry",),
        "CatalogLocations": ("TrafficDistributionEntryCatalog",),
        "Clothoid": ("MotionEnd", "MotionStart"),
        "ClothoidSpline": ("MotionEnd",),
        "ClothoidSplineSegment": ("MotionStart",),
        "Polyline": ("Interpolation",),
        "RoutingAction": ("PreferredLaneLayerAction",),
        "TrafficDistribution": ("CatalogReferences",),
        "TrafficDistributionEntry": ("ParameterDeclarations",),
        "Vertex": ("Motion",),
    },
}
"""Minor version -> tag above -> tags."""

_MEASURED = ("DistanceCondition", "RelativeDistanceCondition", "TimeHeadwayCondition", "TimeToCollisionCondition")

_STEERED = ("LateralDistanceAction", "LongitudinalDistanceAction")

ATTRIBUTES: Mapping[int, Mapping[str, tuple[str, ...]]] = {
    1: {
        "AssignControllerAction": ("activateLateral", "activateLongitudinal"),
        "Clothoid": ("curvaturePrime",),
        "DistanceCondition": ("coordinateSystem", "relativeDistanceType"),
        "FollowTrajectoryAction": ("initialDistanceOffset",),
        "LateralDistanceAction": ("coordinateSystem", "displacement"),
        "LongitudinalDistanceAction": ("coordinateSystem", "displacement"),
        "MiscObject": ("model3d",),
        "Pedestrian": ("model3d",),
        "Precipitation": ("precipitationIntensity",),
        "RelativeDistanceCondition": ("coordinateSystem",),
        "RelativeLanePosition": ("dsLane",),
        "SynchronizeAction": ("targetTolerance", "targetToleranceMaster"),
        "TimeHeadwayCondition": ("coordinateSystem", "relativeDistanceType"),
        "TimeToCollisionCondition": ("coordinateSystem", "relativeDistanceType"),
        "TrafficAction": ("trafficName",),
        "Vehicle": ("mass", "model3d"),
        "Weather": ("atmosphericPressure", "temperature"),
    },
    2: {
        "AccelerationCondition": ("direction",),
        "ActivateControllerAction": ("animation", "controllerRef", "lighting"),
        "AssignControllerAction": ("activateAnimation", "activateLighting"),
        "Clutch": ("maxRate",),
        "Controller": ("controllerType",),
        "DynamicConstraints": ("maxAccelerationRate", "maxDecelerationRate"),
        "GeoPosition": ("altitude", "latitudeDeg", "longitudeDeg"),
        "LaneChangeActionDynamics": ("followingMode",),
        "Pedestrian": ("role",),
        "Performance": ("maxAccelerationRate", "maxDecelerationRate"),
        "RelativeSpeedCondition": ("direction",),
        "RoadCondition": ("wetness",),
        "SpeedActionDynamics": ("followingMode",),
        "SpeedCondition": ("direction",),
        "SteeringWheel": ("maxRate", "maxTorque"),
        "Sun": ("illuminance",),
        "Throttle": ("maxRate",),
        "TrafficSourceAction": ("speed",),
        "Vehicle": ("role",),
        "Weather": ("fractionalCloudCover",),
        **dict.fromkeys(_MEASURED, ("routingAlgorithm",)),
    },
    3: {
        "ActivateControllerAction": ("objectControllerRef",),
        "GeoPosition": ("verticalRoadSelection",),
        "ObjectController": ("name",),
    },
    4: {
        "AbsoluteTargetLane": ("layer",),
        "LanePosition": ("layer",),
        "Phase": ("semantics",),
        "RelativeTargetLane": ("layer",),
        "TrafficDistributionEntry": ("name",),
    },
}
"""Minor version -> tag -> attributes."""

_NUMBERS = (*_MEASURED, "AccelerationCondition", "ParameterCondition", "RelativeSpeedCondition")

_RULES = (*_NUMBERS, "SimulationTimeCondition", "SpeedCondition", "TimeOfDayCondition", "UserDefinedValueCondition")

_CATEGORIES = ("aircraft", "heavyTruck", "landVehicle", "micromobilityDevice", "motorcycle", "other", "semitractor")

_NEW_CATEGORIES = (*_CATEGORIES, "standupScooter", "watercraft", "wheelchair", "workMachine")

_SERVICES = ("agriculture", "construction", "dangerousGoodsTransport", "fireBrigade", "freightTransport")

_NEW_ROLES = (*_SERVICES, "garbageCollection", "other", "roadsideAssistance", "specialTransport", "trafficControl")

VALUES: Mapping[int, Mapping[tuple[str, str], tuple[str, ...]]] = {
    1: {
        **dict.fromkeys(((tag, "rule") for tag in _RULES), ("greaterOrEqual", "lessOrEqual", "notEqualTo")),
        ("ByType", "objectType"): ("external",),
        ("ByType", "type"): ("external",),
        ("RelativeDistanceCondition", "relativeDistanceType"): ("euclidianDistance",),
    },
    2: {("Event", "priority"): ("override",), ("ParameterDeclaration", "parameterType"): ("int",)},
    3: dict.fromkeys(((tag, "coordinateSystem") for tag in (*_MEASURED, *_STEERED)), ("world",)),
    4: {
        ("Vehicle", "vehicleCategory"): _NEW_CATEGORIES,
        ("VehicleCategoryDistributionEntry", "category"): _NEW_CATEGORIES,
        **dict.fromkeys((("Pedestrian", "role"), ("Vehicle", "role")), _NEW_ROLES),
        ("VehicleRoleDistributionEntry", "role"): _NEW_ROLES,
        ("VehicleLight", "vehicleLightType"): ("tailLights",),
    },
}
"""Minor version -> (tag, attribute) -> values."""


NEWEST = max(ELEMENTS)

_STRICT = 3
"""From this version on, choices hold exactly one element, and an orientation without a type is relative."""


def fit_version(losses: Losses, source: Version, version: Version) -> None:
    """Make a scenario one of another version.

    Parameters
    ----------
    losses : Losses
        Its root is changed.
    source, version : Version
        Of the input, of the output. Parts that were made for the output's are left as they are.

    Raises
    ------
    FormatError
        A condition or, if the scenario is reactive, a maneuver that the version does not know.
    """
    _orientations(losses.root, source, version)
    if version[1] >= _STRICT:
        _be_strict(losses)
    for minor in range(NEWEST, version[1], -1):
        _take_back(losses, minor)
    if version[1] == 2:
        older.complete_choices(losses)
    header = losses.root.find("{*}FileHeader")
    if header is not None:
        header.set("revMajor", str(version[0]))
        header.set("revMinor", str(version[1]))


def newer_than(element: etree._Element, version: Version) -> str | None:
    """Name of something inside an element that a version does not know; None if it knows everything."""
    for minor in range(NEWEST, version[1], -1):
        for item in _tree(element):
            parent = item.getparent()
            tag = local_name(item)
            if parent is not None and tag in ELEMENTS[minor].get(local_name(parent), ()) and tag != "TrajectoryRef":
                return tag
    return None


def _take_back(losses: Losses, minor: int) -> None:
    """From 1.`minor` to the version before it."""
    older.RENAME.get(minor, _nothing)(losses)
    for item in list(_tree(losses.root)):
        parent, tag = item.getparent(), local_name(item)
        if item is not losses.root and not losses.has(item):
            continue
        if parent is not None and tag in ELEMENTS[minor].get(local_name(parent), ()):
            losses.element(item)
            continue
        for name in ATTRIBUTES[minor].get(tag, ()):
            if name in item.attrib:
                losses.attribute(item, name)
        news = ((str(name), str(value)) for name, value in item.attrib.items())
        for name in [name for name, value in news if value in VALUES[minor].get((tag, name), ())]:
            _older_value(losses, item, name)
    older.COMPLETE.get(minor, _nothing)(losses)


def _older_value(losses: Losses, item: etree._Element, name: str) -> None:
    value = item.get(name) or ""
    former = older.VALUES.get((name, value))
    if former is None and name in older.FALLBACK:
        former = older.FALLBACK[name]
        losses.note(f"{local_name(item)}/@{name} '{value}': written as '{former}' ({losses.target} has none)")
    if former is not None:
        item.set(name, former)
    elif local_name(item) == "ByType" and name == "objectType":
        losses.element(item)
    elif any(local_name(owner) == "Condition" for owner in item.iterancestors()):
        losses.refuse(item, f"{name} '{value}'")
    else:
        losses.action(item, f"{losses.target} has no {name} '{value}'")


def _orientations(root: etree._Element, source: Version, version: Version) -> None:
    """Say what an orientation without a type meant, where that changes."""
    if (source[1] >= _STRICT) == (version[1] >= _STRICT):
        return
    meant = "relative" if source[1] >= _STRICT else "absolute"
    for item in _tree(root):
        if local_name(item) == "Orientation" and not item.get("type"):
            item.set("type", meant)


def _be_strict(losses: Losses) -> None:
    """One action in an action: a controller assigned and its values overridden are two; an empty one is none."""
    for item in [item for item in _tree(losses.root) if local_name(item) == "ControllerAction"]:
        _split_controller_action(item)
    for item in [item for item in _tree(losses.root) if local_name(item) in ("Action", "PrivateAction")]:
        if not any(isinstance(child.tag, str) for child in item):
            losses.action(item, "it is empty")
    for item in _tree(losses.root):
        if local_name(item) == "TrafficeSignalGroupState":
            item.tag = "TrafficSignalGroupState"


def _split_controller_action(item: etree._Element) -> None:
    parts = [child for child in item if isinstance(child.tag, str)]
    holder = item.getparent()  # PrivateAction
    assert holder is not None
    if not parts:
        remove(item)
        return
    inactive = [part for part in parts if len(parts) > 1 and older.overrides_nothing(part)]
    for part in inactive:
        remove(part)
    extra = [part for part in parts if part not in inactive][1:]
    outer = holder.getparent()
    assert outer is not None
    for part in extra:
        item.remove(part)
        _move_out(part, holder, outer)


def _move_out(part: etree._Element, holder: etree._Element, outer: etree._Element) -> None:
    """Into a controller action of its own, right after the one that it was in."""
    if local_name(outer) == "Action":
        another = etree.Element("Action", {"name": f"{outer.get('name')} {local_name(part)}"})
        private = build.sub(another, "PrivateAction")
        owner, after = outer.getparent(), outer
    else:
        another = private = etree.Element("PrivateAction")
        owner, after = outer, holder
    build.sub(private, "ControllerAction").append(part)
    assert owner is not None
    build.insert_indented(owner, owner.index(after) + 1, another)


def _tree(element: etree._Element) -> Iterator[etree._Element]:
    """Elements alone, no comments."""
    return (item for item in element.iter() if isinstance(item.tag, str))


def _nothing(losses: Losses) -> None:
    """No names to put back, nothing to fill in."""
