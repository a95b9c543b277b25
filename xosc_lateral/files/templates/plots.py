"""The templates that ship: their settings, and what follows from them."""

from __future__ import annotations

import math
from dataclasses import replace

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.files.templates.template import Bend, Motorway, Number, Plot, Settings, Straight, Template, motorway

CUT_IN = (
    Number("ego_speed", 30.0, 15.0, 45.0, "m/s", "Speed of the ego vehicle, in the slow lane."),
    Number("passing_speed", 35.0, 17.0, 55.0, "m/s", "Speed of the car that cuts in."),
    Number("start_gap", 40.0, 15.0, 120.0, "m", "How far it starts behind the ego vehicle."),
    Number("headway", 0.7, 0.3, 3.0, "s", "Time headway ahead of the ego vehicle at which it starts to cut in."),
    Number("lane_change_time", 4.0, 2.0, 10.0, "s", "Duration of its lane change."),
    Number("slow_speed", 29.0, 12.0, 45.0, "m/s", "Speed that it slows down to afterwards."),
    Number("deceleration", 2.0, 0.5, 8.0, "m/s2", "How hard it brakes."),
    Number("duration", 45.0, 20.0, 300.0, "s", "End of the scenario."),
)

_TRUCK_SPEED = 22.0  # as in the scenario [m/s]


def _cut_in(settings: Settings) -> Plot:
    settings.need_more("passing_speed", "ego_speed")
    ego_speed, passing_speed = settings.number("ego_speed"), settings.number("passing_speed")
    start_gap, duration = settings.number("start_gap"), settings.number("duration")
    start = start_gap + 20.0
    truck = start + 4.0 * ego_speed + max(ego_speed - _TRUCK_SPEED, 0.0) * duration  # never reached
    reach = max(start + max(ego_speed, passing_speed) * duration, truck + _TRUCK_SPEED * duration) + 100.0
    bends = Straight(400.0), Bend(1500.0, 250.0, 150.0), Bend(-1500.0, 250.0, 150.0)
    return Plot(
        motorway(settings, *bends, reach=reach),
        starts={"Ego": start, "CutIn": start - start_gap, "Truck": truck},
        times={"CutInEvent": start_gap / max(passing_speed - ego_speed, 0.5)},
    )


