"""How vehicles under test drive in the runs that an output is compared in."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from msgspec import structs

from xosc_lateral.world.motion.nominal import EntityMotion, NominalMotion
from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.conditions import at_time
from xosc_lateral.world.scenario.enums import DynamicsDimension, DynamicsShape, Priority
from xosc_lateral.world.scenario.private_actions import (
    AbsoluteTargetLane,
    AbsoluteTargetSpeed,
    LaneChangeAction,
    SpeedAction,
    TransitionDynamics,
)
from xosc_lateral.world.scenario.scenario import Act, Action, Actors, Event, Maneuver, ManeuverGroup, Scenario, Story

CHANGE_START = 1.0
"""When an ego begins to drive faster or slower than in the nominal run. [s]"""
BRAKING_START, LATEST_BRAKING = 5.0, 15.0
"""When one begins to brake to a stop: from, to. [s]"""
STANDING_TIME = 2.0
"""For which it stands. [s]"""
STAYING_RATE = 100.0
"""How fast one that never comes is at rest: within its length of where it begins. [m/s2]"""
LANE_CHANGE_START, LANE_CHANGE_TIME = 3.0, 4.0
"""When one begins to change lanes, for how long. [s]"""
CHANGE_RATE, BRAKING_RATE = 3.0, 5.0
"""How fast they do so. [m/s2]"""

STORY = "xosc-lateral ego"

Speeds = tuple[tuple[float, float, float], ...]
"""Of an ego: from a time on [s], to a factor of its initial speed, at a rate. [m/s2]"""

OTHER_RUNS = (
    "ego at 0.7 times its speed",
    "ego at 1.3 times its speed",
    "ego that brakes to a stop",
    "ego that never comes",
    "ego that changes lanes",
)
"""Of `drives`."""


class Drive(NamedTuple):
    """How vehicles under test drive in a run: their speeds, and the lanes that some change to."""

    speeds: Speeds = ()
    lanes: Mapping[str, int] = {}


def drives(motion: NominalMotion, egos: Collection[str], network: RoadNetwork) -> tuple[Drive, ...]:
    """Ways to drive, the nominal one first: slower, faster, to a stop and on, not at all, to a lane beside.

    The stop is where one who drives as the ego does stands at a joint of roads, if there is one soon.
    """
    speed = max((float(one.speed[0]) for one in motion.entities if one.name in egos), default=0.0)
    if not egos:
        return (Drive(),)
    others = [one for one in motion.entities if one.name not in egos]
    joints = np.concatenate([one.time[1:][np.diff(one.road) != 0] for one in others] or [np.empty(0)])
    starts = joints - 0.5 * speed / BRAKING_RATE
    soon = starts[(starts >= BRAKING_START) & (starts <= LATEST_BRAKING)]
    braking = float(soon.min()) if len(soon) else BRAKING_START
    stopped = braking + speed / BRAKING_RATE + STANDING_TIME
    lanes = {one.name: _lane_beside(one, network) for one in motion.entities if one.name in egos}
    beside = {name: lane for name, lane in lanes.items() if lane}
    ways = (
        Drive(),
        Drive(((CHANGE_START, 0.7, CHANGE_RATE),)),
        Drive(((CHANGE_START, 1.3, CHANGE_RATE),)),
        Drive(((braking, 0.0, BRAKING_RATE), (stopped, 1.0, CHANGE_RATE))),
        Drive(((0.0, 0.0, STAYING_RATE),)),
    )
    return (*ways, Drive((), beside)) if beside else ways


def _lane_beside(ego: EntityMotion, network: RoadNetwork) -> int:
    """Where it can change to when it does; 0: there is none."""
    row = min(int(np.searchsorted(ego.time, LANE_CHANGE_START)), len(ego.time) - 1)
    road, lane, s, side = int(ego.road[row]), int(ego.lane[row]), float(ego.s[row]), int(np.sign(ego.lane[row]))
    there = {one.id: one.type for one in network.lanes_at(road, s)} if road >= 0 else {}
    nearest = (lane - side, lane + side, -side)  # towards the middle of the road first, that of oncoming traffic last
    return next((one for one in nearest if one and there.get(one) in DRIVING), 0)


def with_speeds(
    scenario: Scenario, motion: NominalMotion, egos: Collection[str], speeds: Speeds, lanes: Mapping[str, int] = {}
) -> Scenario:
    """A scenario in which vehicles under test change their speed, and some of them their lane."""
    place = scenario.storyboard.place
    groups = []
    for entity in motion.entities:
        if entity.name in egos:
            does = list[tuple[float, SpeedAction | LaneChangeAction]]()
            if entity.name in lanes:
                across = TransitionDynamics(DynamicsShape.SINUSOIDAL, DynamicsDimension.TIME, LANE_CHANGE_TIME)
                target_lane = AbsoluteTargetLane(lanes[entity.name])
                does.append((LANE_CHANGE_START, LaneChangeAction(target_lane, across, place=place)))
            for moment, factor, rate in speeds:
                dynamics = TransitionDynamics(DynamicsShape.LINEAR, DynamicsDimension.RATE, rate)
                target = AbsoluteTargetSpeed(factor * float(entity.speed[0]))
                does.append((moment, SpeedAction(target, dynamics, place=place)))
            name = f"{STORY} {entity.name}"
            events = tuple(
                Event(called, Priority.OVERRIDE, (Action(called, action, place, True),), trigger, place)
                for called, action, trigger in (
                    (f"{name} at {moment:g} s", action, at_time(moment, STORY, place)) for moment, action in does
                )
            )
            actors = Actors((entity.name,), False, place)
            groups.append(ManeuverGroup(name, actors, (Maneuver(name, events, place),), place))
    story = Story(STORY, (Act(STORY, tuple(groups), None, None, place),), place)
    storyboard = structs.replace(scenario.storyboard, stories=(*scenario.storyboard.stories, story))
    return replace(scenario, storyboard=storyboard)
