"""SpeedProfileAction: speeds over time."""

from __future__ import annotations

import itertools
from math import inf
from typing import NamedTuple

from xosc_lateral.playback.actions.base import Domain, RunningAction
from xosc_lateral.playback.actions.constraints import Limits, limits_of
from xosc_lateral.playback.actions.jerk_limited import NoSolutionError, SpeedTarget, follow
from xosc_lateral.playback.transition import EPSILON
from xosc_lateral.scenario.actions.longitudinal import SpeedProfileAction
from xosc_lateral.scenario.enums import FollowingMode


class Piece(NamedTuple):
    """A stretch of the profile: from `time` on, speed + slope u + jerk u^2 / 2. [s], [m/s], [m/s2], [m/s3]"""

    time: float
    speed: float
    slope: float
    jerk: float = 0.0


class RunningSpeedProfile(RunningAction):
    """Straight lines between the speeds (`position`), or the same with a limited jerk (`follow`).

    An entry without a time is reached as fast as the constraints allow, one whose time is too short likewise. Times
    count from the entry before.
    """

    domains = Domain.LONGITUDINAL
    content: SpeedProfileAction

    def prepare(self) -> None:
        """Find the entity that the speeds are relative to; the acceleration to start from is needed."""
        name = self.content.entity_ref
        self._reference = None if name is None else self.simulation.entity(name, self.content.place)
        self.simulation.derives_motion = (
            self.simulation.derives_motion or self.content.following_mode is FollowingMode.FOLLOW
        )
        self._pieces: list[Piece] = []
        self._current = 0

    def start(self) -> None:
        """Lay the profile out from the present speed (and acceleration)."""
        state = self.state
        offset = 0.0 if self._reference is None else self._reference.speed
        if self._reference is not None:
            self.note(f"speeds are relative to that of '{self.content.entity_ref}' as it is now: {offset:.2f} m/s")
        limits = limits_of(self.content.constraints, state.entity.performance)
        self._current = 0
        targets = self._targets(offset, limits)
        self._pieces = [Piece(*target) for target in targets]
        if self.content.following_mode is FollowingMode.FOLLOW:
            acceleration = state.body_frame(state.acceleration)[0]
            try:
                pieces, why_straight = follow(targets, acceleration, limits)
            except NoSolutionError as error:
                self.note(f"{error}: played as straight lines between the speeds")
                return
            self._pieces = [Piece(*piece) for piece in pieces]
            if why_straight:
                self.note(f"{why_straight}: played as straight lines between the speeds from there on")

    def step(self, time: float, step: float) -> None:
        """Set the speed of the end of the frame."""
        state, pieces = self.state, self._pieces
        now = time + step
        if not pieces:
            self.end()
            return
        while self._current < len(pieces) - 1 and now > pieces[self._current + 1].time - EPSILON:
            self._current += 1
        piece = pieces[self._current]
        u = now - piece.time
        speed = piece.speed + u * (piece.slope + 0.5 * piece.jerk * u)
        last = pieces[-1].speed
        done = self._current >= len(self.content.entries) - 1 and abs(speed - last) < EPSILON
        state.set_speed(last if done else speed)
        if done:
            self.end()

    # ---- in detail ---------------------------------------------------------------------------------------------------
    def _targets(self, offset: float, limits: Limits) -> list[SpeedTarget]:
        """Speeds at absolute times, the present one first unless the first entry is to hold now."""
        entries = self.content.entries
        follows = self.content.following_mode is FollowingMode.FOLLOW
        time, speed = self.simulation.time, self.state.speed
        points = [(time, speed)]
        for index, entry in enumerate(entries):
            target = entry.speed + offset
            if index == 0 and entry.time is not None and entry.time <= EPSILON:
                if not follows:
                    points[0] = (time, target)
                continue
            time += max(_fastest(target - points[-1][1], limits), entry.time or 0.0)
            if time - points[-1][0] < EPSILON:
                points[-1] = (points[-1][0], target)
            else:
                points.append((time, target))
        slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in itertools.pairwise(points)]
        return [SpeedTarget(t, v, k) for (t, v), k in zip(points, (*slopes, 0.0), strict=True)]


def _fastest(change: float, limits: Limits) -> float:
    """Time for a change of speed within the limits; none where there are no limits. [s]"""
    limit = limits.acceleration if change > 0.0 else limits.deceleration
    return 0.0 if limit == inf else abs(change) / max(limit, EPSILON)


RUNNING: dict[type, type[RunningAction]] = {SpeedProfileAction: RunningSpeedProfile}
