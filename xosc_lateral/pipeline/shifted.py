"""Events of a written scenario that no longer happen when they do in its source."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from math import inf

from xosc_lateral.motion.nominal import EntityMotion, NominalMotion, PlayedAction

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


def shifted_events(before: NominalMotion, after: NominalMotion) -> list[str]:
    """A line for each thing that happens otherwise in the other run; see `shifts`."""
    return [str(shift) for shift in shifts(before, after)]


def shifts(before: NominalMotion, after: NominalMotion, *, ignored: Collection[str] = ()) -> list[Shift]:
    """Events of the source that start earlier, later, not at all or once more in the other run; other ends and lanes.

    A car that drives beside the middle of its lane comes to places, and to others, at other times: what it triggers is
    triggered then. Entities that are ignored may end in any lane.
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
