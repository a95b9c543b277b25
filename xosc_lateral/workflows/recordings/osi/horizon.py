"""Lanes that a trace shows piece by piece, as far as a sensor or a simulation looks: put together as it goes on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

BEYOND_END = 1e-3  # points farther than this past the end of a line go on with it [m]


def extend_thing(kept: Any, seen: Any) -> None:
    """Add to a lane or boundary what a later message shows of it: points beyond its ends, further identifiers."""
    kind = type(kept).__name__
    if kind in ("LaneBoundary", "LogicalLaneBoundary"):
        _extend(kept.boundary_line, seen.boundary_line, lambda point: point.position)
    elif kind == "Lane":
        _extend(kept.classification.centerline, seen.classification.centerline, lambda point: point)
        for name in ("left_lane_boundary_id", "right_lane_boundary_id", "left_adjacent_lane_id",
                     "right_adjacent_lane_id", "lane_pairing"):  # fmt: skip
            _unite(getattr(kept.classification, name), getattr(seen.classification, name))
    else:
        kept.start_s, kept.end_s = min(kept.start_s, seen.start_s), max(kept.end_s, seen.end_s)
        for name in ("left_boundary_id", "right_boundary_id", "left_adjacent_lane", "right_adjacent_lane",
                     "predecessor_lane", "successor_lane"):  # fmt: skip
            _unite(getattr(kept, name), getattr(seen, name))


def _unite(kept: Any, seen: Any) -> None:
    for thing in seen:
        if thing not in kept:
            kept.add().CopyFrom(thing)


def _extend(line: Any, seen: Any, place: Callable[[Any], Any]) -> None:
    if len(seen) < 2:
        return
    if len(line) < 2:
        del line[:]
        line.extend(seen)
        return
    line.extend(_beyond(place(line[-2]), place(line[-1]), list(reversed(seen)), place)[::-1])
    for point in reversed(_beyond(place(line[1]), place(line[0]), list(seen), place)):
        line.insert(0, point)


def _beyond(before: Any, end: Any, points: list[Any], place: Callable[[Any], Any]) -> list[Any]:
    """Of points from the far end inwards, those past a line's end."""
    dx, dy = end.x - before.x, end.y - before.y
    size = max((dx * dx + dy * dy) ** 0.5, 1e-9)
    found = []
    for point in points:
        at = place(point)
        if ((at.x - end.x) * dx + (at.y - end.y) * dy) / size <= BEYOND_END:
            break
        found.append(point)
    return found
