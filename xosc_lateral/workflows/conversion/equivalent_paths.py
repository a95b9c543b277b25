"""Paths that leave what happens as it was: moves before a conflict become smaller, and what is left is told."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Generic, TypeVar

from xosc_lateral.base.grouping import grouped
from xosc_lateral.base.note import Note
from xosc_lateral.workflows.conversion.across import WAY_WORDS, Way
from xosc_lateral.workflows.conversion.ego_drives import OTHER_RUNS
from xosc_lateral.workflows.conversion.result import NOMINAL_RUN, EventShift
from xosc_lateral.workflows.conversion.shifts import EVENT_TOLERANCE, HOW_NEW, Change, Comparison, largest_of, later
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.motion.offset_path import OffsetPath, resized

RUN_NAMES = (NOMINAL_RUN, *OTHER_RUNS)
"""Of a scenario: how vehicles under test drive in them, in words."""

CHANGES = "with offsets, what happens would happen otherwise"

SIZES = (0.5, 0.25, 0.0)
"""Times what was sampled, tried for the offsets before a conflict, in order. [-]"""
LATE, LATE_END = 0.1, 0.5
"""By which an event begins and ends earlier or later without a word, if it is explained. [s]"""
MOST_TRIALS = 12
"""Of a conversion: beyond, nobody else is tried, and what is left is told. [-]"""

Output = TypeVar("Output")

Sizes = dict[tuple[str, int], float]
"""By the entity and number among its paths, where one is driven otherwise than sampled."""


@dataclass(frozen=True, slots=True)
class EquivalentPaths:
    """Paths that leave what happens as it was, the runs with them, and what is left that could not be mended."""

    paths: tuple[OffsetPath, ...]
    comparisons: tuple[Comparison, ...]
    changes: tuple[Change, ...]
    smaller: dict[str, tuple[float, bool]]  # entity -> least size of its offsets; whether all paths are smaller
    ways: Mapping[str, Way]  # entity -> how its lane changes lead across, where not as they should
    mended: Mapping[str, Change] = field(default_factory=dict)  # entity -> what its moves would make happen otherwise

    @property
    def shifts(self) -> tuple[EventShift, ...]:
        """The largest of each event in every run."""
        return largest_of(self.comparisons)

    @property
    def trial_contacts(self) -> tuple[str, ...]:
        """New contacts that only come about under other egos, a line each."""
        nominal = {change.pair for change in self.changes if change.run == NOMINAL_RUN}
        return tuple(str(one) for one in self.changes if one.pair and one.how == HOW_NEW and one.pair not in nominal)

    def warnings(self, unmoved: Collection[str], known: Collection[tuple[str, str]] = ()) -> Iterator[Note]:
        """Who stays as it is, whose moves are smaller, what takes much longer, what happens otherwise.

        `known`: contacts in the nominal run that others tell of
        """
        for name, (factor, everywhere) in sorted(self.smaller.items()):
            size = f"{factor:g} times what was sampled" if factor else "none"
            smaller = f"offsets of '{name}' are {size}{'' if everywhere else ' before a maneuver'}"
            what = f"'{name}' stays as it is" if name in unmoved else smaller
            yield self._note(what, name, is_warning=True)
        for name, way in sorted(self.ways.items()):
            yield self._note(f"lane changes of '{name}' {WAY_WORDS[way]}", name)
        listed = set[tuple[str, str | None]]()
        for shift in self.shifts:
            longer, event = shift.end - shift.start, f"event '{shift.event}' of '{shift.entity}' at {shift.time:.2f} s"
            is_explained = max(abs(shift.unexplained_start), abs(shift.unexplained_end)) <= EVENT_TOLERANCE
            if not is_explained or (shift.event, shift.entity) in listed:
                continue
            if abs(longer) > LATE_END:
                its = (
                    f"lasts {shift.duration + longer:.2f} instead of {shift.duration:.2f} s: its way across is another"
                )
            elif abs(shift.start) > LATE:
                its = f"comes {later(shift.start)}: what it waits for does"
            else:
                continue
            listed.add((shift.event, shift.entity))
            yield Note(f"{event} {its}", is_warning=True, entity=shift.entity, run=shift.run)
        yield from self._findings()
        for change in {
            change.what: change for compared in reversed(self.comparisons) for change in compared.by_chance
        }.values():
            what = f"{change.what} {change.how}: it hangs on a frame of the player, without offsets as well"
            yield Note(what, entity=change.entity, run=change.run)
        yield from (change.note for change in self.changes if change.run != NOMINAL_RUN or change.pair not in known)

    def _note(self, what: str, name: str, *, is_warning: bool = False) -> Note:
        """What is otherwise than sampled, and what would happen else."""
        change = self.mended.get(name)
        why = CHANGES if change is None else f"with offsets, {change.what} {change.how}"
        return Note(f"{what}: {why}", is_warning=is_warning, entity=name, run=None if change is None else change.run)

    def _findings(self) -> Iterator[Note]:
        """The worst of each kind for each vehicle, with its run."""
        for alikes in grouped(
            ((one.entity, one.kind), (one, compared.run)) for compared in self.comparisons for one in compared.findings
        ).values():
            worst, run = max(alikes, key=lambda each: each[0].size)
            yield worst.note(run, len(alikes) - 1)


Ways = dict[str, Way]
Driven = tuple[Ways, Sizes]
"""How lane changes of some vehicles lead across, and of what size some paths are."""
Runs = Iterator[tuple[Comparison, NominalMotion]]
"""Of an output, each compared with the source's own."""


