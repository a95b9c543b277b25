"""Whether a written scenario still means what its source does: both are played, under egos of several speeds.

A car that drives beside the middle of its lane comes to places, and to others, at other times, and a lane offset that
runs when a lateral action begins changes how that ends. Events may be `shifted.MOST` earlier or later, not more.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from functools import lru_cache
from math import inf

from msgspec import structs

from xosc_lateral.motion.nominal import NominalMotion
from xosc_lateral.pipeline.load import Played
from xosc_lateral.pipeline.shifted import Shift, shifts
from xosc_lateral.playback.player import play
from xosc_lateral.scenario import Action, Event, Maneuver, ManeuverGroup, Scenario, Story
from xosc_lateral.scenario.conditions import at_time
from xosc_lateral.scenario.enums import DynamicsDimension, DynamicsShape, Priority
from xosc_lateral.scenario.private_actions import AbsoluteTargetSpeed, SpeedAction, TransitionDynamics
from xosc_lateral.scenario.storyboard import Act, Actors

FACTORS = (0.8, 1.2)
"""Of the initial speed of the vehicles under test, beside the nominal run. [-]"""
CHANGE_AT, RATE = 1.0, 3.0
"""When and how fast they change to it. [s], [m/s2]"""
STORY = "xosc-lateral ego"
LASTING = 3.0
"""Times the nominal run, or what happens in one that does not end by itself, each run is played: beyond, all
movement is again what it was. [-]"""
LEAST = 20.0
"""Of that run. [s]"""
SMALLER = (0.5, 0.2)
"""Times what was sampled, before vehicles are left out: a fifth still moves by centimetres. [-]"""
MOST_TRIES = 12
"""Vehicles whose offsets are left out one by one; beyond, all that are left go. [-]"""


class Meaning:
    """What happens in a source, nominally and under faster and slower egos.

    Parameters
    ----------
    played : Played
        The source and its nominal run.
    egos : tuple of str
        Vehicles under test.
    step : float
    time_limit : float or None
        Of playback. [s]
    """

    def __init__(self, played: Played, egos: tuple[str, ...], *, step: float, time_limit: float | None) -> None:
        self._played, self._egos, self._step = played, egos, step
        self.limit = inf if time_limit is None else time_limit
        motion = played.motion
        last = [one.start if one.end is None else one.end for one in motion.actions]
        self._is_cut_off = motion.cut_off is not None
        until = max(last, default=0.0) if self._is_cut_off else motion.end_time
        self.limit = min(self.limit, LASTING * max(until, LEAST))
        self._before = list(self._runs(played))

    @property
    def end(self) -> float:
        """Of the longest run. [s]"""
        return max(motion.end_time for motion in self._before)

    def _runs(self, played: Played) -> Iterator[NominalMotion]:
        for factor in (1.0, *FACTORS) if self._egos else (1.0,):
            if factor == 1.0 and not self._is_cut_off:
                yield played.motion
                continue
            changed = with_speeds(played.scenario, self._played.motion, self._egos, factor)
            yield play(changed, played.network, step=self._step, time_limit=self.limit)

    def shifts(self, again: Played, trajectories: Collection[str]) -> list[Shift]:
        """What happens otherwise in an output in which some entities follow trajectories; each event once."""
        from xosc_lateral.formats.openscenario.write.replaced_maneuvers import replaced_groups

        gone = {one.path for one in replaced_groups(self._played.scenario, trajectories)}
        found: dict[str, Shift] = {}
        for before, after in zip(self._before, self._runs(again), strict=True):
            kept = [one for one in before.actions if one.path[:3] not in gone and one.actor not in trajectories]
            for shift in shifts(replace(before, actions=tuple(kept)), after, ignored=trajectories):
                found.setdefault(shift.what, shift)
        return list(found.values())


@lru_cache(maxsize=1)  # the same for all variants
def meaning_of(played: Played, egos: tuple[str, ...], *, step: float, time_limit: float | None) -> Meaning:
    """See `Meaning`."""
    return Meaning(played, egos, step=step, time_limit=time_limit)


def with_speeds(scenario: Scenario, motion: NominalMotion, egos: Collection[str], factor: float) -> Scenario:
    """A scenario in which vehicles under test change to `factor` of their initial speed."""
    place = scenario.storyboard.place
    trigger = at_time(CHANGE_AT, STORY, place)
    groups = []
    for entity in motion.entities:
        if entity.name in egos:
            dynamics = TransitionDynamics(DynamicsShape.LINEAR, DynamicsDimension.RATE, RATE)
            speed = SpeedAction(AbsoluteTargetSpeed(factor * float(entity.speed[0])), dynamics, place)
            name = f"{STORY} {entity.name}"
            event = Event(name, Priority.OVERRIDE, (Action(name, speed, place, True),), trigger, place)
            actors = Actors((entity.name,), False, place)
            groups.append(ManeuverGroup(name, actors, (Maneuver(name, (event,), place),), place))
    story = Story(STORY, (Act(STORY, tuple(groups), None, None, place),), place)
    storyboard = structs.replace(scenario.storyboard, stories=(*scenario.storyboard.stories, story))
    return replace(scenario, storyboard=storyboard)


def keep_meaning(
    names: Collection[str],
    attempt: Callable[[Collection[str], float], list[Shift]],
) -> tuple[frozenset[str], float, list[Shift]]:
    """Offsets as large, for as many vehicles, as leave what happens as it was.

    Parameters
    ----------
    names : collection of str
        Vehicles that are to get lane offsets.
    attempt : callable
        Writes with offsets of these vehicles, times a factor, and says what happens otherwise.

    Returns
    -------
    names : frozenset of str
        Who gets them; the last attempt was made with these.
    factor : float
        Of the offsets. [-]
    shifts : list of Shift
        What still happens otherwise, with nobody left to blame.
    """
    kept = frozenset(names)
    found = attempt(kept, 1.0)
    if not found or not kept:
        return kept, 1.0, found
    for factor in SMALLER:
        if not attempt(kept, factor):
            return kept, factor, []
    actors = [shift.actor for shift in found]
    for tries, name in enumerate(sorted(kept, key=lambda one: (one not in actors, one))):
        without = kept - {name} if tries < MOST_TRIES else frozenset()
        fewer = attempt(without, 1.0)
        if len(fewer) < len(found):
            kept, found = without, fewer
        if not found or not kept:
            break
    return kept, 1.0, attempt(kept, 1.0)
