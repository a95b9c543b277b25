"""Events of a written scenario that no longer happen when they do in its source."""

from __future__ import annotations

from collections.abc import Sequence

from xosc_lateral.motion.nominal import NominalMotion, PlayedAction

MOST = 0.05
"""An event may be this much earlier or later without a word. [s]"""

Key = tuple[tuple[str, ...], str | None, int]


def shifted_events(before: NominalMotion, after: NominalMotion) -> list[str]:
    """A line for each event of the source whose actions start earlier, later or not at all in the other run.

    A car that drives beside the middle of its lane comes to places, and to others, at other times: what it triggers is
    triggered then.
    """
    now = _starts(after.actions)
    found: dict[str, str] = {}
    for key, start in _starts(before.actions).items():
        name, what = _named(key, start)
        if key not in now:
            found.setdefault(name, f"{what} no longer happens with the offsets")
        elif abs(now[key] - start) > MOST:
            moved = now[key] - start
            sense = "later" if moved > 0 else "earlier"
            found.setdefault(name, f"{what} happens {abs(moved):.2f} s {sense} with the offsets")
    return list(found.values())


def _named(key: Key, start: float) -> tuple[str, str]:
    """An event's name, and the event in words."""
    path, actor, _ = key
    name = path[-2] if len(path) > 1 else path[-1]
    whose = "" if actor is None else f" of '{actor}'"
    return name, f"event '{name}'{whose} at {start:.2f} s"


def _starts(actions: Sequence[PlayedAction]) -> dict[Key, float]:
    """Start of each action, counted for those that run several times. [s]"""
    starts: dict[Key, float] = {}
    for played in actions:
        if played.path == ("Init",):
            continue
        number = sum(1 for path, actor, _ in starts if path == played.path and actor == played.actor)
        starts[played.path, played.actor, number] = played.start
    return starts
