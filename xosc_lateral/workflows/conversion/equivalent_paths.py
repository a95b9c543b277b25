"""Paths that leave what happens as it was: moves before a conflict become smaller, and what is left is told."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import inf
from typing import TypeVar

from xosc_lateral.base.note import Note
from xosc_lateral.workflows.conversion.result import NOMINAL_RUN, EventShift
from xosc_lateral.workflows.conversion.shifts import EVENT_TOLERANCE, NEW, Change, Comparison, largest_of, later
from xosc_lateral.world.motion.look import Finding
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.motion.offset_path import OffsetPath, resized

CHANGES = "with offsets, what happens would happen otherwise"

SIZES = (1.0, 0.5, 0.25, 0.0)
"""Times what was sampled, tried for the offsets before a conflict, in order. [-]"""
TRIALS = 3
"""Of a vehicle: if what happens is otherwise still, it stays as written if that mends it. [-]"""
LATE, LATE_END = 0.1, 0.5
"""By which an event begins and ends earlier or later without a word, if it is explained. [s]"""
LEAST_MOVING = 0.9
"""Share of driving time below which it is told. [-]"""
MOST_TRIALS = 12
"""Of a conversion: beyond, what is left is told. [-]"""

Output = TypeVar("Output")

Sizes = dict[int, float]
"""By the number of a path, where it is driven otherwise than sampled."""


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
        new = (one for one in self.changes if one.pair is not None and one.how == NEW)
        return tuple(str(one) for one in new if one.pair not in nominal)

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

    def _findings(self) -> Iterator[Note]:
        """The worst of each kind for each vehicle, with its run."""
        alike: dict[tuple[str, str], list[tuple[Finding, str]]] = {}
        for compared in self.comparisons:
            for finding in compared.findings:
                alike.setdefault((finding.entity, finding.kind), []).append((finding, compared.run))
        for alikes in alike.values():
            worst, run = max(alikes, key=lambda each: each[0].size)
            yield worst.note(run, len(alikes) - 1)


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
    given_up, tried = set[int](), Counter[str]()
    while changes and trials < MOST_TRIALS:
        blamed = _blamed(changes, paths, motion, sizes, given_up)
        if blamed is None:
            break
        name = paths[blamed].entity
        theirs = [k for k, path in enumerate(paths) if path.entity == name and not path.instead]
        ways: list[Sizes] = [{blamed: smaller} for smaller in SIZES[SIZES.index(sizes.get(blamed, 1.0)) + 1 :]]
        for way in ways[: max(TRIALS - tried[name], 0)] or [dict.fromkeys(theirs, SIZES[-1])]:
            trial = sizes | way
            made, outcome = attempt(applied(trial), len(changes))
            trials += 1
            tried[name] += 1
            if len(changes_of(outcome)) < len(changes):
                sizes, output, comparisons, changes = trial, made, outcome, changes_of(outcome)
                break
        else:
            given_up |= {*theirs} if tried[name] > TRIALS else {blamed}
    least: dict[str, tuple[float, bool]] = {}
    for name in dict.fromkeys(paths[k].entity for k in sizes):
        theirs = [k for k, path in enumerate(paths) if path.entity == name]
        least[name] = min(sizes.get(k, 1.0) for k in theirs), all(k in sizes for k in theirs)
    return output, EquivalentPaths(tuple(applied(sizes)), tuple(comparisons), tuple(changes), least)


def changes_of(comparisons: Iterable[Comparison]) -> list[Change]:
    """Each once, as it first is."""
    first: dict[str, Change] = {}
    for change in (one for comparison in comparisons for one in comparison.changes):
        first.setdefault(change.what, change)
    return list(first.values())


def _blamed(
    changes: Sequence[Change],
    paths: Sequence[OffsetPath],
    motion: NominalMotion,
    sizes: Sizes,
    given_up: Collection[int],
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
    free = (k for k in order if sizes.get(k, 1.0) > SIZES[-1] and k not in given_up and not paths[k].instead)
    return next(free, None)
