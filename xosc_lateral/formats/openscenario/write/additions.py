"""What each version of OpenSCENARIO XML has that the one before lacks: facts of the schemas 1.0.0 to 1.4.0.

Elements by the tag above them, attributes by the tag that carries them; what lies inside a new element is not listed.
`tests/formats/test_versions.py` compares this table with the schemas.
"""

from __future__ import annotations

from collections.abc import Mapping

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
