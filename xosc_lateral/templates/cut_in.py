"""A faster car passes the ego vehicle, cuts in before it and slows down."""

from __future__ import annotations

from xosc_lateral.templates.motorway import Bend, Motorway, Straight
from xosc_lateral.templates.parameter import Number, Settings
from xosc_lateral.templates.storyboard import (
    Actor,
    PlannedEvent,
    Plot,
    Vehicle,
    after,
    headway,
    lane_change,
    speed_action,
)
from xosc_lateral.templates.surroundings import is_left_hand
from xosc_lateral.templates.template import Template

PARAMETERS = (
    Number("ego_speed", 30.0, 15.0, 45.0, "m/s", "Speed of the ego vehicle, in the slow lane."),
    Number("passing_speed", 35.0, 17.0, 55.0, "m/s", "Speed of the car that cuts in."),
    Number("start_gap", 40.0, 15.0, 120.0, "m", "How far it starts behind the ego vehicle."),
    Number("headway", 0.7, 0.3, 3.0, "s", "Time headway ahead of the ego vehicle at which it starts to cut in."),
    Number("lane_change_time", 4.0, 2.0, 10.0, "s", "Duration of its lane change."),
    Number("slow_speed", 29.0, 12.0, 45.0, "m/s", "Speed that it slows down to afterwards."),
    Number("deceleration", 2.0, 0.5, 8.0, "m/s2", "How hard it brakes."),
    Number("duration", 45.0, 20.0, 300.0, "s", "End of the scenario."),
)

_TRUCK_SPEED = 22.0  # [m/s]


def plot(settings: Settings) -> Plot:
    """Make the scenario."""
    settings.need_more("passing_speed", "ego_speed")
    ego_speed, passing_speed = settings.number("ego_speed"), settings.number("passing_speed")
    start_gap, duration = settings.number("start_gap"), settings.number("duration")
    start = start_gap + 20.0
    truck = start + 4.0 * ego_speed + max(ego_speed - _TRUCK_SPEED, 0.0) * duration  # never reached
    reach = max(start + max(ego_speed, passing_speed) * duration, truck + _TRUCK_SPEED * duration) + 100.0
    bends = (Straight(400.0), Bend(1500.0, 250.0, 150.0), Bend(-1500.0, 250.0, 150.0))
    motorway = Motorway(
        alignment=(*bends, Straight(max(100.0, reach - sum(part.length for part in bends)))),
        lanes=2,
        lane_width=settings.number("lane_width"),
        left_hand=is_left_hand(settings),
    )
    passed = start_gap / max(passing_speed - ego_speed, 0.5)
    return Plot(
        what="A faster car passes the ego vehicle, cuts in before it and slows down",
        motorway=motorway,
        actors=(
            Actor("Ego", Vehicle.CAR, 0, start, "$ego_speed"),
            Actor("CutIn", Vehicle.CAR, 1, start - start_gap, "$passing_speed"),
            Actor("Truck", Vehicle.TRUCK, 0, truck, _TRUCK_SPEED),
        ),
        steps=(
            PlannedEvent(
                "CutIn",
                "CutInEvent",
                lane_change(motorway.lane(0), "$lane_change_time"),
                headway("Ego", "CutIn", "greaterThan", "$headway", not_before=passed),
            ),
            PlannedEvent(
                "CutIn",
                "SlowDownEvent",
                speed_action("$slow_speed", rate="$deceleration"),
                after("CutInEvent", 1.0),
            ),
        ),
        duration=duration,
        declared=("ego_speed", "passing_speed", "headway", "lane_change_time", "slow_speed", "deceleration"),
    )


CUT_IN = Template("cut-in", "A faster car passes, cuts in and slows down.", PARAMETERS, plot)