@dataclass(slots=True)
class _Trial(Generic[Output]):
    """An output that is tried, and what came of those of its runs that were played so far."""

    driven: Driven
    output: Output
    runs: Runs
    comparisons: list[Comparison] = field(default_factory=list)
    nominal: NominalMotion | None = None  # its nominal run, if that was played

    def changes(self, most: float = inf, runs: float = inf) -> list[Change]:
        """What happens otherwise: in all runs, or in as many as show `most` of it, or in so many."""
        changes = changes_of(self.comparisons)
        while len(changes) < most and len(self.comparisons) < runs and (played := next(self.runs, None)):
            comparison, run = played
            self.comparisons.append(comparison)
            self.nominal = run if comparison.run == NOMINAL_RUN else self.nominal
            changes = changes_of(self.comparisons)
        return changes


def largest_equivalent(
    made: Callable[[Ways], Sequence[OffsetPath]],
    motion: NominalMotion,
    attempt: Callable[[Sequence[OffsetPath], Collection[str]], tuple[Output, Runs]],
) -> tuple[Output, NominalMotion | None, EquivalentPaths]:
    """The largest movement that leaves what happens as it was, as far as any of it does; its output and nominal run.

    Vehicle by vehicle: whose staying as written mends something is to blame, and moves as much as leaves it mended. How
    much that is, is looked for in the runs in which something happened otherwise; what is kept was played in all.

    - `made`: paths where lane changes of some vehicles lead across otherwise than they should
    - `attempt`: writes paths; the output, and its runs as they are asked for, some of them first
    """

    trials, changed, mended = 0, list[str](), dict[str, Change]()
    kept: Driven = {}, {}

    def applied(ways: Ways, sizes: Sizes) -> list[OffsetPath]:
        numbers, driven = Counter[str](), list[OffsetPath]()
        for path in made(ways):
            key = path.entity, numbers[path.entity]
            numbers[path.entity] += 1
            driven.append(resized(path, sizes[key]) if key in sizes else path)
        return [path for path in driven if path.pieces or path.settles]

    def tried(ways: Ways, sizes: Sizes) -> _Trial[Output]:
        nonlocal trials
        trials += 1
        driven = kept[0] | ways, kept[1] | sizes
        return _Trial(driven, *attempt(applied(*driven), changed))

    best = tried({}, {})
    changes = best.changes()
    names = dict.fromkeys(path.entity for path in made({}))
    for name in dict.fromkeys([*(one.entity for one in changes if one.entity in names), *names]):
        if not changes or trials >= MOST_TRIALS:
            break
        changed = [one.run for one in best.comparisons if one.changes]
        nothing, *smaller = _smaller(name, changes, made, motion)
        enough = tried(*nothing)
        left = {one.what for one in enough.changes(len(changes), len(changed))}
        if len(left) >= len(changes):  # not its fault
            continue
        at = 0
        while smaller:  # the largest first, then in halves: who has to move less does not move more
            trial = tried(*smaller[at])
            if len(trial.changes(len(left) + 1)) <= len(left):
                enough, smaller = trial, smaller[:at]
            else:
                smaller = smaller[at + 1 :]
            at = len(smaller) // 2
        if len(enough.changes(len(changes))) < len(changes):
            mended[name] = next((one for one in changes if one.what not in left), changes[0])
            best, kept = enough, enough.driven
            changes = best.changes()
    least: dict[str, tuple[float, bool]] = {}
    for name in dict.fromkeys(name for name, _ in kept[1]):
        theirs = [kept[1].get((name, k), 1.0) for k in range(sum(path.entity == name for path in made(kept[0])))]
        least[name] = min(theirs), max(theirs) < 1.0
    comparisons = tuple(sorted(best.comparisons, key=lambda compared: RUN_NAMES.index(compared.run)))
    paths = EquivalentPaths(tuple(applied(*kept)), comparisons, tuple(changes), least, kept[0], mended)
    return best.output, best.nominal, paths


def _smaller(
    name: str, changes: Sequence[Change], made: Callable[[Ways], Sequence[OffsetPath]], motion: NominalMotion
) -> Iterator[Driven]:
    """Of one vehicle: nothing at all, then less and less of lane changes and of the path before the first change."""

    def begins(path: OffsetPath) -> float:
        starts = [one.start for one in motion.actions if one.path == path.after]
        return 0.0 if path.after is None else min(starts, default=inf)

    leads = any(path.instead for path in made({}) if path.entity == name)
    written: Ways = {name: Way.WRITTEN} if leads else {}
    starts = [begins(path) for path in made(written) if path.entity == name]
    yield written, {(name, k): 0.0 for k in range(len(starts))}
    if leads:
        yield {name: Way.ASIDE}, {}
        yield written, {}
    first = min((one.time for one in changes if one.entity == name), default=inf)
    nearest = min(range(len(starts)), key=lambda k: (starts[k] > first, -starts[k]), default=0)
    for size in SIZES if len(starts) > 1 else SIZES[:-1]:  # the only path at rest is nothing at all
        yield written, {(name, nearest): size}


def changes_of(comparisons: Iterable[Comparison]) -> list[Change]:
    """Each once, as it first is."""
    first: dict[str, Change] = {}
    for change in (one for comparison in comparisons for one in comparison.changes):
        first.setdefault(change.what, change)
    return list(first.values())
