"""Scenario objects, their controllers, entity selections."""

from __future__ import annotations

from datetime import datetime

from msgspec.structs import replace

from xosc_lateral.base.errors import FormatError, MissingFileError
from xosc_lateral.base.names import unwritable
from xosc_lateral.files.openscenario.context import Context, Reader, read_struct
from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.files.openscenario.references import local_scope
from xosc_lateral.world.scenario.entity import USUAL_BOX, BoundingBox, Controller, Entity, Performance
from xosc_lateral.world.scenario.enums import EntityCategory, VehicleCategory
from xosc_lateral.world.scenario.global_actions import Environment, TimeOfDay, Weather


def _read_environment(owner: XmlElement, context: Context) -> Environment:
    """Environment inline or from a catalog; a missing catalog is remarked, and leaves everything as it is."""
    environment = owner.child("Environment")
    if environment is not None:
        environment = environment.within(local_scope(environment))
    else:
        reference = owner.required("CatalogReference")
        environment = context.optional_entry(reference)
        if environment is None:
            return Environment(reference.text("entryName"), place=reference.place())
    time, weather = environment.child("TimeOfDay"), environment.child("Weather")
    return read_struct(
        Environment,
        environment,
        context,
        time_of_day=None if time is None else _time_of_day(time, context),
        weather=None if weather is None else _weather(weather, context),
    )


def read_date_time(element: XmlElement) -> datetime | None:
    """Local date and time without zone; None if it can't be understood."""
    try:
        return datetime.fromisoformat(element.text("dateTime").strip()).replace(tzinfo=None)
    except ValueError:
        return None


def _time_of_day(element: XmlElement, context: Context) -> TimeOfDay | None:
    moment = read_date_time(element)
    if moment is None:
        context.note(element, f"dateTime='{element.text('dateTime')}' is not a date and time")
        return None
    return TimeOfDay(moment, element.value("animation", bool, False))


def _weather(element: XmlElement, context: Context) -> Weather:
    """`Precipitation/@intensity` was a share in version 1.0, and is read as mm/h from 1.1 on."""
    rain = element.child("Precipitation")
    intensity = None if rain is None else rain.optional_number("precipitationIntensity")
    if rain is not None and intensity is None and context.version != (1, 0):
        intensity = rain.optional_number("intensity")
    return read_struct(Weather, element, context, precipitation_intensity=intensity)


USUAL_ACCELERATION = 10.0
"""Where a file leaves out a limit that the standard asks for; esmini 3.6.0 takes the same. [m/s2]"""

CATEGORIES = {
    "Vehicle": EntityCategory.VEHICLE,
    "Pedestrian": EntityCategory.PEDESTRIAN,
    "MiscObject": EntityCategory.MISC,
    "ExternalObjectReference": EntityCategory.EXTERNAL,
}


def read_entities(root: XmlElement, context: Context) -> tuple[Entity, ...]:
    """All entities in file order, each trailer described inside its tractor after it; names go into the context."""
    owner = root.required("Entities")
    entities = [entity for item in owner.children("ScenarioObject") for entity in _read_object(item, context)]
    for entity in entities:
        if entity.name in context.entities:
            owner.fail(f"two entities are called '{entity.name}'")
        context.entities.add(entity.name)
    context.selections = _read_selections(owner, entities, context)
    return tuple(entity if entity.trailer in context.entities else replace(entity, trailer=None) for entity in entities)


def _read_selections(owner: XmlElement, entities: list[Entity], context: Context) -> dict[str, tuple[str, ...]]:
    selections: dict[str, tuple[str, ...]] = {}
    for selection in owner.children("EntitySelection"):
        members: list[str] = []
        for member in selection.required("Members").children():
            if member.tag == "EntityRef":
                name = member.text("entityRef")
                members.extend(selections[name] if name in selections else (context.entity(member),))
            elif member.tag == "ByType":
                wanted = member.value("objectType", EntityCategory)
                members.extend(entity.name for entity in entities if entity.category is wanted)
        name = selection.text("name")
        if name in context.entities or name in selections:
            selection.fail(f"something else is called '{name}'")
        selections[name] = tuple(dict.fromkeys(members))
    return selections


