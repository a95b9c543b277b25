"""Whether a written scenario still means what its source does: both are played, the ego driving in several ways.

Events keep their number, order and last lanes, contacts and the end stay; times shift only by what lateral actions that
take longer or shorter from beside the middle explain (`shifts`). Otherwise moves before the conflict become smaller.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import TypeVar

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.note import Note
from xosc_lateral.base.track import Track
from xosc_lateral.files.openscenario.write.replaced_maneuvers import replaced_groups
from xosc_lateral.workflows.conversion.consequences import lane_departures
from xosc_lateral.workflows.conversion.ego_drives import OTHER_RUNS, drives, with_speeds
from xosc_lateral.workflows.conversion.load import Played
from xosc_lateral.workflows.conversion.movement import changed_movement, moving_share
from xosc_lateral.workflows.conversion.result import NOMINAL_RUN, Enriched, EntityResult, EventShift, nominal_result
from xosc_lateral.workflows.conversion.shifts import EVENT_TOLERANCE, Change, Comparison, compare_runs, largest_of
from xosc_lateral.world.motion.gaps import gaps_of
from xosc_lateral.world.motion.nominal import POSE, EntityMotion, NominalMotion
from xosc_lateral.world.motion.offset_path import OffsetPath, resized
from xosc_lateral.world.player.player import play
from xosc_lateral.world.scenario.conditions import StoryboardElementStateCondition, at_time
from xosc_lateral.world.scenario.enums import (
    ConditionEdge,
    StoryboardElementState,
    StoryboardElementType,
)
from xosc_lateral.world.scenario.scenario import (
    Condition,
    ConditionGroup,
    Scenario,
)

LONGER = 1.3
"""Times the longest of these runs, for which offsets last: some egos come to a place later still. [-]"""
LEAST_TIME = 60.0
"""For which they do at least: where an end hangs on what a vehicle under test does, it may come late. [s]"""
TRIAL_STEP = 0.05
"""Of runs under other egos: they are about what happens. [s]"""
OTHER_FRAMES = (0.9, 2.5)
"""Times a run's step, in which the source is played again where an output does something else. [-]"""
AFTERMATH_TIME = 2.0
"""After the last event of all, such a run is over: the last lane is reached, contacts have come about. [s]"""

CHANGES = "with offsets, what happens would happen otherwise"

LONGEST_RUN = 3.0
"""Times the nominal run, or what happens in one that does not end by itself, each run is played: beyond, all
movement is again what it was. [-]"""
LEAST_DURATION = 20.0
"""Of that run. [s]"""

