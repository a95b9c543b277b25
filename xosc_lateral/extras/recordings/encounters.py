"""What happened between vehicles: who was cut in on, who braked behind whom, how near; and triggers made of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.extras.recordings.lane_order import ENCOUNTER_DISTANCE, At, RoadLanes
from xosc_lateral.extras.recordings.plan import VehiclePlan

BRAKING_DECELERATION = 1.0  # from which it is braking: coasting in gear gives about 0.5 at 100 km/h [m/s2]
SURE_RATE = 1.0  # a distance that passes its value more slowly is no trigger: 0.1 m of error is more than 0.1 s [m/s]
UNARMED_DURATION = 5.0  # before a trigger is armed: the same distance may come earlier, behind the other [s]
TRIGGER_TOLERANCE = 0.2  # so near to the recorded moment the trigger has to come [s]


@dataclass(frozen=True, slots=True)
class OtherVehicle:
    """Another vehicle at a moment: free space between bumpers [m], and time until it is used up [s], inf: never."""

    name: str
    gap: float
    time_to_collision: float


@dataclass(frozen=True, slots=True)
class Encounter:
    """A lane change or a braking, with who was ahead and behind in the lane that it is in then."""

    kind: str  # "lane change" or "braking"
    vehicle: str
    time: float  # when it begins; of a lane change, when the vehicle is half way [s]
    side: str  # "left", "right"; empty of a braking
    ahead: OtherVehicle | None
    behind: OtherVehicle | None


@dataclass(frozen=True, slots=True)
class RelativeTrigger:
    """A maneuver begins when the distance to another vehicle passes a value, but not before a time."""

    other: str  # the other entity
    distance: float  # between the reference points, along the road [m]
    grows: bool  # it passes the value from below
    not_before: float  # [s]


def brakings(plan: VehiclePlan) -> list[int]:
    """Numbers of the speed profile's corners at which braking begins."""
    hard = np.diff(plan.speed.speed) / np.diff(plan.speed.time) <= -BRAKING_DECELERATION
    return (1 + np.flatnonzero(hard[1:] & ~hard[:-1])).tolist()


def encounters(plans: Sequence[VehiclePlan], lanes: RoadLanes) -> tuple[Encounter, ...]:
    """All lane changes and brakings, in order of time."""
    met = list[Encounter]()
    for plan in plans:
        for transition, lane in zip(plan.lateral.transitions, plan.targets, strict=True):
            if transition.lanes:
                time, side = transition.start + 0.5 * transition.duration, "left" if transition.lanes > 0 else "right"
                beside = _beside(plan, plans, time, lanes, lane)
                met.append(Encounter("lane change", plan.name, time, side, *beside))
        for time in plan.speed.time[brakings(plan)].tolist():
            met.append(Encounter("braking", plan.name, time, "", *_beside(plan, plans, time, lanes)))
    return tuple(sorted(met, key=lambda encounter: (encounter.time, encounter.vehicle)))


def _along(plan: VehiclePlan, time: FloatArray) -> FloatArray:
    """Planned s at some times, shape as the argument. [m]"""
    return np.interp(plan.time_at(plan.speed.way(time)), plan.vehicle.time, plan.vehicle.s)


def _at(plan: VehiclePlan, time: float) -> At | None:
    """Where a vehicle is at a moment: in its recorded lane, as far as planned; None: it is not there."""
    vehicle = plan.vehicle
    if not plan.present[0] - 1e-9 <= time <= vehicle.time[-1]:
        return None
    row = min(int(np.searchsorted(vehicle.time, time)), len(vehicle.time) - 1)
    return At.of(vehicle, row, float(_along(plan, np.array([time]))[0]))


def _beside(
    plan: VehiclePlan, plans: Sequence[VehiclePlan], time: float, lanes: RoadLanes, lane: int | None = None
) -> list[OtherVehicle | None]:
    """Nearest vehicle ahead and behind in a lane of its road; None: the lane that it is in."""
    there = [(one, at) for one in plans if (at := _at(one, time)) is not None]
    number = next((k for k, (one, _) in enumerate(there) if one is plan), None)
    if number is None:
        return [None, None]
    beside, speed, now = list[OtherVehicle | None](), float(plan.speed.at(np.array([time]))[0]), np.array([time])
    for known, ahead in zip(lanes.nearest([at for _, at in there], number, lane), (1.0, -1.0), strict=True):
        if known is None or known[1] > ENCOUNTER_DISTANCE:
            beside.append(None)
            continue
        other, gap = there[known[0]][0], known[1]
        closing = (speed - float(other.speed.at(now)[0])) * ahead
        beside.append(OtherVehicle(other.name, gap, gap / closing if closing > 1e-3 else np.inf))
    return beside


Triggers = tuple[dict[int, RelativeTrigger], dict[int, RelativeTrigger]]
"""Of transitions by their number, of brakings by the number of their corner in the speed profile."""


def relative_triggers(plan: VehiclePlan, plans: Sequence[VehiclePlan], lanes: RoadLanes) -> Triggers:
    """Triggers that the plans bear out."""
    changes, braking = dict[int, RelativeTrigger](), dict[int, RelativeTrigger]()
    for k, (transition, lane) in enumerate(zip(plan.lateral.transitions, plan.targets, strict=True)):
        if transition.lanes:
            time = transition.start
            behind, ahead = _beside(plan, plans, time, lanes, lane)[1], _beside(plan, plans, time, lanes)[0]
            if trigger := _trigger(plan, behind, plans, time) or _trigger(plan, ahead, plans, time):
                changes[k] = trigger
    for k in brakings(plan):
        time = float(plan.speed.time[k])
        if trigger := _trigger(plan, _beside(plan, plans, time, lanes)[0], plans, time):
            braking[k] = trigger
    return changes, braking


def _trigger(
    plan: VehiclePlan, beside: OtherVehicle | None, plans: Sequence[VehiclePlan], time: float
) -> RelativeTrigger | None:
    """The distance to another vehicle as a trigger, if it passes its value at that time and not in a while before."""
    other = next((other for other in plans if beside is not None and other.name == beside.name), None)
    if other is None:
        return None
    first = max(plan.present[0], other.present[0], time - UNARMED_DURATION)
    roads = np.unique(np.r_[plan.vehicle.road, other.vehicle.road])
    if time - first < 1.0 or len(roads) > 1:  # distances over several roads depend on the player's way
        return None
    t = np.arange(first, min(time + 1.0, plan.present[1], other.present[1]), 0.02)
    distance = np.abs(_along(plan, t) - _along(other, t))
    before, at, ahead = np.interp((time - 0.5, time, time + 0.5), t, distance).tolist()
    grows = ahead > before
    passed = distance > at if grows else distance < at
    moment = float(t[int(np.argmax(passed))]) if passed.any() else np.inf
    if abs(ahead - before) < SURE_RATE or abs(moment - time) > TRIGGER_TOLERANCE:
        return None
    return RelativeTrigger(other.name, at, grows, first)
