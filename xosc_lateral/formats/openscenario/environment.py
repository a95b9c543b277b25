"""The environment: weather, time of day, road condition."""

from __future__ import annotations

from datetime import datetime

from xosc_lateral.formats.openscenario.context import Context
from xosc_lateral.formats.openscenario.declarations import local_scope
from xosc_lateral.formats.openscenario.element import XmlElement
from xosc_lateral.scenario.environment import Environment, TimeOfDay, Weather


def read_environment(owner: XmlElement, context: Context) -> Environment:
    """Environment inline or from a catalog; a missing catalog is remarked, and leaves everything as it is."""
    environment = owner.child("Environment")
    if environment is not None:
        environment = environment.within(local_scope(environment))
    else:
        reference = owner.required("CatalogReference")
        environment = context.optional_entry(reference)
        if environment is None:
            return Environment(reference.text("entryName"), reference.place())
    road = environment.child("RoadCondition")
    return Environment(
        environment.text("name", ""),
        environment.place(),
        _time_of_day(environment.child("TimeOfDay"), context),
        _weather(environment.child("Weather"), context),
        None if road is None else road.optional_number("frictionScaleFactor"),
        None if road is None else road.optional_text("wetness"),
    )


def read_date_time(element: XmlElement, name: str = "dateTime") -> datetime | None:
    """Local date and time without zone; None if it can't be understood."""
    try:
        return datetime.fromisoformat(element.text(name).strip()).replace(tzinfo=None)
    except ValueError:
        return None


def _time_of_day(element: XmlElement | None, context: Context) -> TimeOfDay | None:
    if element is None:
        return None
    moment = read_date_time(element)
    if moment is None:
        context.remark(element, f"dateTime='{element.text('dateTime')}' is not a date and time")
        return None
    return TimeOfDay(moment, element.boolean("animation", False))


def _weather(element: XmlElement | None, context: Context) -> Weather | None:
    if element is None:
        return None
    sun, fog, wind = element.child("Sun"), element.child("Fog"), element.child("Wind")
    rain = element.child("Precipitation")
    old = context.version == (1, 0)
    return Weather(
        cloud_state=element.optional_text("cloudState") or element.optional_text("fractionalCloudCover"),
        illuminance=_first_number(sun, "illuminance", "intensity"),
        sun_azimuth=_first_number(sun, "azimuth"),
        sun_elevation=_first_number(sun, "elevation"),
        visual_range=None if fog is None else fog.optional_number("visualRange", finite=False),
        precipitation_type=None if rain is None else rain.optional_text("precipitationType"),
        precipitation_intensity=_first_number(rain, "precipitationIntensity", *(() if old else ("intensity",))),
        precipitation_fraction=_first_number(rain, "intensity") if old else None,
        wind_speed=_first_number(wind, "speed"),
        wind_direction=_first_number(wind, "direction"),
        temperature=element.optional_number("temperature"),
        atmospheric_pressure=element.optional_number("atmosphericPressure"),
    )


def _first_number(element: XmlElement | None, *names: str) -> float | None:
    if element is None:
        return None
    return next((value for name in names if (value := element.optional_number(name)) is not None), None)
