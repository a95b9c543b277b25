"""Whether a written scenario still means what its source does: both are played, the ego driving in several ways.

Events keep their number, order and last lanes, contacts and the end stay; times shift only by what lateral actions that
take longer or shorter from beside the middle explain (`shifts`). Otherwise moves before the conflict become smaller.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from math import inf

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.track import Track
from xosc_lateral.files.openscenario.write.replaced_maneuvers import replaced_groups
from xosc_lateral.workflows.conversion.consequences import lane_departures
from xosc_lateral.workflows.conversion.ego_drives import drives, with_speeds
from xosc_lateral.workflows.conversion.equivalent_paths import CHANGES, RUN_NAMES, Runs
from xosc_lateral.workflows.conversion.load import Played
from xosc_lateral.workflows.conversion.result import Enriched, EntityResult, nominal_result
from xosc_lateral.workflows.conversion.shifts import (
    EVENT_TOLERANCE,
    Change,
    Comparison,
    compare_runs,
    runs_of,
)
from xosc_lateral.world.motion.gaps import gaps_of
from xosc_lateral.world.motion.look import look_at, rests_beside
from xosc_lateral.world.motion.nominal import POSE, EntityMotion, NominalMotion
from xosc_lateral.world.player.player import play
from xosc_lateral.world.scenario.conditions import StoryboardElementStateCondition, at_time
from xosc_lateral.world.scenario.enums import ConditionEdge, StoryboardElementState, StoryboardElementType
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

LONGEST_RUN = 3.0
"""Times the nominal run, or what happens in one that does not end by itself, each run is played: beyond, all
movement is again what it was. [-]"""
LEAST_DURATION = 20.0
"""Of that run. [s]"""


class EventEquivalence:
    """What happens in a source, nominally and under other egos; `egos`: vehicles under test; `time_limit` [s]."""

    def __init__(self, played: Played, egos: tuple[str, ...], *, step: float, time_limit: float | None) -> None:
        self._played, self._egos, self._step = played, egos, step
        motion = played.motion
        self._is_cut_off = motion.cut_off is not None
        last = max((one.start if one.end is None else one.end for one in motion.actions), default=0.0)
        until = last if self._is_cut_off else motion.end_time
        self.limit = min(inf if time_limit is None else time_limit, LONGEST_RUN * max(until, LEAST_DURATION))
        self._drives = drives(motion, egos, played.network)
        self._before: list[tuple[Scenario, NominalMotion]] = []
        for k in range(len(self._drives)):
            self._before.append(self._run(played.scenario, k))
        # an output's runs: not those in which an ego changes nothing for anybody
        self._order = [k for k in range(len(self._drives)) if not any(self._alike(k, j) for j in range(k))]
        self._chance: dict[tuple[int, frozenset[str]], dict[str, float]] = {}

    @property
    def runs(self) -> Iterator[tuple[str, NominalMotion]]:
        """Of the source: how vehicles under test drive, and what is played then."""
        return zip(RUN_NAMES, (motion for _, motion in self._before), strict=False)

    @property
    def end(self) -> float:
        """Of the longest run, those under egos that stop aside. [s]"""
        return max(motion.end_time for _, motion in self._before[:3])

    @property
    def longest_time(self) -> float:
        """Time that a run may take. [s]"""
        return max(LEAST_TIME, LONGER * max(motion.end_time for _, motion in self._before[:4]))

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
        driven = with_speeds(_ending_with(scenario, source), motion, self._egos, *self._drives[k])
        limit = self.limit if k < 4 else min(self.limit, self.longest_time)
        return driven, play(driven, network, step=max(self._step, TRIAL_STEP), time_limit=limit)

    def _alike(self, k: int, j: int) -> bool:
        """Whether everything happens in two runs of the source at the same times and places, the egos aside."""
        (_, this), (_, other) = self._before[k], self._before[j]
        then, now = runs_of(this.actions), runs_of(other.actions)
        others = [both for both in zip(this.entities, other.entities, strict=True) if both[0].name not in self._egos]
        return (
            then.keys() == now.keys()
            and all(abs(then[key].start - now[key].start) <= EVENT_TOLERANCE for key in then)
            and not any(_is_elsewhere(*both) for both in others)
        )

    def compare(
        self, scenario: Scenario, trajectories: Collection[str], moved: Collection[str], *, first: Collection[str] = ()
    ) -> Runs:
        """With an output in which some entities follow trajectories and others are moved beside their maneuvers.

        Each run with its own, played when it is asked for, some of them first.
        """
        network, gone = self._played.network, {one.path for one in replaced_groups(self._played.scenario, trajectories)}
        for k in sorted(self._order, key=lambda k: RUN_NAMES[k] not in first):
            name, (driven, before), (_, run) = RUN_NAMES[k], self._before[k], self._run(scenario, k)
            kept, still = (
                replace(motion, actions=tuple(
                    one for one in motion.actions if one.path[:3] not in gone and one.actor not in trajectories
                ))
                for motion in (before, run)
            )  # fmt: skip
            ends = k == 0 or not gone  # else stories that others wait for may be gone
            comparison = compare_runs(driven, network, kept, still, ignored=trajectories, ends=ends)
            by_chance: tuple[Change, ...] = ()
            if comparison.changes:
                if (key := (k, frozenset(trajectories))) not in self._chance:  # the same for all that is tried
                    self._chance[key] = self._by_chance(driven, kept, trajectories)
                hangs = [abs(one.size) <= self._chance[key].get(one.about, 0.0) for one in comparison.changes]
                by_chance, others = (
                    tuple(one for one, does in zip(comparison.changes, hangs, strict=True) if does is which)
                    for which in (True, False)
                )
                comparison = structs.replace(comparison, changes=others)
            findings = list(look_at(network, before, run, {*moved, *trajectories}, shifted=comparison.first))
            meant = (
                Change(f"'{one.entity}' at {one.time:.1f} s", one.entity, one.time, one.what)
                for one in findings
                if one.is_meaning
            )
            rests = (finding for one in run.entities if one.name in moved for finding in rests_beside(one))
            changes, by_chance = (
                tuple(structs.replace(one, run=name) for one in some)
                for some in ((*comparison.changes, *meant), by_chance)
            )
            shifts = tuple(structs.replace(one, run=name) for one in comparison.shifts)
            # contacts: nominally they are told of all pairs (`contact_notes`)
            remarks = (*(comparison.findings if k else ()), *(one for one in findings if not one.is_meaning), *rests)
            yield Comparison(shifts, changes, remarks, by_chance, name), run

    def _by_chance(self, driven: Scenario, before: NominalMotion, trajectories: Collection[str]) -> dict[str, float]:
        """What a source itself does otherwise, and by how much, in other frames: two things that meet in one. [s]"""
        network, chance = self._played.network, dict[str, float]()
        for factor in OTHER_FRAMES:
            again = play(driven, network, step=factor * before.step, time_limit=self.limit)
            ends = before.ended_by == again.ended_by
            compared = compare_runs(driven, network, before, again, ignored=trajectories, ends=ends)
            for change in compared.changes:
                chance[change.about] = max(abs(change.size) + again.step, chance.get(change.about, 0.0))
        return chance


def _is_elsewhere(entity: EntityMotion, twin: EntityMotion) -> bool:
    """Whether an entity is ever elsewhere than in another run, as long as that lasts."""
    time = entity.time[entity.time <= twin.time[-1]]
    apart = [entity.columns[name][: len(time)] - np.interp(time, twin.time, twin.columns[name]) for name in "xy"]
    return bool((np.hypot(*apart) > EVENT_TOLERANCE * (1.0 + np.abs(entity.speed[: len(time)]))).any())


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
