"""What happens in two runs of a scenario, with and without offsets: which events come at other times, and why.

An action by a lateral acceleration or speed takes longer or shorter from beside the middle: over b' instead of b it
lasts D (b'/b)^p, with p = 1/2 or 1, as its dynamics have it [1]_. That, and what waits for its end, is explained; what
is not is another meaning.

References
----------
.. [1] ASAM OpenSCENARIO XML 1.3, TransitionDynamics, LaneOffsetActionDynamics: peak rate and peak acceleration of a
       shape are in proportion to b / D and b / D^2.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from math import inf

import numpy as np
from msgspec import Struct

from xosc_lateral.base.arrays import rate
from xosc_lateral.base.limits import REPEATED_RUNS
from xosc_lateral.base.note import Note
from xosc_lateral.workflows.conversion.result import CONTACT_MOVED, EventShift
from xosc_lateral.world.motion.gaps import contacts_of, gaps_of
from xosc_lateral.world.motion.look import STORY_PREFIX, Finding
from xosc_lateral.world.motion.nominal import EntityMotion, NominalMotion, PlayedAction
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.conditions import StoryboardElementStateCondition
from xosc_lateral.world.scenario.dependence import entity_references, refers_to
from xosc_lateral.world.scenario.enums import DynamicsDimension, StoryboardElementState
from xosc_lateral.world.scenario.private_actions import (
    LATERAL,
    LaneChangeAction,
    LaneOffsetAction,
    LateralDistanceAction,
)
from xosc_lateral.world.scenario.scenario import Condition, Scenario, conditions_of

EVENT_TOLERANCE = 0.05
"""By which an event may be earlier or later beyond what is explained: a frame of a coarse player. [s]"""
NOTICED = 0.03
"""Earlier or later by more, an event moves others. [s]"""
ROUNDING = 1e-6
"""Of times that are sums of frames. [s]"""
LARGEST_DELAY_RATIO = 3.0
"""Times as late as an entity begins to change its speed, it comes to a distance from another: change over closing
speed. What is later by more is told. [-]"""
HOW_NEW = "is new"
LEAST_WAY = 1e-3
"""A lateral action over less than this has no duration to compare. [m]"""

Path = tuple[str, ...]
Key = tuple[Path, str | None, int]
"""Names of an action from the story down, its actor, and which of its runs."""


class Change(Struct, frozen=True):
    """One thing that happens otherwise: which, whose (none: nobody's), when without offsets [s], and in which way."""

    what: str
    entity: str | None
    time: float
    how: str
    size: float = inf  # of a shift in time; infinite: it is none [s]
    pair: tuple[str, str] | None = None  # who touches, if that is what happens
    run: str = ""  # in which it happens, where there are several

    def __str__(self) -> str:
        """One line."""
        return str(self.note)

    @property
    def about(self) -> str:
        """Which it is, whenever it comes."""
        return self.what.rpartition(" at ")[0] or self.what

    @property
    def note(self) -> Note:
        """It as a warning."""
        what = f"{self.what} {self.how} with the offsets"
        return Note(what, is_warning=True, entity=self.entity, run=self.run or None)


class Comparison(Struct, frozen=True):
    """Shifts of all events that both runs have, and what is another meaning."""

    shifts: tuple[EventShift, ...]
    changes: tuple[Change, ...]
    findings: tuple[Finding, ...] = ()  # how vehicles move otherwise, and where they are elsewhere
    by_chance: tuple[Change, ...] = ()  # what hangs on a frame: the source does it otherwise, too, in other frames
    run: str = ""  # how vehicles under test drive in both

    @property
    def first(self) -> float:
        """When something first comes earlier or later, or happens otherwise. [s]"""
        starts = (one.time for one in self.shifts if abs(one.start) > NOTICED)
        ends = (one.time + one.duration for one in self.shifts if abs(one.end) > NOTICED)
        return min((*starts, *ends, *(one.time for one in self.changes)), default=inf)


def compare_runs(
    scenario: Scenario,
    network: RoadNetwork,
    before: NominalMotion,
    after: NominalMotion,
    *,
    ignored: Collection[str] = (),
    ends: bool = True,
) -> Comparison:
    """Compare runs with and without offsets; `ignored` entities may end in any lane and touch; `ends`: both at once."""
    then, now = runs_of(before.actions), runs_of(after.actions)
    shifts = _Shifts(scenario, network, before, after)
    changes: dict[str, Change] = {}
    event_shifts = []
    for key, action in then.items():
        if action.start > before.end_time - EVENT_TOLERANCE:
            continue  # due in the last moments, it may come after the end just as well
        what = _named(key, action)
        if key not in now:
            if action.start + shifts.largest <= after.end_time - EVENT_TOLERANCE:
                changes.setdefault(what, Change(what, key[1], action.start, "no longer happens"))
            continue
        shift = shifts.of(key, action, now[key])
        event_shifts.append(shift)
        for rest, moved, how in (
            (shift.unexplained_start, shift.start, "happens"),
            (shift.unexplained_end, shift.end, "is over"),
        ):
            if abs(rest) > max(EVENT_TOLERANCE, before.step, after.step) + ROUNDING:
                changes.setdefault(what, Change(what, key[1], action.start, f"{how} {later(moved)}", moved))
    for key, action in now.items():
        if key not in then and action.start <= before.end_time - EVENT_TOLERANCE:
            what, first = _named(key, action), (*key[:2], 0) not in then
            how = HOW_NEW if first else "happens once more"
            changes.setdefault(what, Change(what, key[1], action.start, how))
    others = [*_other_order(then, now), *_other_lanes(network, before, after, ignored)]
    for change in (*others, *(_other_end(shifts, before, after) if ends else ())):
        changes.setdefault(change.what, change)
    touching = [
        {names: at for names, at in contacts_of(gaps_of(run, run.entities)).items() if not set(names) <= {*ignored}}
        for run in (before, after)
    ]
    findings = []
    for names, time in (touching[0] | touching[1]).items():
        at = touching[0].get(names)
        if at is not None and names in touching[1]:
            if abs(time - at) > CONTACT_MOVED:
                what = f"touches '{names[1]}' {later(time - at)} than"
                findings.append(Finding("contact", names[0], at, abs(time - at), what))
        elif at is None or at + shifts.largest <= after.end_time - EVENT_TOLERANCE:
            how = HOW_NEW if at is None else "no longer happens"
            what = f"contact of '{names[0]}' and '{names[1]}' at {time:.1f} s"
            changes.setdefault(what, Change(what, names[0], time, how, pair=names))
    return Comparison(tuple(event_shifts), tuple(changes.values()), tuple(findings))


def later(moved: float) -> str:
    """By how much, in words. [s]"""
    return f"{abs(moved):.2f} s {'later' if moved > 0 else 'earlier'}"


def _named(key: Key, action: PlayedAction) -> str:
    """The event in words."""
    path, actor, _ = key
    whose = "" if actor is None else f" of '{actor}'"
    return f"event '{path[-2] if len(path) > 1 else path[-1]}'{whose} at {action.start:.2f} s"


def runs_of(actions: Sequence[PlayedAction]) -> dict[Key, PlayedAction]:
    """Actions of the source's events, counted for those that run several times, up to `limits.REPEATED_RUNS`."""
    runs: dict[Key, PlayedAction] = {}
    numbers: dict[tuple[Path, str | None], int] = {}
    for played in actions:
        if played.path != ("Init",) and not played.path[0].startswith(STORY_PREFIX):
            number = numbers.get((played.path, played.actor), 0)
            numbers[played.path, played.actor] = number + 1
            if number < REPEATED_RUNS.value:
                runs[played.path, played.actor, number] = played
    return runs


class _Shifts:
    """Shifts of actions, in order of time, each explained by those before it."""

    def __init__(self, scenario: Scenario, network: RoadNetwork, before: NominalMotion, after: NominalMotion) -> None:
        self._network, self._scenario = network, scenario
        self._entities = [{entity.name: entity for entity in run.entities} for run in (before, after)]
        self._ends = before.end_time, after.end_time
        self._triggers: dict[Path, tuple[Condition, ...]] = {  # conditions that the start of each event waits for
            at.path: (*conditions_of(at.act.start_trigger), *conditions_of(at.event.start_trigger))
            for at in scenario.storyboard.events()
        }
        self._starts, self._over = dict[Path, float](), dict[Path, float]()
        self._last = dict[Path, float]()  # when the last of an element's actions is over [s]
        self._of_entity = dict[str, list[float]]()
        self._start_times = dict[str, list[tuple[float, float]]]()
        self.largest = 0.0

    def of(self, key: Key, then: PlayedAction, now: PlayedAction) -> EventShift:
        """One action, after all that began before it."""
        path, actor, _ = key
        start = now.start - then.start
        rest = _nearest(start, self._causes(self._triggers.get(path[:-1], ())))
        begun = self._start_times.setdefault(actor or "", [])
        end, over, duration = start, 0.0, 0.0
        if self._is_over(then, 0) and self._is_over(now, 1):
            assert then.end is not None and now.end is not None
            duration, end = then.end - then.start, now.end - now.start - (then.end - then.start) + start
            expected = [start + longer for longer in self._longer(then, now)]
            cut = [shift for moment, shift in begun if abs(moment - then.end) <= EVENT_TOLERANCE]
            over = _nearest(end, [*expected, *cut])
        begun.append((then.start, start))
        for depth in range(1, len(path) + 1):
            self._starts.setdefault(path[:depth], start)
            last = float("inf") if now.end is None else now.end
            if last >= self._last.get(path[:depth], 0.0):
                self._last[path[:depth]], self._over[path[:depth]] = last, end
        if actor is not None:
            self._of_entity.setdefault(actor, []).extend((start, end))
        self.largest = max(self.largest, start, end)
        event, speed = path[-2] if len(path) > 1 else path[-1], self._lateral_speed(now)
        return EventShift(event, actor, then.start, duration, start, end, rest, over, speed)

    def _lateral_speed(self, now: PlayedAction) -> float:
        """With which an entity comes to a lateral action, with offsets. [m/s]"""
        entity = self._entities[1].get(now.actor or "")
        if entity is None or not isinstance(now.action.content, LATERAL):
            return 0.0
        row = int(np.searchsorted(entity.time, now.start + 1e-9, side="right")) - 1
        if row < 1 or entity.lane[row] != entity.lane[row - 1]:
            return 0.0
        return abs(float(rate(entity.offset[row - 1 : row + 1], entity.time[row - 1 : row + 1])[0]))

    def _is_over(self, played: PlayedAction, run: int) -> bool:
        """Before its run is: what the run's end cuts has no end of its own."""
        return played.end is not None and played.end < self._ends[run] - EVENT_TOLERANCE

    def of_end(self, moved: float) -> float:
        """What of the end's shift is unexplained. [s]"""
        return _nearest(moved, self._causes(conditions_of(self._scenario.storyboard.stop_trigger)))

    def _causes(self, conditions: Collection[Condition] | Iterator[Condition]) -> list[float]:
        """Shifts that conditions may pass on: of elements that they wait for, of entities that they look at."""
        causes, others = list[float](), 0
        for condition in conditions:
            content = condition.content
            if isinstance(content, StoryboardElementStateCondition):
                starts = content.state in (StoryboardElementState.START_TRANSITION, StoryboardElementState.RUNNING)
                known = self._starts if starts else self._over
                causes += [shift for path, shift in known.items() if refers_to(content, path)]
                continue
            others += 1
            moved = [
                abs(shift) for name in set(entity_references(condition)) for shift in self._of_entity.get(name, ())
            ]
            far = LARGEST_DELAY_RATIO * max(moved, default=0.0)
            causes += np.arange(-far, far, EVENT_TOLERANCE / 5.0).tolist()
        return causes if causes and not others else [*causes, 0.0]

    def _longer(self, then: PlayedAction, now: PlayedAction) -> list[float]:
        """By how much longer the action may last for its way. [s]"""
        powers = _powers(now)
        duration = (then.end or 0.0) - then.start
        ways = [self._way(entities, run) for entities, run in zip(self._entities, (then, now), strict=True)]
        if not powers or min(ways) < LEAST_WAY:
            return [0.0]
        slower = _stated_rate(then) / _stated_rate(now)
        return [duration * ((ways[1] / ways[0]) ** power * slower - 1.0) for power in powers]

    def _way(self, entities: Mapping[str, EntityMotion], played: PlayedAction) -> float:
        """How far it leads across the road. [m]"""
        entity = entities.get(played.actor or "")
        if entity is None or played.end is None:
            return 0.0
        rows = np.clip(
            np.searchsorted(entity.time, [played.start + 1e-9, played.end + 1e-9], side="right") - 1, 0, None
        )
        road, lane, s = entity.road[rows], entity.lane[rows], entity.s[rows]
        if (road < 0).any():
            return 0.0
        t = self._network.offset_to_t(road, lane, s, entity.offset[rows])
        return float(abs(t[1] - t[0]))


def _stated_rate(played: PlayedAction) -> float:
    """Of a lane change that states one, 1 of others. [m/s]"""
    content = played.action.content
    is_rate = isinstance(content, LaneChangeAction) and content.dynamics.dimension is DynamicsDimension.RATE
    return float(content.dynamics.value) if is_rate and content.dynamics.value > 0.0 else 1.0


def _powers(played: PlayedAction) -> tuple[float, ...]:
    """By which power of its way a lateral action's duration changes; none: it does not."""
    content = played.action.content
    if isinstance(content, LaneChangeAction):
        return (1.0,) if content.dynamics.dimension is DynamicsDimension.RATE else ()
    if isinstance(content, LaneOffsetAction):
        return (0.5,)
    return (0.0, 0.5, 1.0) if isinstance(content, LateralDistanceAction) else ()


def _nearest(shift: float, causes: Sequence[float]) -> float:
    """What is left of a shift beside the cause that explains most of it. [s]"""
    return min((shift - cause for cause in causes), key=abs, default=shift)


def _other_order(then: Mapping[Key, PlayedAction], now: Mapping[Key, PlayedAction]) -> Iterator[Change]:
    """Events that come before one that they came after."""
    both = sorted((key for key in then if key in now), key=lambda key: then[key].start)
    for first, second in pairwise(both):
        apart = then[second].start - then[first].start, now[second].start - now[first].start
        if apart[0] > EVENT_TOLERANCE and apart[1] < -EVENT_TOLERANCE:
            yield Change(_named(second, then[second]), second[1], then[second].start, f"comes before '{first[0][-2]}'")


def _other_end(shifts: _Shifts, before: NominalMotion, after: NominalMotion) -> Iterator[Change]:
    moved = after.end_time - before.end_time
    if before.ended_by == after.ended_by and abs(shifts.of_end(moved)) > EVENT_TOLERANCE + max(before.step, after.step):
        what = f"the end ({before.ended_by}) at {before.end_time:.2f} s"
        yield Change(what, None, before.end_time, f"comes {later(moved)}", moved)


def _other_lanes(
    network: RoadNetwork, before: NominalMotion, after: NominalMotion, ignored: Collection[str]
) -> Iterator[Change]:
    """Who ends in another lane, and not beside a marking that is as near to where it ended before."""
    then = {entity.name: _last_places(entity, after.end_time, network) for entity in before.entities}
    for entity in after.entities:
        lanes, road, t, _ = _last_places(entity, before.end_time, network)
        were, on, was, width = then.get(entity.name, (lanes, road, t, 0.0))
        is_apart = road != on or abs(t - was) > 0.5 * width
        if entity.name not in ignored and is_apart and not set(were) & set(lanes):
            yield Change(
                f"the last lane of '{entity.name}', {were[-1]},", entity.name, before.end_time, f"is {lanes[-1]}"
            )


def _last_places(entity: EntityMotion, end: float, network: RoadNetwork) -> tuple[list[int], int, float, float]:
    """Where both runs are still on: the lane in which it ends, after those that it has just left; road, t and width."""
    near = (entity.time <= end) & (entity.time >= min(end, float(entity.time[-1])) - EVENT_TOLERANCE)
    rows = np.flatnonzero(near) if near.any() else np.zeros(1, dtype=np.int64)
    road, lane, s = (int(entity.road[rows[-1]]), int(entity.lane[rows[-1]]), float(entity.s[rows[-1]]))
    lanes, t, width = entity.lane[rows].tolist(), 0.0, 0.0
    if road >= 0 and network.has_lane_at(road, lane, s):
        t = float(network.offset_to_t(road, lane, s, float(entity.offset[rows[-1]])))
        width = network.lane_state_at(road, lane, s).width
    return lanes, road, t, width


def largest_of(comparisons: Sequence[Comparison]) -> tuple[EventShift, ...]:
    """Each event once for every way of driving, with its largest shift there: in order of these ways, and of time."""
    largest: dict[tuple[str, str, str | None], EventShift] = {}
    shifts = [shift for comparison in comparisons for shift in comparison.shifts]
    for shift in sorted(shifts, key=lambda shift: max(abs(shift.start), abs(shift.end)), reverse=True):
        largest.setdefault((shift.run, shift.event, shift.entity), shift)
    runs = list(dict.fromkeys(shift.run for shift in shifts))
    return tuple(sorted(largest.values(), key=lambda shift: (runs.index(shift.run), shift.time)))
