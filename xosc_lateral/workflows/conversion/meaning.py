"""Whether a written scenario still means what its source does: both are played, under egos of several speeds.

A car that drives beside the middle of its lane comes to places, and to others, at other times, and a lane offset that
runs when a lateral action begins changes how that ends. Events may be `shifted.MOST` earlier or later, not more.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf

from msgspec import structs

from xosc_lateral.workflows.conversion.load import Played
from xosc_lateral.world.motion.nominal import EntityMotion, NominalMotion, PlayedAction
from xosc_lateral.world.player.player import play
from xosc_lateral.world.scenario import Action, Event, Maneuver, ManeuverGroup, Scenario, Story
from xosc_lateral.world.scenario.conditions import at_time
from xosc_lateral.world.scenario.enums import DynamicsDimension, DynamicsShape, Priority
from xosc_lateral.world.scenario.private_actions import AbsoluteTargetSpeed, SpeedAction, TransitionDynamics
from xosc_lateral.world.scenario.storyboard import Act, Actors

MOST = 0.05
"""An event may be this much earlier or later without a word. [s]"""

LASTS = 0.2
"""Of its duration, by which an action may end earlier or later beyond that: one at a given rate takes longer from the
side of a lane. One that was overruled is far off. [-]"""

OURS = "xosc-lateral"
"""Begins the names of stories that we add."""

Key = tuple[tuple[str, ...], str | None, int]


@dataclass(frozen=True, slots=True)
class Shift:
    """One thing that happens otherwise: which, whose (None: nobody's), and in which way."""

    what: str
    actor: str | None
    how: str

    def __str__(self) -> str:
        """One line."""
        return f"{self.what} {self.how} with the offsets"


def shifts(before: NominalMotion, after: NominalMotion, *, ignored: Collection[str] = ()) -> list[Shift]:
    """Events of the source that start earlier, later, not at all or once more in the other run; other ends and lanes.

    Entities that are ignored may end in any lane.
    """
    then, now = _spans(before.actions), _spans(after.actions)
    found: dict[str, Shift] = {}
    for key, (start, end) in then.items():
        name, what = _named(key, start)
        ends = min(end, before.end_time), min(now[key][1], after.end_time) if key in now else inf
        if key not in now:
            # Due in the last moments, it may come after the end just as well.
            if start <= before.end_time - MOST:
                found.setdefault(name, Shift(what, key[1], "no longer happens"))
        elif abs(now[key][0] - start) > MOST:
            found.setdefault(name, Shift(what, key[1], f"happens {_later(now[key][0] - start)}"))
        elif abs(ends[1] - ends[0]) > MOST + LASTS * (ends[0] - start):
            found.setdefault(name, Shift(what, key[1], f"is over {_later(ends[1] - ends[0])}"))
    for key, (start, _) in now.items():
        if key not in then and (*key[:2], 0) in then and start <= before.end_time - MOST:
            name, what = _named(key, start)
            found.setdefault(name, Shift(what, key[1], "happens once more"))
    if before.ended_by == after.ended_by and abs(after.end_time - before.end_time) > MOST + before.step:
        what = f"the end ({before.ended_by}) at {before.end_time:.2f} s"
        found.setdefault("", Shift(what, None, f"comes {_later(after.end_time - before.end_time)}"))
    lanes = {entity.name: _last_lanes(entity, after.end_time) for entity in before.entities}
    for entity in after.entities:
        last = _last_lanes(entity, before.end_time)
        if not found and entity.name not in ignored and not set(lanes.get(entity.name, last)) & set(last):
            what = f"the last lane of '{entity.name}', {lanes[entity.name][-1]},"
            found.setdefault(entity.name, Shift(what, entity.name, f"is {last[-1]}"))
    return list(found.values())


def _later(moved: float) -> str:
    return f"{abs(moved):.2f} s {'later' if moved > 0 else 'earlier'}"


def _last_lanes(entity: EntityMotion, end: float) -> list[int]:
    """Where both runs are still on: that in which it ends, after those that it has just left."""
    rows = (entity.time <= end) & (entity.time >= min(end, float(entity.time[-1])) - MOST)
    return [int(lane) for lane in entity.lane[rows]] or [int(entity.lane[0])]


def _named(key: Key, start: float) -> tuple[str, str]:
    """An event's name, and the event in words."""
    path, actor, _ = key
    name = path[-2] if len(path) > 1 else path[-1]
    whose = "" if actor is None else f" of '{actor}'"
    return name, f"event '{name}'{whose} at {start:.2f} s"


def _spans(actions: Sequence[PlayedAction]) -> dict[Key, tuple[float, float]]:
    """Start and end of each action of the source, counted for those that run several times. [s]"""
    spans: dict[Key, tuple[float, float]] = {}
    numbers: dict[tuple[tuple[str, ...], str | None], int] = {}
    for played in actions:
        if played.path == ("Init",) or played.path[0].startswith(OURS):
            continue
        number = numbers.get((played.path, played.actor), 0)
        numbers[played.path, played.actor] = number + 1
        spans[played.path, played.actor, number] = (played.start, inf if played.end is None else played.end)
    return spans


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

    `played`: the source and its nominal run; `egos`: vehicles under test; `time_limit`: of playback. [s]
    """

    def __init__(self, played: Played, egos: tuple[str, ...], *, step: float, time_limit: float | None) -> None:
        self._played, self._egos, self._step = played, egos, step
        motion = played.motion
        self._is_cut_off = motion.cut_off is not None
        last = max((one.start if one.end is None else one.end for one in motion.actions), default=0.0)
        until = last if self._is_cut_off else motion.end_time
        self.limit = min(inf if time_limit is None else time_limit, LASTING * max(until, LEAST))
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
        from xosc_lateral.files.openscenario.write.replaced_maneuvers import replaced_groups

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
            speed = SpeedAction(AbsoluteTargetSpeed(factor * float(entity.speed[0])), dynamics, place=place)
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
