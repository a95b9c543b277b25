"""Ten vehicles on three lanes; two of them change lanes, one platoon slows down and recovers."""

from __future__ import annotations

from xosc_lateral.templates.motorway import Bend, Motorway, Straight
from xosc_lateral.templates.parameter import Number, Settings
from xosc_lateral.templates.storyboard import (
    Actor,
    PlannedEvent,
    Plot,
    Vehicle,
    after,
    at_time,
    headway,
    lane_change,
    speed_action,
)
from xosc_lateral.templates.surroundings import is_left_hand
from xosc_lateral.templates.template import Template

PARAMETERS = (
    Number("slow_lane_speed", 23.0, 15.0, 27.0, "m/s", "Speed in the slow lane, where trucks drive."),
    Number("middle_lane_speed", 27.0, 15.0, 40.0, "m/s", "Speed in the middle lane, the ego vehicle's."),
    Number("fast_lane_speed", 31.0, 15.0, 50.0, "m/s", "Speed in the fast lane."),
    Number("headway", 1.8, 1.0, 4.0, "s", "Time headway within each lane."),
    Number("slow_down", 6.0, 0.0, 12.0, "m/s", "By how much the middle lane slows down for a while."),
    Number("lane_change_time", 5.0, 2.0, 10.0, "s", "Duration of the lane changes."),
    Number("duration", 50.0, 30.0, 300.0, "s", "End of the scenario."),
)

_REACTION = 0.9  # between two vehicles of a platoon [s]
_BRAKE_TIME, _SLOW_TIME = 12.0, 5.0  # when the platoon slows down, and for how long [s]
_BRAKING, _RECOVERING = 1.5, 0.8  # how hard [m/s2]


def plot(settings: Settings) -> Plot:
    """Make the scenario."""
    names = ("slow_lane_speed", "middle_lane_speed", "fast_lane_speed")
    slow, middle, fast = (settings.number(name) for name in names)
    gap, duration = settings.number("headway"), settings.number("duration")
    ego_s = 40.0 + 2.6 * gap * max(slow, middle, fast)  # room for those that start behind the ego vehicle
    reach = ego_s + max(slow, middle, fast) * (duration + 3.0 * gap) + 150.0
    bends = (Straight(350.0), Bend(-1800.0, 350.0, 150.0), Straight(100.0), Bend(1800.0, 350.0, 150.0))
    motorway = Motorway(
        alignment=(*bends, Straight(max(100.0, reach - sum(part.length for part in bends)))),
        lanes=3,
        lane_width=settings.number("lane_width"),
        left_hand=is_left_hand(settings),
    )

    def place(name: str, vehicle: Vehicle, lane: int, ahead: float) -> Actor:
        """`ahead` is counted in time headways from the ego vehicle."""
        return Actor(name, vehicle, lane, ego_s + ahead * gap * (slow, middle, fast)[lane], f"${names[lane]}")

    slow_down = settings.number("slow_down")
    brake = speed_action(round(middle - slow_down, 3), rate=_BRAKING)
    recover = speed_action("$middle_lane_speed", rate=_RECOVERING)
    catch_up = speed_action("$middle_lane_speed", rate=1.0)
    recovered = _BRAKE_TIME + slow_down / _BRAKING + _SLOW_TIME + slow_down / _RECOVERING + 3.0 * _REACTION
    return Plot(
        what="Ten vehicles on three lanes: lane changes, and a platoon that slows down and recovers",
        motorway=motorway,
        actors=(
            place("Ego", Vehicle.CAR, 1, 0.0),
            place("MiddleAhead", Vehicle.CAR, 1, 1.0),
            place("MiddleFirst", Vehicle.VAN, 1, 2.0),
            place("MiddleBehind", Vehicle.CAR, 1, -1.0),
            place("SlowFirst", Vehicle.TRUCK, 0, 2.5),
            place("SlowSecond", Vehicle.TRUCK, 0, 1.0),
            place("SlowThird", Vehicle.CAR, 0, -0.5),
            place("FastFirst", Vehicle.CAR, 2, 1.3),
            place("FastSecond", Vehicle.CAR, 2, -0.4),
            place("FastThird", Vehicle.VAN, 2, -2.6),
        ),
        steps=(
            PlannedEvent("MiddleFirst", "FirstBrakes", brake, at_time(_BRAKE_TIME)),
            PlannedEvent(
                "MiddleAhead", "SecondBrakes", brake, after("FirstBrakes", _REACTION, state="startTransition")
            ),
            PlannedEvent("Ego", "EgoBrakes", brake, after("SecondBrakes", _REACTION, state="startTransition")),
            PlannedEvent("MiddleBehind", "LastBrakes", brake, after("EgoBrakes", _REACTION, state="startTransition")),
            PlannedEvent("MiddleFirst", "FirstRecovers", recover, after("FirstBrakes", _SLOW_TIME)),
            PlannedEvent(
                "MiddleAhead", "SecondRecovers", recover, after("FirstRecovers", _REACTION, state="startTransition")
            ),
            PlannedEvent("Ego", "EgoRecovers", recover, after("SecondRecovers", _REACTION, state="startTransition")),
            PlannedEvent(
                "MiddleBehind", "LastRecovers", recover, after("EgoRecovers", _REACTION, state="startTransition")
            ),
            PlannedEvent(
                "FastFirst",
                "FastPullsIn",
                lane_change(motorway.lane(1), "$lane_change_time"),
                headway("MiddleFirst", "FastFirst", "greaterThan", 2.5, not_before=16.0),
            ),
            PlannedEvent(
                "SlowThird",
                "SlowPullsOut",
                lane_change(motorway.lane(1), "$lane_change_time"),
                headway("SlowThird", "MiddleBehind", "greaterThan", 1.5, not_before=recovered),
            ),
            PlannedEvent("SlowThird", "SlowSpeedsUp", catch_up, after("SlowPullsOut", 0.5, state="startTransition")),
        ),
        duration=duration,
        declared=(*names, "lane_change_time"),
    )


DENSE_TRAFFIC = Template("dense-traffic", "Ten vehicles on three lanes.", PARAMETERS, plot)
