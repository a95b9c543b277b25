"""The environment as far as a driver may react to it."""

from __future__ import annotations

from datetime import datetime

from msgspec import Struct

from xosc_lateral.scenario.place import Place


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

    cloud_state: str | None = None
    illuminance: float | None = None
    sun_azimuth: float | None = None
    sun_elevation: float | None = None
    visual_range: float | None = None
    precipitation_type: str | None = None
    precipitation_intensity: float | None = None
    precipitation_fraction: float | None = None
    wind_speed: float | None = None
    wind_direction: float | None = None
    temperature: float | None = None
    atmospheric_pressure: float | None = None


class Environment(Struct, frozen=True):
    """A named environment; parts that a file does not state are None."""

    name: str
    place: Place
    time_of_day: TimeOfDay | None = None
    weather: Weather | None = None
    friction_scale_factor: float | None = None
    wetness: str | None = None
