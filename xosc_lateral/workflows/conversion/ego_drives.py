"""How vehicles under test drive in the runs that an output is compared in."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from msgspec import structs

from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.scenario.conditions import at_time
from xosc_lateral.world.scenario.enums import DynamicsDimension, DynamicsShape, Priority
from xosc_lateral.world.scenario.private_actions import AbsoluteTargetSpeed, SpeedAction, TransitionDynamics
from xosc_lateral.world.scenario.scenario import Act, Action, Actors, Event, Maneuver, ManeuverGroup, Scenario, Story

CHANGE_START = 1.0
"""When an ego begins to drive faster or slower than in the nominal run. [s]"""
BRAKING_START, LATEST_BRAKING = 5.0, 15.0
"""When one begins to brake to a stop: from, to. [s]"""
STANDING_TIME = 2.0
"""For which it stands. [s]"""
CHANGE_RATE, BRAKING_RATE = 3.0, 5.0
"""How fast they do so. [m/s2]"""

STORY = "xosc-lateral ego"

Speeds = tuple[tuple[float, float, float], ...]
"""Of an ego: from a time on [s], to a factor of its initial speed, at a rate. [m/s2]"""

OTHER_RUNS = ("ego at 0.7 times its speed", "ego at 1.3 times its speed", "ego that brakes to a stop")  # of `drives`


def drives(motion: NominalMotion, egos: Collection[str]) -> tuple[Speeds, ...]:
    """Ways to drive, the nominal one first: slower, faster, to a stop and on.

    The stop is where one who drives as the ego does stands at a joint of roads, if there is one soon.
    """
    speed = max((float(one.speed[0]) for one in motion.entities if one.name in egos), default=0.0)
    if not egos:
        return ((),)
    others = [one for one in motion.entities if one.name not in egos]
    joints = np.concatenate([one.time[1:][np.diff(one.road) != 0] for one in others] or [np.empty(0)])
    starts = joints - 0.5 * speed / BRAKING_RATE
    soon = starts[(starts >= BRAKING_START) & (starts <= LATEST_BRAKING)]
    braking = float(soon.min()) if len(soon) else BRAKING_START
    stopped = braking + speed / BRAKING_RATE + STANDING_TIME
    return (
        (),
        ((CHANGE_START, 0.7, CHANGE_RATE),),
        ((CHANGE_START, 1.3, CHANGE_RATE),),
        ((braking, 0.0, BRAKING_RATE), (stopped, 1.0, CHANGE_RATE)),
    )


def with_speeds(scenario: Scenario, motion: NominalMotion, egos: Collection[str], speeds: Speeds) -> Scenario:
    """A scenario in which vehicles under test change their speed."""
    place = scenario.storyboard.place
    groups = []
    for entity in motion.entities:
        if entity.name in egos:
            events = []
            for moment, factor, rate in speeds:
                name = f"{STORY} {entity.name} at {moment:g} s"
                dynamics = TransitionDynamics(DynamicsShape.LINEAR, DynamicsDimension.RATE, rate)
                target = AbsoluteTargetSpeed(factor * float(entity.speed[0]))
                action = Action(name, SpeedAction(target, dynamics, place=place), place, True)
                events.append(Event(name, Priority.OVERRIDE, (action,), at_time(moment, STORY, place), place))
            name = f"{STORY} {entity.name}"
            actors = Actors((entity.name,), False, place)
            groups.append(ManeuverGroup(name, actors, (Maneuver(name, tuple(events), place),), place))
    story = Story(STORY, (Act(STORY, tuple(groups), None, None, place),), place)
    storyboard = structs.replace(scenario.storyboard, stories=(*scenario.storyboard.stories, story))
    return replace(scenario, storyboard=storyboard)
