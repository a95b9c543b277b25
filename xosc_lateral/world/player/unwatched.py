"""Entities that only follow their lanes and that nobody looks at: many frames at once, with the same numbers.

Nearly all of a dense scene is so nearly all of the time. An action of their own, or anybody who asks for them, brings
them up to date and back among those that move frame by frame.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import isnan

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.player.drive import along_reference, beside_line
from xosc_lateral.world.player.recorder import MAXIMUM_COORDINATE, MAXIMUM_SPEED, Rows
from xosc_lateral.world.player.state import EntityState
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.geometry import Arc, Line

MAXIMUM_FRAMES, MINIMUM_FRAMES = 1000, 5
"""Frames that are worked out at once: more would often be for nothing, and fewer are not worth it."""

_ACTIVE = int(Activity.ACTIVE)


class Unwatched:
    """Who moves frame by frame, and who is ahead of the run."""

    def __init__(self, entities: Iterable[EntityState]) -> None:
        self.awake = {state: Rows(state) for state in entities}
        """Entities that move frame by frame, and their rows."""
        self.frames = 0
        """Rows that those have."""
        self._ahead: dict[EntityState, tuple[int, FloatArray, Rows]] = {}
        self._due: dict[int, list[EntityState]] = {}

    def rest(self, step: float) -> None:
        """Move everybody ahead who can be, after a frame of `step` [s] is written."""
        for state in [state for state in self.awake if _follows_its_lane(state)]:
            values = _way_ahead(state, state.speed * step)
            if (
                len(values) >= MINIMUM_FRAMES
                and abs(values[-1]) <= MAXIMUM_COORDINATE
                and abs(state.speed) <= MAXIMUM_SPEED
            ):
                self._ahead[state] = self.frames, values, self.awake.pop(state)
                self._due.setdefault(self.frames + len(values), []).append(state)

    def wake_due(self, *, derives_motion: bool) -> None:
        """Before a frame: take back whose frames are used up."""
        for state in self._due.pop(self.frames, ()):
            if state in self._ahead and self.frames - self._ahead[state][0] == len(self._ahead[state][1]):
                self.wake(state, derives_motion=derives_motion)

    def wake(self, state: EntityState, *, derives_motion: bool) -> None:
        """Bring an entity to where it was when the frame before ended; it moves frame by frame from here on."""
        if state not in self._ahead:
            return
        first, values, rows = self._ahead.pop(state)
        if done := self.frames - first:
            rows.follow(values[:done])
            state.move_to(state.road, state.lane, float(values[done - 1]), state.offset_t)
        state.last_place = state.road, state.s, state.offset_t
        state.begin_frame()
        state.previous = state.plane if derives_motion else None
        self.awake[state] = rows

    def wake_all(self) -> None:
        """At the end of the run."""
        for state in list(self._ahead):
            self.wake(state, derives_motion=False)


def _follows_its_lane(state: EntityState) -> bool:
    return (
        not state.is_watched
        and state.activity == _ACTIVE | state.steered
        and state.free_pose is None
        and state.tow is None
        and state.trailer is None
        and not state.at_road_end
        and not state.longitudinal_taken
        and not state.acts()
    )


def _way_ahead(state: EntityState, distance: float) -> FloatArray:
    """s after each of the next frames in this lane section, as `drive` would have it, shape (n,). [m]"""
    s = state.s
    if abs(state.speed) <= EPSILON:
        return np.full(MAXIMUM_FRAMES, s)
    way = 1 if state.is_forward else -1
    road, (start, end) = state.network.roads[state.road], state.section
    places = [s]
    while start < s < end and len(places) <= MAXIMUM_FRAMES:
        low, high, element, begin, centre = road.stretch_of(state.lane, s)
        if isnan(centre):
            s += way * along_reference(state, s, distance)
            places.append(s)
        elif isinstance(element, Line | Arc):
            move = way * beside_line(element.curvature_at(s - begin), centre + state.offset_t, distance)
            room = (min(high, end) - s if move > 0.0 else s - max(low, start)) / abs(move)
            count = 1 + int(min(room, MAXIMUM_FRAMES - len(places)))
            ways = np.add.accumulate(np.array([s] + [move] * count))  # one after the other: the same last bits
            ways = ways[1 : 2 + int(np.count_nonzero((ways[1:-1] >= low) & (ways[1:-1] < high)))]
            places.extend(ways.tolist())
            s = places[-1]
        else:
            while low <= s < high and len(places) <= MAXIMUM_FRAMES:
                s += way * beside_line(element.curvature_at(s - begin), centre + state.offset_t, distance)
                places.append(s)
    values = np.array(places[1:])
    inside = (values > start) & (values < end)
    return values if inside.all() else values[: int(np.argmin(inside))]
