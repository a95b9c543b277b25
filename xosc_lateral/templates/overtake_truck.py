"""The ego vehicle comes up to a truck, overtakes it and returns to its lane."""

from __future__ import annotations

from xosc_lateral.templates.motorway import Bend, Motorway, Straight
from xosc_lateral.templates.parameter import Number, Settings
from xosc_lateral.templates.storyboard import Actor, PlannedEvent, Plot, Vehicle, headway, lane_change
from xosc_lateral.templates.surroundings import is_left_hand
from xosc_lateral.templates.template import Template

PARAMETERS = (
    Number("ego_speed", 33.0, 15.0, 55.0, "m/s", "Speed of the ego vehicle."),
    Number("truck_speed", 23.0, 12.0, 27.0, "m/s", "Speed of the truck."),
    Number("start_gap", 180.0, 60.0, 400.0, "m", "Distance to the truck at the start."),
    Number("headway_before", 2.0, 0.8, 5.0, "s", "Time headway to the truck at which the ego vehicle pulls out."),
    Number("headway_after", 2.0, 0.8, 6.0, "s", "Time headway of the truck to it at which it pulls in again."),
    Number("lane_change_time", 5.0, 2.0, 10.0, "s", "Duration of its lane changes."),
    Number("duration", 50.0, 20.0, 300.0, "s", "End of the scenario."),
)

_LEAD = 120.0  # of the car in the other lane before the truck [m]


def plot(settings: Settings) -> Plot:
    """Make the scenario."""
    settings.need_more("ego_speed", "truck_speed")
    ego_speed, truck_speed = settings.number("ego_speed"), settings.number("truck_speed")
    start_gap, duration = settings.number("start_gap"), settings.number("duration")
    reach = 100.0 + start_gap + _LEAD + max(ego_speed, truck_speed) * duration + 100.0
    bends = (Straight(500.0), Bend(2000.0, 400.0, 150.0))
    motorway = Motorway(
        alignment=(*bends, Straight(max(100.0, reach - sum(part.length for part in bends)))),
        lanes=2,
        lane_width=settings.number("lane_width"),
        left_hand=is_left_hand(settings),
    )
    passed = start_gap / max(ego_speed - truck_speed, 0.5)
    return Plot(
        what="The ego vehicle comes up to a truck, overtakes it and returns to its lane",
        motorway=motorway,
        actors=(
            Actor("Ego", Vehicle.CAR, 0, 100.0, "$ego_speed"),
            Actor("Truck", Vehicle.TRUCK, 0, 100.0 + start_gap, "$truck_speed"),
            Actor("FarAhead", Vehicle.CAR, 1, 100.0 + start_gap + _LEAD, "$ego_speed"),
        ),
        steps=(
            PlannedEvent(
                "Ego",
                "PullOut",
                lane_change(motorway.lane(1), "$lane_change_time"),
                headway("Ego", "Truck", "lessThan", "$headway_before"),
            ),
            PlannedEvent(
                "Ego",
                "PullIn",
                lane_change(motorway.lane(0), "$lane_change_time"),
                headway("Truck", "Ego", "greaterThan", "$headway_after", not_before=passed),
            ),
        ),
        duration=duration,
        declared=("ego_speed", "truck_speed", "headway_before", "headway_after", "lane_change_time"),
    )


OVERTAKE_TRUCK = Template("overtake-truck", "The ego vehicle overtakes a truck and returns.", PARAMETERS, plot)
