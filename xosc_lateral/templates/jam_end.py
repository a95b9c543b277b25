"""The ego vehicle comes up to the end of a jam and brakes down behind it."""

from __future__ import annotations

from xosc_lateral.errors import XoscLateralError
from xosc_lateral.templates.motorway import Bend, Motorway, Straight
from xosc_lateral.templates.parameter import Number, Settings
from xosc_lateral.templates.storyboard import Actor, PlannedEvent, Plot, Vehicle, after, closer_than, speed_action
from xosc_lateral.templates.surroundings import is_left_hand
from xosc_lateral.templates.template import Template

PARAMETERS = (
    Number("speed", 31.0, 15.0, 45.0, "m/s", "Speed of the ego vehicle and of the car behind it."),
    Number("jam_speed", 0.0, 0.0, 8.0, "m/s", "Speed of the jam; 0: it stands."),
    Number(
        "jam_distance", 750.0, 300.0, 3000.0, "m", "Distance from the ego vehicle to the end of the jam at the start."
    ),
    Number("deceleration", 2.5, 1.0, 8.0, "m/s2", "How hard the ego vehicle brakes."),
    Number("jam_gap", 8.0, 4.0, 50.0, "m", "Free space that it keeps behind the last vehicle."),
    Number("duration", 50.0, 20.0, 300.0, "s", "End of the scenario."),
)

_SPACING = 14.0  # between the reference points of two vehicles in the jam [m]
_EGO, _QUEUE = Vehicle.CAR, (Vehicle.TRUCK, Vehicle.CAR, Vehicle.VAN)


def plot(settings: Settings) -> Plot:
    """Make the scenario."""
    speed, jam_speed = settings.number("speed"), settings.number("jam_speed")
    deceleration, duration = settings.number("deceleration"), settings.number("duration")
    follow = 2.0 * speed
    ego = 30.0 + follow
    jam = ego + settings.number("jam_distance")
    stopped = settings.number("jam_gap") + _EGO.front + _QUEUE[0].rear
    braking = (speed - jam_speed) ** 2 / (2.0 * deceleration) + stopped
    if braking >= jam - ego:
        raise XoscLateralError(
            f"jam_distance: {jam - ego:g} has to be more than the {braking:.0f} m that braking takes"
        )
    reach = jam + jam_speed * duration + 4.0 * _SPACING + 150.0
    bends = (Straight(250.0), Bend(1500.0, 200.0, 120.0))
    motorway = Motorway(
        alignment=(*bends, Straight(max(100.0, reach - sum(part.length for part in bends)))),
        lanes=2,
        lane_width=settings.number("lane_width"),
        left_hand=is_left_hand(settings),
    )
    brake = speed_action(jam_speed, rate="$deceleration")
    in_jam = tuple(
        Actor(
            f"Jam{lane}{number}", _QUEUE[(number + lane) % 3], lane, jam + _SPACING * (number + 0.4 * lane), jam_speed
        )
        for lane in (0, 1)
        for number in range(3)
    )
    return Plot(
        what="The ego vehicle comes up to the end of a jam and brakes down behind it",
        motorway=motorway,
        actors=(
            Actor("Ego", _EGO, 0, ego, "$speed"),
            Actor("Follower", Vehicle.CAR, 0, ego - follow, "$speed"),
            *in_jam,
        ),
        steps=(
            PlannedEvent("Ego", "EgoBrakes", brake, closer_than("Ego", "Jam00", round(braking, 3))),
            PlannedEvent("Follower", "FollowerBrakes", brake, after("EgoBrakes", 1.0, state="startTransition")),
        ),
        duration=duration,
        declared=("speed", "deceleration"),
    )


JAM_END = Template("jam-end", "Braking down behind the end of a jam.", PARAMETERS, plot)