SIZES = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Times what was sampled, tried for the offsets before a conflict, in order. [-]"""
LARGE_SHIFT = 0.3
"""Of its duration, by which an action lasts longer or shorter without a word. [-]"""
LEAST_MOVING = 0.9
"""Share of driving time below which it is told. [-]"""
MOST_TRIALS = 40
"""Of a conversion: beyond, what is left is told. [-]"""

Output = TypeVar("Output")

Sizes = dict[int, float]
"""By the number of a path, where it is driven otherwise than sampled."""


class EventEquivalence:
    """What happens in a source, nominally and under other egos; `egos`: vehicles under test; `time_limit` [s]."""

    def __init__(self, played: Played, egos: tuple[str, ...], *, step: float, time_limit: float | None) -> None:
        self._played, self._egos, self._step = played, egos, step
        motion = played.motion
        self._is_cut_off = motion.cut_off is not None
        last = max((one.start if one.end is None else one.end for one in motion.actions), default=0.0)
        until = last if self._is_cut_off else motion.end_time
        self.limit = min(inf if time_limit is None else time_limit, LONGEST_RUN * max(until, LEAST_DURATION))
        self._drives = drives(motion, egos)
        self._order = list(range(len(self._drives)))  # in which an output's runs are played
        self._before = [self._run(played.scenario, k) for k in self._order]
        self._chance: dict[tuple[str, frozenset[str]], dict[str, float]] = {}

    @property
    def runs(self) -> Iterator[tuple[str, NominalMotion]]:
        """Of the source: how vehicles under test drive, and what is played then."""
        return zip((NOMINAL_RUN, *OTHER_RUNS), (motion for _, motion in self._before), strict=False)

    @property
    def end(self) -> float:
        """Of the longest run, that under a braking ego aside. [s]"""
        return max(motion.end_time for _, motion in self._before[:3])

    @property
    def longest_time(self) -> float:
        """Time that a run may take. [s]"""
        return max(LEAST_TIME, LONGER * max(motion.end_time for _, motion in self._before))

    def farthest(self, name: str) -> float:
        """Distance that an entity may drive in that time, as fast as it ever is in a run. [m]"""
        runs = (one for _, motion in self._before for one in motion.entities if one.name == name)
        return self.longest_time * max(float(np.abs(one.speed).max()) for one in runs)

    def _run(self, scenario: Scenario, k: int) -> tuple[Scenario, NominalMotion]:
        """The k-th run, and what was played; all but the nominal one in coarser steps, until nothing is left to do."""
        source, motion, network = self._played.scenario, self._played.motion, self._played.network
        if k == 0 and scenario is source and not self._is_cut_off:
            return scenario, motion
        if k == 0:
            return scenario, play(scenario, network, step=self._step, time_limit=self.limit)
        driven = with_speeds(_ending_with(scenario, source), motion, self._egos, self._drives[k])
        return driven, play(driven, network, step=max(self._step, TRIAL_STEP), time_limit=self.limit)

    def compare(
        self, scenario: Scenario, trajectories: Collection[str], moved: Collection[str], *, most: float = inf
    ) -> tuple[list[Comparison], NominalMotion | None]:
        """With an output in which some entities follow trajectories and others are moved beside their maneuvers.

        Each run with its own, as long as they differ in less than `most`; and the nominal run of the output, if it was
        played. What differed last is looked at first.
        """
        network, gone = self._played.network, {one.path for one in replaced_groups(self._played.scenario, trajectories)}
        comparisons, nominal_run = dict[int, Comparison](), None
        for k in self._order:
            name, (driven, before), (_, run) = (NOMINAL_RUN, *OTHER_RUNS)[k], self._before[k], self._run(scenario, k)
            nominal_run = run if k == 0 else nominal_run
            kept = (one for one in before.actions if one.path[:3] not in gone and one.actor not in trajectories)
            nominal = replace(before, actions=tuple(kept))
            ends = k == 0 or not gone  # else stories that others wait for may be gone
            comparison = compare_runs(driven, network, nominal, run, ignored=trajectories, ends=ends)
            if comparison.changes:
                key = name, frozenset(trajectories)
                if key not in self._chance:  # of the source alone: the same for all that is tried
                    self._chance[key] = self._by_chance(driven, nominal, trajectories)
                others = (one for one in comparison.changes if abs(one.size) > self._chance[key].get(one.what, 0.0))
                comparison = structs.replace(comparison, changes=tuple(others))
            movement = changed_movement(network, before, run, moved)
            shares = {one.name: moving_share(one) for one in run.entities if one.name in moved}
            changes = tuple(structs.replace(one, run=name) for one in (*comparison.changes, *movement))
            shifts = tuple(structs.replace(one, run=name) for one in comparison.shifts)
            comparisons[k] = Comparison(shifts, changes, shares, name)
            if len(changes_of(comparisons.values())) >= most:
                break
        self._order.sort(key=lambda k: -len(comparisons[k].changes) if k in comparisons else 0)
        return [comparisons[k] for k in sorted(comparisons)], nominal_run

    def _by_chance(self, driven: Scenario, before: NominalMotion, trajectories: Collection[str]) -> dict[str, float]:
        """What a source itself does otherwise, and by how much, in other frames: two things that meet in one. [s]"""
        network, chance = self._played.network, dict[str, float]()
        for factor in OTHER_FRAMES:
            again = play(driven, network, step=factor * before.step, time_limit=self.limit)
            ends = before.ended_by == again.ended_by
            compared = compare_runs(driven, network, before, again, ignored=trajectories, ends=ends)
            sizes = {one.what: abs(one.size) + again.step for one in compared.changes}
            chance |= {what: max(size, chance.get(what, 0.0)) for what, size in sizes.items()}
        return chance


def _ending_with(scenario: Scenario, source: Scenario) -> Scenario:
    """A scenario that ends, at the latest, some time after all stories of its source are complete."""
    storyboard, stories = scenario.storyboard, source.storyboard.stories
    place, stop = storyboard.place, storyboard.stop_trigger
    if not stories or stop is None:
        return scenario
    kind, state = StoryboardElementType.STORY, StoryboardElementState.COMPLETE
    contents = (StoryboardElementStateCondition(kind, story.name, state, place=place) for story in stories)
    over = (Condition("over", AFTERMATH_TIME, ConditionEdge.NONE, content, None, place) for content in contents)
    trigger = structs.replace(stop, groups=(*stop.groups, ConditionGroup(tuple(over))))
    return replace(scenario, storyboard=structs.replace(storyboard, stop_trigger=trigger))


@dataclass(frozen=True, slots=True)
class EquivalentPaths:
    """Paths that leave what happens as it was, the runs with them, and what is left that could not be mended."""

    paths: tuple[OffsetPath, ...]
    comparisons: tuple[Comparison, ...]
    changes: tuple[Change, ...]
    smaller: dict[str, tuple[float, bool]]  # entity -> least size of its offsets; whether all paths are smaller

    @property
    def shifts(self) -> tuple[EventShift, ...]:
        """The largest of each event in every run."""
        return largest_of(self.comparisons)

    @property
    def moving(self) -> dict[str, tuple[float, str]]:
        """The least share of its driving time in which each entity moves sideways [-], and the run in which it is."""
        least: dict[str, tuple[float, str]] = {}
        for comparison in self.comparisons:
            for name, share in comparison.moving.items():
                here = 1.0 if share is None else share, comparison.run
                least[name] = min(least.get(name, here), here, key=lambda each: each[0])
        return least

    @property
    def trial_contacts(self) -> tuple[str, ...]:
        """New contacts that only come about under other egos, a line each."""
        nominal = {change.pair for change in self.changes if change.run == NOMINAL_RUN}
        return tuple(str(one) for one in self.changes if one.pair is not None and one.pair not in nominal)

    def warnings(self, unmoved: Collection[str], known: Collection[tuple[str, str]] = ()) -> Iterator[Note]:
        """Who stays as it is, whose moves are smaller, what takes much longer, what happens otherwise.

        `known`: contacts in the nominal run that others tell of
        """
        for name in sorted(unmoved & self.smaller.keys()):
            yield Note(f"'{name}' stays as it is: {CHANGES}", is_warning=True, entity=name)
        for name, (factor, everywhere) in sorted(self.smaller.items()):
            if name not in unmoved:
                size = f"{factor:g} times what was sampled" if factor else "none"
                where = "" if everywhere else " before a maneuver"
                yield Note(f"offsets of '{name}' are {size}{where}: {CHANGES}", is_warning=True, entity=name)
        for name, (share, run) in sorted(self.moving.items()):
            if share < LEAST_MOVING:
                moves = f"moves sideways in {share:.0%} of the time that it drives" if share else "never moves sideways"
                yield Note(f"'{name}' {moves}", is_warning=True, entity=name, run=run)
        listed = set[tuple[str, str | None]]()
        for shift in self.shifts:
            longer = shift.end - shift.start
            is_explained = abs(shift.unexplained_end) <= EVENT_TOLERANCE
            is_long = is_explained and shift.duration > 0.0 and abs(longer) > LARGE_SHIFT * shift.duration
            if is_long and (shift.event, shift.entity) not in listed:
                listed.add((shift.event, shift.entity))
                what = (
                    f"event '{shift.event}' of '{shift.entity}' at {shift.time:.2f} s lasts "
                    f"{shift.duration + longer:.2f} instead of {shift.duration:.2f} s: its way across is another one"
                )
                yield Note(what, is_warning=True, entity=shift.entity, run=shift.run)
        yield from (one.note for one in self.changes if one.run != NOMINAL_RUN or one.pair not in known)


def shrink_until_equivalent(
    paths: Sequence[OffsetPath],
    motion: NominalMotion,
    attempt: Callable[[Sequence[OffsetPath], float], tuple[Output, list[Comparison]]],
) -> tuple[Output, EquivalentPaths]:
    """Paths as large as leave what happens as it was, and the output with them.

    `attempt` writes some and plays, until as much happens otherwise as it is told.
    """
    sizes: Sizes = {}
    trials = 1

    def applied(some: Sizes) -> list[OffsetPath]:
        driven = [resized(path, some[k]) if k in some else path for k, path in enumerate(paths)]
        return [path for path in driven if path.pieces or path.settles]

    output, comparisons = attempt(paths, inf)
    changes = changes_of(comparisons)
    stuck = set[tuple[int, int]]()
    while changes and trials < MOST_TRIALS:
        blamed = _blamed(changes, paths, motion, sizes, stuck)
        if blamed is None:
            break
        for smaller in SIZES[SIZES.index(sizes.get(blamed, 1.0)) + 1 :]:
            trial = sizes | {blamed: smaller}
            made, outcome = attempt(applied(trial), len(changes))
            trials += 1
            if len(changes_of(outcome)) < len(changes):
                sizes, output, comparisons, changes = trial, made, outcome, changes_of(outcome)
                break
        else:
            stuck.add((blamed, len(changes)))
    least: dict[str, tuple[float, bool]] = {}
    for name in dict.fromkeys(paths[k].entity for k in sizes):
        theirs = [k for k, path in enumerate(paths) if path.entity == name]
        least[name] = min(sizes.get(k, 1.0) for k in theirs), all(k in sizes for k in theirs)
    return output, EquivalentPaths(tuple(applied(sizes)), tuple(comparisons), tuple(changes), least)


def changes_of(comparisons: Iterable[Comparison]) -> list[Change]:
    """Each once."""
    return list({change.what: change for comparison in comparisons for change in comparison.changes}.values())


def _blamed(
    changes: Sequence[Change],
    paths: Sequence[OffsetPath],
    motion: NominalMotion,
    sizes: Sizes,
    stuck: Collection[tuple[int, int]],
) -> int | None:
    """The path that most likely changes what happens: its entity's, the nearest before; else any other."""

    def begins(path: OffsetPath) -> float:
        starts = [one.start for one in motion.actions if one.path == path.after]
        return 0.0 if path.after is None else min(starts, default=inf)

    order: list[int] = []
    for change in changes:
        theirs = [k for k, path in enumerate(paths) if path.entity == change.entity]
        order += sorted(theirs, key=lambda k: (begins(paths[k]) > change.time, -begins(paths[k])))
    order += range(len(paths))
    free = (
        k for k in order if sizes.get(k, 1.0) > SIZES[-1] and (k, len(changes)) not in stuck and not paths[k].instead
    )
    return next(free, None)


