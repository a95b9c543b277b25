"""What all templates share: side of the road, lane width, file version, weather and time of day."""

from __future__ import annotations

import math
from typing import Any

from xosc_lateral.templates.parameter import Choice, Number, Parameter, Settings

COMMON: tuple[Parameter, ...] = (
    Choice("traffic", "right", ("right", "left"), "Side of the road that traffic keeps to."),
    Choice("version", "1.2", ("1.2", "1.3"), "Version of OpenSCENARIO that is written."),
    Number("lane_width", 3.75, 3.25, 4.25, "m", "Width of a driving lane."),
    Number("wind_speed", 3.0, 0.0, 30.0, "m/s", "Mean speed of the wind."),
    Number("wind_direction", 90.0, 0.0, 360.0, "deg", "Where it blows to at the road's start: 90 left, 270 right."),
    Number("rain", 0.0, 0.0, 50.0, "mm/h", "Rain; the road is wet from 0.1 on."),
    Number("time_of_day", 10.0, 0.0, 23.99, "h", "Time of day; the sun follows it."),
)

_WET_GRIP = 0.7  # friction on a wet road over that on a dry one [-]
_NOON_LIGHT = 100_000.0  # illuminance under a clear sky at noon [lx]
_NIGHT_LIGHT = 1.0  # [lx]


def is_left_hand(settings: Settings) -> bool:
    """Whether traffic keeps to the left."""
    return settings.text("traffic") == "left"


def environment_action(settings: Settings) -> Any:
    """Environment action for the init phase."""
    from scenariogeneration import xosc

    rain, hour = settings.number("rain"), settings.number("time_of_day")
    wet = rain >= 0.1
    weather = _weather(settings, rain, hour, wet)
    minutes = round(60.0 * hour)
    time = xosc.TimeOfDay(False, 2024, 6, 21, minutes // 60, minutes % 60, 0)
    road = xosc.RoadCondition(_WET_GRIP if wet else 1.0)
    return xosc.EnvironmentAction(xosc.Environment("Surroundings", time, weather, road))


def _weather(settings: Settings, rain: float, hour: float, wet: bool) -> Any:
    from scenariogeneration import xosc

    clouds = xosc.FractionalCloudCover.eightOktas if wet else xosc.FractionalCloudCover.twoOktas
    kind = xosc.PrecipitationType.rain if rain > 0.0 else xosc.PrecipitationType.dry
    return xosc.Weather(
        clouds,
        temperature=288.15,
        sun=_sun(hour, 0.2 if wet else 1.0),
        fog=xosc.Fog(5000 if wet else 20000),
        precipitation=xosc.Precipitation(kind, rain),
        wind=_wind(settings),
    )


def _wind(settings: Settings) -> Any:
    """Direction is where the wind blows to, from world x counter-clockwise; the templates' roads begin towards x."""
    from scenariogeneration import xosc

    direction = math.radians(settings.number("wind_direction")) % (2.0 * math.pi)
    return xosc.Wind(round(direction, 6), settings.number("wind_speed"))


def _sun(hour: float, clearness: float) -> Any:
    """Sun of a midsummer day in middle latitudes: up at 5 h, at noon 60 degrees high, down at 19 h (rounded).

    Azimuth as the standard counts it: 0 north, pi/2 east, pi south; 15 degrees an hour.
    """
    from scenariogeneration import xosc

    height = math.radians(60.0) * math.sin(math.pi * (hour - 5.0) / 14.0)
    light = _NIGHT_LIGHT + clearness * _NOON_LIGHT * max(0.0, math.sin(height))
    azimuth = (math.pi + math.radians(15.0) * (hour - 12.0)) % (2.0 * math.pi)
    return xosc.Sun(round(light, 1), round(azimuth, 6), round(height, 6))
