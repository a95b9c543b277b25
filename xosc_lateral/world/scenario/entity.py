"""Scenario objects: vehicles, pedestrians, things, and the controllers assigned to them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from msgspec import Struct, field

from xosc_lateral.world.scenario.enums import EntityCategory, VehicleCategory
from xosc_lateral.world.scenario.place import Name, Place, Xml, Zero, called


class BoundingBox(Struct, frozen=True):
    """Box around the entity; its centre in the entity's frame (x ahead of the reference point, y left, z up). [m]"""

    center_x: Annotated[float, called("Center/x")]
    center_y: Annotated[float, called("Center/y")]
    center_z: Annotated[float, called("Center/z", default=0.0)]
    length: Annotated[float, called("Dimensions/length")]
    width: Annotated[float, called("Dimensions/width")]
    height: Annotated[float, called("Dimensions/height")]


USUAL_BOX = BoundingBox(1.5, 0.0, 0.9, 5.0, 2.0, 1.8)
"""Where a file gives none: the middle of the field's passenger cars."""


class Performance(Struct, frozen=True):
    """Limits of a vehicle; infinite where the file has none. [m/s], [m/s2], [m/s3]"""

    max_speed: float = float("inf")
    max_acceleration: float = float("inf")
    max_deceleration: float = float("inf")
    max_acceleration_rate: float = float("inf")
    max_deceleration_rate: float = float("inf")


class Axle(Struct, frozen=True):
    """An axle; `position_x` ahead of the reference point. [m]"""

    position_x: Zero
    position_z: Zero
    wheel_diameter: Zero


class Axles(Struct, frozen=True):
    """Front (a trailer may have none) and rear."""

    front: Annotated[Axle | None, called("FrontAxle")]
    rear: Annotated[Axle | None, called("RearAxle")]


class Controller(Struct, frozen=True):
    """A controller as assigned; what it drives is in `controllers`. Playback uses the default driver instead."""

    name: Name
    place: Place
    properties: Mapping[str, str] = field(default_factory=dict)
    object_name: str | None = None
    """Name of the ObjectController (1.3), which ActivateControllerAction may refer to."""


class Entity(Struct, frozen=True):
    """One scenario object."""

    name: str  # name of the ScenarioObject
    category: EntityCategory  # vehicle, pedestrian, miscellaneous or external
    place: Place  # of the ScenarioObject
    bounding_box: Annotated[BoundingBox, Xml(default=USUAL_BOX)]
    """`USUAL_BOX` where the file has none."""
    vehicle_category: VehicleCategory | None = None  # vehicles only
    performance: Performance = Performance()  # vehicles only; else without limits
    axles: Axles | None = None  # vehicles only
    controllers: tuple[Controller, ...] = ()  # assigned at the start
    object_name: Annotated[str, called("name")] = ""  # of the Vehicle, Pedestrian or MiscObject (often a catalog entry)
    kind: Annotated[str, called("vehicleCategory", "pedestrianCategory", "miscObjectCategory")] = ""
    """The file's own category code (``car``, ``wheelchair``, ``pole`` ...); empty for external objects."""
    trailer: str | None = None  # name of the entity that it pulls from the start
    hitch_x: float | None = None
    coupler_x: float | None = None
    """Of the trailer coupling, ahead of the reference point. [m]"""
    model3d: Annotated[str | None, called("model3d", "model")] = None  # 3D model file, as written
    properties: Mapping[str, str] = field(default_factory=dict)  # vendor properties

    @property
    def is_vehicle(self) -> bool:
        """Vehicles are what lateral movement is added to; all else plays along."""
        return self.category is EntityCategory.VEHICLE