def _read_object(item: XmlElement, context: Context, name: str | None = None) -> list[Entity]:
    name = item.text("name") if name is None else name
    if not name:
        item.fail("attribute 'name' is empty")
    if (why := unwritable(name)) is not None:
        item.fail(f"attribute 'name': {why}")
    content = item.child(*CATEGORIES, "CatalogReference")
    if content is None:
        item.fail("contains no Vehicle, Pedestrian, MiscObject or CatalogReference")
    if content.tag == "CatalogReference":
        try:
            content = context.catalogs.entry(content)
        except MissingFileError as error:
            if context.strict:
                raise
            return [_stand_in(content, name, context, error)]
    else:
        content = content.within(local_scope(content))
    category = CATEGORIES.get(content.tag)
    if category is None:
        item.fail(f"catalog entry '{content.raw('name')}' is a {content.tag}, which can't be a scenario object")
    trailer, inner = _read_trailer(content, name, context)
    vehicle_category = VehicleCategory.CAR if category is EntityCategory.VEHICLE else None
    try:
        vehicle_category = vehicle_category and content.value("vehicleCategory", VehicleCategory, vehicle_category)
    except FormatError as error:
        context.note(content, f"{error.what}: taken as a car")
    entity = read_struct(
        Entity,
        content,
        context,
        name=name,
        category=category,
        place=item.place(),
        vehicle_category=vehicle_category,
        controllers=tuple(
            replace(controller, object_name=owner.optional_text("name"))
            for owner in item.children("ObjectController")
            if (controller := _read_controller(owner, context)) is not None
        ),
        trailer=trailer,
        hitch_x=_coupling(content, "TrailerHitch"),
        coupler_x=_coupling(content, "TrailerCoupler"),
        properties=_read_properties(content),
    )
    return [entity, *inner]


def _stand_in(reference: XmlElement, name: str, context: Context, error: MissingFileError) -> Entity:
    """A car like others, for one whose catalog is missing."""
    context.note(reference, f"{error.what}: '{name}' is played as a car of usual size without limits")
    return Entity(
        name=name,
        category=EntityCategory.VEHICLE,
        place=reference.place(),
        bounding_box=USUAL_BOX,
        vehicle_category=VehicleCategory.CAR,
        object_name=reference.text("entryName"),
    )


def _read_trailer(vehicle: XmlElement, tractor: str, context: Context) -> tuple[str | None, list[Entity]]:
    """Name of the trailer hitched from the start, and the trailer itself when it is described right here.

    Before version 1.3 had trailers, tools wrote an EntityRef in place of a TrailerRef.

    Catalog entries with a trailer are used several times over, so a trailer can't keep the name that it has there: it
    is called like its tractor with a ``+``, as in the reference player.
    """
    owner = vehicle.child("Trailer")
    if owner is None:
        return None, []
    for other in owner.children():
        if other.tag not in ("TrailerRef", "EntityRef", "Trailer"):
            context.note(other, f"a trailer of '{tractor}' by a {other.tag} is not read")
    reference = owner.child("TrailerRef", "EntityRef")
    inner = owner.child("Trailer")
    if reference is not None:
        return reference.text("entityRef", "") or None, []
    if inner is None:
        return None, []
    entities = context.nested(inner, lambda inner, context: _read_object(inner, context, f"{tractor}+"))
    return entities[0].name, entities


def _coupling(vehicle: XmlElement, tag: str) -> float | None:
    element = vehicle.child(tag)
    return None if element is None else element.number("dx")


def _read_bounding_box(element: XmlElement, context: Context) -> BoundingBox:
    """None of its sizes is negative."""
    box = read_struct(BoundingBox, element, context)
    if min(box.length, box.width, box.height) < 0:
        size = element.required("Dimensions")
        size.fail(f"negative dimension ({box.length} m x {box.width} m x {box.height} m)")
    return box


def _read_performance(element: XmlElement, context: Context) -> Performance:
    """Limits that the standard asks for are remarked where they are missing."""
    inf = float("inf")
    usual = {"maxSpeed": inf, "maxAcceleration": USUAL_ACCELERATION, "maxDeceleration": USUAL_ACCELERATION}
    for name in ("maxAcceleration", "maxDeceleration"):
        if element.optional_text(name) is None:
            context.note(element, f"{name} is missing: {USUAL_ACCELERATION:g} m/s2 is taken")
    usual |= {"maxAccelerationRate": inf, "maxDecelerationRate": inf}
    limits = {name: element.number(name, limit, finite=False) for name, limit in usual.items()}
    for name, limit in limits.items():
        if not limit >= 0.0:
            element.fail(f"{name} {limit:g}, expected 0 or more")
    return Performance(*limits.values())


def _read_controller(owner: XmlElement, context: Context) -> Controller | None:
    """Controller inline, from a catalog, or in an ObjectController (1.3 actions). Motion does not depend on it."""
    owner = owner.child("ObjectController") or owner
    inline, reference = owner.child("Controller"), owner.child("CatalogReference")
    if inline is not None:
        controller, place = inline.within(local_scope(inline)), inline.place()
    elif reference is not None:
        entry, place = context.optional_entry(reference), reference.place()
        if entry is None:
            return Controller(reference.text("entryName"), place)
        controller = entry
    else:
        return None
    return Controller(controller.text("name", ""), place, _read_properties(controller))


def _read_properties(owner: XmlElement) -> dict[str, str]:
    """Name and value pairs of a ``Properties`` child."""
    return {item.text("name", ""): item.text("value", "") for item in owner.listed("Properties", "Property")}


READERS: dict[object, Reader] = {
    BoundingBox: _read_bounding_box,
    Controller: _read_controller,
    Environment: _read_environment,
    Performance: _read_performance,
}
