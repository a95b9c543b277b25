"""The car ahead brakes and speeds up again; the ego vehicle follows suit, a car passes meanwhile."""

from __future__ import annotations

from xosc_lateral.templates.motorway import Bend, Motorway, Straight
from xosc_lateral.templates.parameter import Number, Settings
from xosc_lateral.templates.storyboard import Actor, PlannedEvent, Plot, Vehicle, after, at_time, speed_action
from xosc_lateral.templates.surroundings import is_left_hand
from xosc_lateral.templates.template import Template

PARAMETERS = (
    Number("speed", 32.0, 15.0, 45.0, "m/s", "Speed of both before and after."),
    Number("headway", 1.8, 0.8, 5.0, "s", "Time headway of the ego vehicle to the leader at the start."),
    Number("brake_time", 15.0, 2.0, 120.0, "s", "When the leader brakes."),
    Number("slow_speed", 20.0, 5.0, 40.0, "m/s", "Speed that the leader brakes to."),
    Number("deceleration", 3.0, 0.5, 9.0, "m/s2", "How hard the leader brakes."),
    Number("reaction_time", 0.8, 0.1, 3.0, "s", "After which the ego vehicle does the same."),
    Number("slow_time", 8.0, 1.0, 60.0, "s", "How long they stay slow."),
    Number("acceleration", 1.2, 0.3, 4.0, "m/s2", "How they speed up again."),
    Number("duration", 55.0, 20.0, 300.0, "s", "End of the scenario."),
)


def plot(settings: Settings) -> Plot:
    """Make the scenario."""
    settings.need_more("speed", "slow_speed")
    speed, duration = settings.number("speed"), settings.number("duration")
    gap = settings.number("headway") * speed
    passing = 1.15 * speed
    reach = 100.0 + gap + passing * duration + 100.0
    bends = (Straight(300.0), Bend(-1200.0, 300.0, 120.0), Straight(200.0), Bend(1200.0, 300.0, 120.0))
    motorway = Motorway(
        alignment=(*bends, Straight(max(100.0, reach - sum(part.length for part in bends)))),
        lanes=2,
        lane_width=settings.number("lane_width"),
        left_hand=is_left_hand(settings),
    )
    brake = speed_action("$slow_speed", rate="$deceleration")
    recover = speed_action("$speed", rate="$acceleration")
    return Plot(
        what="The car ahead brakes and speeds up again; the ego vehicle follows suit",
        motorway=motorway,
        actors=(
            Actor("Ego", Vehicle.CAR, 0, 100.0, "$speed"),
            Actor("Leader", Vehicle.VAN, 0, 100.0 + gap, "$speed"),
            Actor("Passing", Vehicle.CAR, 1, 20.0, round(passing, 3)),
        ),
        steps=(
            PlannedEvent("Leader", "LeaderBrakes", brake, at_time("$brake_time")),
            PlannedEvent("Leader", "LeaderRecovers", recover, after("LeaderBrakes", "$slow_time")),
            PlannedEvent("Ego", "EgoBrakes", brake, after("LeaderBrakes", "$reaction_time", state="startTransition")),
            PlannedEvent(
                "Ego", "EgoRecovers", recover, after("LeaderRecovers", "$reaction_time", state="startTransition")
            ),
        ),
        duration=duration,
        declared=(
            "speed",
            "brake_time",
            "slow_speed",
            "deceleration",
            "reaction_time",
            "slow_time",
            "acceleration",
        ),
    )


BRAKING_LEADER = Template("braking-leader", "The car ahead brakes and speeds up again.", PARAMETERS, plot)