BRAKING_LEADER = (
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


def _braking_leader(settings: Settings) -> Plot:
    settings.need_more("speed", "slow_speed")
    speed = settings.number("speed")
    gap = settings.number("headway") * speed
    passing = 1.15 * speed
    bends = Straight(300.0), Bend(-1200.0, 300.0, 120.0), Straight(200.0), Bend(1200.0, 300.0, 120.0)
    return Plot(
        motorway(settings, *bends, reach=100.0 + gap + passing * settings.number("duration") + 100.0),
        starts={"Leader": 100.0 + gap},
        speeds={"Passing": round(passing, 3)},
    )


OVERTAKE_TRUCK = (
    Number("ego_speed", 33.0, 15.0, 55.0, "m/s", "Speed of the ego vehicle."),
    Number("truck_speed", 23.0, 12.0, 27.0, "m/s", "Speed of the truck."),
    Number("start_gap", 180.0, 60.0, 400.0, "m", "Distance to the truck at the start."),
    Number("headway_before", 2.0, 0.8, 5.0, "s", "Time headway to the truck at which the ego vehicle pulls out."),
    Number("headway_after", 2.0, 0.8, 6.0, "s", "Time headway of the truck to it at which it pulls in again."),
    Number("lane_change_time", 5.0, 2.0, 10.0, "s", "Duration of its lane changes."),
    Number("duration", 50.0, 20.0, 300.0, "s", "End of the scenario."),
)

_LEAD = 120.0  # of the car in the other lane before the truck [m]


def _overtake_truck(settings: Settings) -> Plot:
    settings.need_more("ego_speed", "truck_speed")
    ego_speed, truck_speed = settings.number("ego_speed"), settings.number("truck_speed")
    start_gap = settings.number("start_gap")
    reach = 100.0 + start_gap + _LEAD + max(ego_speed, truck_speed) * settings.number("duration") + 100.0
    return Plot(
        motorway(settings, Straight(500.0), Bend(2000.0, 400.0, 150.0), reach=reach),
        starts={"Truck": 100.0 + start_gap, "FarAhead": 100.0 + start_gap + _LEAD},
        times={"PullIn": start_gap / max(ego_speed - truck_speed, 0.5)},
    )


CURVES = (
    Number("speed", 31.0, 12.0, 50.0, "m/s", "Speed of the ego vehicle; a second car drives 1 m/s slower beside it."),
    Number("radius", 900.0, 250.0, 8000.0, "m", "Radius of the bends; the first one is to the left."),
    Number("arc", 180.0, 50.0, 2000.0, "m", "Length of each bend without its clothoids."),
    Number("clothoid", 120.0, 40.0, 500.0, "m", "Length of each clothoid."),
    Number("straight", 80.0, 10.0, 2000.0, "m", "Straight between two bends."),
    Number("grade", 0.0, -6.0, 6.0, "%", "Slope of the road, upwards positive."),
    Number("duration", 55.0, 20.0, 600.0, "s", "End of the scenario; there are as many bends as it takes."),
)


def _curves(settings: Settings) -> Plot:
    speed = settings.number("speed")
    reach = 200.0 + speed * settings.number("duration") + 150.0
    bend = Bend(settings.number("radius"), settings.number("arc"), settings.number("clothoid"))
    straight = Straight(settings.number("straight"))
    n_bends = math.ceil((reach - 200.0) / (bend.length + straight.length))
    bends = [replace(bend, radius=(-1.0) ** number * bend.radius) for number in range(n_bends)]
    road = Motorway(
        alignment=(Straight(200.0), *(part for each in bends for part in (each, straight)), Straight(150.0)),
        lanes=2,
        lane_width=settings.number("lane_width"),
        left_hand=settings.text("traffic") == "left",
        grade=settings.number("grade") / 100.0,
    )
    return Plot(road, speeds={"Beside": round(speed - 1.0, 3)})


JAM_END = (
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
_EGO_FRONT, _TRUCK_REAR = 1.45 + 0.5 * 4.8, 0.5 * 7.9 - 2.6  # from the reference points of the scenario's vehicles [m]


def _jam_end(settings: Settings) -> Plot:
    speed, jam_speed = settings.number("speed"), settings.number("jam_speed")
    follow = 2.0 * speed
    ego = 30.0 + follow
    jam = ego + settings.number("jam_distance")
    stopped = settings.number("jam_gap") + _EGO_FRONT + _TRUCK_REAR
    braking = (speed - jam_speed) ** 2 / (2.0 * settings.number("deceleration")) + stopped
    if braking >= jam - ego:
        raise XoscLateralError(
            f"jam_distance: {jam - ego:g} has to be more than the {braking:.0f} m that braking takes"
        )
    reach = jam + jam_speed * settings.number("duration") + 4.0 * _SPACING + 150.0
    queue = {f"Jam{lane}{n}": jam + _SPACING * (n + 0.4 * lane) for lane in (0, 1) for n in range(3)}
    return Plot(
        motorway(settings, Straight(250.0), Bend(1500.0, 200.0, 120.0), reach=reach),
        starts={"Ego": ego, "Follower": ego - follow, **queue},
        speeds=dict.fromkeys((*queue, "EgoBrakes", "FollowerBrakes"), jam_speed),
        distances={"EgoBrakes": round(braking, 3)},
    )


DENSE_TRAFFIC = (
    Number("slow_lane_speed", 23.0, 15.0, 27.0, "m/s", "Speed in the slow lane, where trucks drive."),
    Number("middle_lane_speed", 27.0, 15.0, 40.0, "m/s", "Speed in the middle lane, the ego vehicle's."),
    Number("fast_lane_speed", 31.0, 15.0, 50.0, "m/s", "Speed in the fast lane."),
    Number("headway", 1.8, 1.0, 4.0, "s", "Time headway within each lane."),
    Number("slow_down", 6.0, 0.0, 12.0, "m/s", "By how much the middle lane slows down for a while."),
    Number("lane_change_time", 5.0, 2.0, 10.0, "s", "Duration of the lane changes."),
    Number("duration", 50.0, 30.0, 300.0, "s", "End of the scenario."),
)

_REACTION = 0.9  # between two vehicles of a platoon, as in the scenario, like the next two lines [s]
_BRAKE_TIME, _SLOW_TIME = 12.0, 5.0  # when the platoon slows down, and for how long [s]
_BRAKING, _RECOVERING = 1.5, 0.8  # how hard [m/s2]

_START_PLACES = {
    "Ego": (1, 0.0), "MiddleAhead": (1, 1.0), "MiddleFirst": (1, 2.0), "MiddleBehind": (1, -1.0),
    "SlowFirst": (0, 2.5), "SlowSecond": (0, 1.0), "SlowThird": (0, -0.5),
    "FastFirst": (2, 1.3), "FastSecond": (2, -0.4), "FastThird": (2, -2.6),
}  # fmt: skip
"""Vehicle -> its lane, and how far it starts ahead of the ego vehicle, in time headways."""


def _dense_traffic(settings: Settings) -> Plot:
    speeds = [settings.number(f"{lane}_lane_speed") for lane in ("slow", "middle", "fast")]
    gap, slow_down = settings.number("headway"), settings.number("slow_down")
    ego = 40.0 + 2.6 * gap * max(speeds)  # room for those that start behind the ego vehicle
    reach = ego + max(speeds) * (settings.number("duration") + 3.0 * gap) + 150.0
    bends = Straight(350.0), Bend(-1800.0, 350.0, 150.0), Straight(100.0), Bend(1800.0, 350.0, 150.0)
    recovered = _BRAKE_TIME + slow_down / _BRAKING + _SLOW_TIME + slow_down / _RECOVERING + 3.0 * _REACTION
    brakings = [f"{who}Brakes" for who in ("First", "Second", "Ego", "Last")]
    return Plot(
        motorway(settings, *bends, reach=reach, lanes=3),
        starts={name: ego + ahead * gap * speeds[lane] for name, (lane, ahead) in _START_PLACES.items()},
        speeds=dict.fromkeys(brakings, round(speeds[1] - slow_down, 3)),
        times={"SlowPullsOut": recovered},
    )


TEMPLATES = (
    Template("cut-in", "A faster car passes, cuts in and slows down.", CUT_IN, _cut_in),
    Template("braking-leader", "The car ahead brakes and speeds up again.", BRAKING_LEADER, _braking_leader),
    Template("overtake-truck", "The ego vehicle overtakes a truck and returns.", OVERTAKE_TRUCK, _overtake_truck),
    Template("curves", "Free driving through bends to both sides.", CURVES, _curves),
    Template("jam-end", "Braking down behind the end of a jam.", JAM_END, _jam_end),
    Template("dense-traffic", "Ten vehicles on three lanes.", DENSE_TRAFFIC, _dense_traffic),
)