def ending_at(scenario: Scenario, end: float) -> Scenario:
    """The same scenario, stopped at a time and by nothing else. [s]"""
    storyboard = scenario.storyboard
    later = structs.replace(storyboard, stop_trigger=at_time(end, "later", storyboard.place))
    return replace(scenario, storyboard=later)


def as_played(
    enriched: Enriched, written: Scenario, run: NominalMotion, moved: Collection[str], unmoved: Collection[str]
) -> Enriched:
    """What a reactive output does when it is played, in place of what was sampled.

    - `written`, `run`: the output and its nominal run, which may end earlier than the one that was sampled for
    - `moved`, `unmoved`: entities that keep their maneuvers: those with lane offsets, and those that stay as they are
    """
    motion = enriched.motion
    if run.end_time < motion.end_time - motion.step:
        later = ending_at(written, motion.end_time)
        run = play(later, enriched.network, step=motion.step, time_limit=motion.end_time + motion.step)
    played = {entity.name: entity for entity in run.entities}
    entities = tuple(
        _measured(entity, played[entity.name])
        if entity.name in moved
        else nominal_result(entity.motion, entity.spans, CHANGES)
        if entity.name in unmoved
        else entity
        for entity in enriched.entities
    )
    gaps_after = gaps_of(motion, [entity.trajectory for entity in entities])
    departures = tuple(departure for entity in entities for departure in lane_departures(entity, enriched.network))
    return replace(enriched, entities=entities, gaps_after=gaps_after, departures=departures)


def _measured(entity: EntityResult, played: EntityMotion) -> EntityResult:
    """One entity where it is when the output is played, held where that ends first."""
    motion = entity.motion
    rows = np.minimum(np.arange(len(motion.time)), len(played.time) - 1)
    path = Track(motion.name, motion.time, {name: played.columns[name][rows] for name in POSE}, motion.breaks)
    across, ahead = path.y - motion.y, path.x - motion.x
    deviation: FloatArray = across * np.cos(motion.heading) - ahead * np.sin(motion.heading)
    segments = tuple(
        replace(segment, offset=np.interp(segment.time, motion.time, deviation), beyond=np.empty(0))
        for segment in entity.segments
    )
    return replace(entity, segments=segments, deviation=deviation, trajectory=path)
