"""The environment as far as a driver may react to it."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from msgspec import Struct

from xosc_lateral.world.scenario.place import Content, Name, Xml, called


class TimeOfDay(Struct, frozen=True):
    """Date and time; `animation`: it goes on with simulation time."""

    date_time: datetime
    animation: bool


class Weather(Struct, frozen=True):
    """Parts that a file does not state are None.

    Parameters
    ----------
    cloud_state : str or None
        As written.
    illuminance : float or None
        Of the sun (`intensity` up to 1.1). [lx]
    visual_range : float or None
        Of the fog. [m]
    precipitation_type : str or None
        ``dry``, ``rain``, ``snow``.
    precipitation_intensity : float or None
        mm/h from 1.1; the unitless 0..1 of version 1.0 is in `precipitation_fraction`.
    wind_speed, wind_direction : float or None
        [m/s], [rad]: direction is where the wind blows to, counter-clockwise from world x.
    temperature, atmospheric_pressure : float or None
        [K], [Pa]
    """

    cloud_state: Annotated[str | None, called("cloudState", "fractionalCloudCover")] = None
    illuminance: Annotated[float | None, called("Sun/illuminance", "Sun/intensity")] = None
    sun_azimuth: Annotated[float | None, called("Sun/azimuth")] = None
    sun_elevation: Annotated[float | None, called("Sun/elevation")] = None
    visual_range: Annotated[float | None, Xml(("Fog/visualRange",), finite=False)] = None
    precipitation_type: Annotated[str | None, called("Precipitation/precipitationType")] = None
    precipitation_intensity: float | None = None
    precipitation_fraction: float | None = None
    wind_speed: Annotated[float | None, called("Wind/speed")] = None
    wind_direction: Annotated[float | None, called("Wind/direction")] = None
    temperature: float | None = None
    atmospheric_pressure: float | None = None


class Environment(Content, frozen=True):
    """A named environment; parts that a file does not state are None."""

    name: Name
    time_of_day: TimeOfDay | None = None
    weather: Weather | None = None
    friction_scale_factor: Annotated[float | None, called("RoadCondition/frictionScaleFactor")] = None
    wetness: Annotated[str | None, called("RoadCondition/wetness")] = None
