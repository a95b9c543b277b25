"""Free driving through left and right bends; nothing happens but the road."""

from __future__ import annotations

import math

from xosc_lateral.templates.motorway import Bend, Motorway, Straight
from xosc_lateral.templates.parameter import Number, Settings
from xosc_lateral.templates.storyboard import Actor, Plot, Vehicle
from xosc_lateral.templates.surroundings import is_left_hand
from xosc_lateral.templates.template import Template

PARAMETERS = (
    Number("speed", 31.0, 12.0, 50.0, "m/s", "Speed of the ego vehicle; a second car drives 1 m/s slower beside it."),
    Number("radius", 900.0, 250.0, 8000.0, "m", "Radius of the bends; the first one is to the left."),
    Number("arc", 180.0, 50.0, 2000.0, "m", "Length of each bend without its clothoids."),
    Number("clothoid", 120.0, 40.0, 500.0, "m", "Length of each clothoid."),
    Number("straight", 80.0, 10.0, 2000.0, "m", "Straight between two bends."),
    Number("grade", 0.0, -6.0, 6.0, "%", "Slope of the road, upwards positive."),
    Number("duration", 55.0, 20.0, 600.0, "s", "End of the scenario; there are as many bends as it takes."),
)


def plot(settings: Settings) -> Plot:
    """Make the scenario."""
    speed, duration = settings.number("speed"), settings.number("duration")
    reach = 200.0 + speed * duration + 150.0
    motorway = _motorway(settings, reach)
    return Plot(
        what="Free driving through left and right bends",
        motorway=motorway,
        actors=(
            Actor("Ego", Vehicle.CAR, 0, 50.0, "$speed"),
            Actor("Beside", Vehicle.CAR, 1, 110.0, round(speed - 1.0, 3)),
        ),
        steps=(),
        duration=duration,
        declared=("speed",),
    )


def _motorway(settings: Settings, reach: float) -> Motorway:
    """As many bends to either side as it takes to `reach`. [m]"""
    bend = Bend(settings.number("radius"), settings.number("arc"), settings.number("clothoid"))
    straight = Straight(settings.number("straight"))
    n_bends = math.ceil((reach - 200.0) / (bend.length + straight.length))
    bends = [Bend((-1.0) ** number * bend.radius, bend.arc, bend.clothoid) for number in range(n_bends)]
    return Motorway(
        alignment=(Straight(200.0), *(part for each in bends for part in (each, straight)), Straight(150.0)),
        lanes=2,
        lane_width=settings.number("lane_width"),
        left_hand=is_left_hand(settings),
        grade=settings.number("grade") / 100.0,
    )


CURVES = Template("curves", "Free driving through bends to both sides.", PARAMETERS, plot)
