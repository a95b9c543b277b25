"""SpeedProfileAction: speeds at times, within limits of acceleration and jerk.

With a limited jerk, the straight lines of a profile have rounded corners: a line of constant acceleration runs through
each two targets; between two lines, a piece of constant jerk leads from one acceleration to the other, touching both. A
single target is reached with zero acceleration: one piece of jerk at either end, and a line between them where there is
time for it.

References
----------
.. [1] L. Biagiotti, C. Melchiorri, "Trajectory Planning for Automatic Machines and Robots", 2008, section 3.4.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

from msgspec.structs import asdict

from xosc_lateral.world.player.actions.base import Domain, Maker, RunningPrivateAction
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.scenario.entity import Performance
from xosc_lateral.world.scenario.enums import FollowingMode
from xosc_lateral.world.scenario.private_actions import DynamicConstraints, SpeedProfileAction


def limits_of(constraints: DynamicConstraints | None, performance: Performance) -> Performance:
    """Constraints that are not given are the entity's own; without any constraints, only the speed has a limit."""
    if constraints is None:
        return Performance(performance.max_speed)
    limits = asdict(performance)
    tighter = {name: min(value, limits[name]) for name, value in asdict(constraints).items() if value is not None}
    return Performance(**limits | tighter)


_NO_LIMIT = 1e10
"""In place of infinite jerks and accelerations, so that formulas stay finite."""


class Piece(NamedTuple):
    """A stretch of the profile: from `time` on, speed + slope u + jerk u^2 / 2. [s], [m/s], [m/s2], [m/s3]"""

    time: float
    speed: float
    slope: float
    jerk: float = 0.0


class NoSolutionError(ValueError):
    """No jerk-limited profile meets the speeds at their times."""


def follow(targets: Sequence[Piece], acceleration: float, limits: Performance) -> tuple[list[Piece], str]:
    """Pieces of the profile through `targets`, beginning with the present acceleration, and why the last of them are
    straight lines (empty: they are not). [m/s2]

    Raises `NoSolutionError`: when not even the first target can be met so.
    """
    up, down = min(limits.max_acceleration_rate, _NO_LIMIT), min(limits.max_deceleration_rate, _NO_LIMIT)
    if len(targets) < 2:
        return [Piece(target.time, target.speed, 0.0) for target in targets], ""
    if len(targets) == 2:
        return _single(targets, acceleration, limits, up, down), ""
    if not -limits.max_deceleration - EPSILON <= acceleration <= limits.max_acceleration + EPSILON:
        raise NoSolutionError(f"the present acceleration of {acceleration:.2f} m/s2 is beyond the limits")
    return _several(targets, acceleration, up, down)


def _several(targets: Sequence[Piece], acceleration: float, up: float, down: float) -> tuple[list[Piece], str]:
    first = targets[0]
    pieces: list[Piece] = []
    time, jerk = first.time, 0.0
    if abs(first.slope) > EPSILON:
        jerk = -down if first.slope < acceleration else up
        pieces.append(Piece(first.time, first.speed, acceleration, jerk))
        time += (first.slope - acceleration) / jerk
    u = time - first.time
    speed = first.speed + u * (acceleration + 0.5 * jerk * u)
    pieces.append(Piece(time, speed, first.slope))
    slope, intercept = first.slope, speed - first.slope * time
    for index, target in enumerate(targets[1:], 1):
        following, its_intercept = target.slope, target.speed - target.slope * target.time
        if abs(slope - following) >= EPSILON:
            jerk = -down if following < slope else up
            corner = ((slope - following) ** 2 - 2.0 * jerk * (intercept - its_intercept)) / (
                2.0 * jerk * (slope - following)
            )
            if corner < time:
                # the reference player goes on in straight lines, from the target after the one that it came for
                return [*pieces, *targets[index:]], f"the speed at {target.time:.2f} s leaves no time for the jerk"
            at_corner = speed + slope * (corner - time)
            pieces.append(Piece(corner, at_corner, slope, jerk))
            time = corner + (following - slope) / jerk
            u = time - corner
            speed = at_corner + u * (slope + 0.5 * jerk * u)
        pieces.append(Piece(time, speed, following))
        slope, intercept = following, its_intercept
    return pieces, ""


def _single(targets: Sequence[Piece], acceleration: float, limits: Performance, up: float, down: float) -> list[Piece]:
    (t0, v0, wanted, _), (t3, v3, _, _) = targets
    a0 = acceleration
    j0 = -down if wanted < a0 else up
    j1 = up if wanted < 0.0 else -down
    if abs(j1 - j0) < EPSILON:
        return _one_way(targets, a0, j1)
    middle: list[Piece] = []
    room = (
        j0
        * j1
        * (2 * v0 * (j1 - j0) + a0 * a0 + 2 * a0 * j1 * (t3 - t0) + j0 * j1 * (t0 - t3) ** 2 + 2 * v3 * (j0 - j1))
    )
    if room < 0.0:
        radicand = j1 * (j1 - j0) * (j0 * (2 * v3 - 2 * v0) + a0 * a0)
        if radicand < 0.0:
            raise NoSolutionError("the speed can't be reached with this jerk")
        t2 = (sqrt(radicand) + (j0 - j1) * (t0 * j0 - a0)) / (j0 * (j0 - j1))
        v2 = v0 + a0 * (t2 - t0) + 0.5 * j0 * (t2 - t0) ** 2
        a1 = a0 + j0 * (t2 - t0)
        t3 = t2 - a1 / j1
    else:
        t1 = (-sqrt(room) - j0 * (a0 + t3 * j1) + t0 * j0 * j0) / (j0 * (j0 - j1))
        v1 = v0 + a0 * (t1 - t0) + 0.5 * j0 * (t1 - t0) ** 2
        a1 = a0 + j0 * (t1 - t0)
        t2 = a1 / j1 + t3
        v2 = v1 + a1 * (t2 - t1)
        middle = [Piece(t1, v1, a1)]
    if not -limits.max_deceleration <= a1 <= limits.max_acceleration:
        a1 = min(max(a1, -limits.max_deceleration), limits.max_acceleration)
        t1 = t0 + (a1 - a0) / j0
        v1 = v0 + a0 * (t1 - t0) + 0.5 * j0 * (t1 - t0) ** 2
        t2 = (v3 - v1) / a1 + t1 + a1 / (2 * j1)
        v2 = v3 + a1 * a1 / (2 * j1)
        t3 = (v3 - v1) / a1 + t1 - a1 / (2 * j1)
        middle = [Piece(t1, v1, a1)]
    return [Piece(t0, v0, a0, j0), *middle, Piece(t2, v2, a1, j1), Piece(t3, v3, 0.0)]


def _one_way(targets: Sequence[Piece], a0: float, jerk: float) -> list[Piece]:
    """Both ends with the same jerk: the present acceleration is beyond what is needed, and is taken back."""
    (t0, v0, *_), (t3, v3, *_) = targets
    span = jerk * (t0 - t3) - a0
    if abs(span) < EPSILON:
        raise NoSolutionError("the present acceleration leaves no way to the speed")
    t1 = (2.0 * jerk * (v0 + t0 * jerk * (t0 - t3) - v3) + a0 * a0 + 2.0 * a0 * jerk * (t3 - 2.0 * t0)) / (
        2.0 * jerk * span
    )
    a1 = a0 + jerk * (t1 - t0)
    t2 = a1 / jerk + t3
    if not t0 <= t1 <= t2 <= t3 + EPSILON:
        raise NoSolutionError("the present acceleration is already beyond what is needed")
    v1 = v0 + a0 * (t1 - t0) + 0.5 * jerk * (t1 - t0) ** 2
    v2 = v1 + a1 * (t2 - t1)
    return [Piece(t0, v0, a0, jerk), Piece(t1, v1, a1), Piece(t2, v2, a1, jerk), Piece(t3, v3, 0.0)]


class RunningSpeedProfile(RunningPrivateAction):
    """Straight lines between the speeds (`position`), or the same with a limited jerk (`follow`).

    An entry without a time is reached as fast as the constraints allow, one whose time is too short likewise. Times
    count from the entry before.
    """

    domains = Domain.LONGITUDINAL
    content: SpeedProfileAction

    def _prepare(self) -> None:
        self._reference = self._referred(self.content)
        self._follows = self.content.following_mode is FollowingMode.FOLLOW
        if self._follows:
            self.simulation.derives_motion = True  # the acceleration to start from is needed

    def _begin(self) -> None:
        state = self.actor
        offset = 0.0 if self._reference is None else self._reference.speed
        if self._reference is not None:
            self.note(f"speeds are relative to that of '{self.content.entity_ref}' as it is now: {offset:.2f} m/s")
        limits = limits_of(self.content.constraints, state.entity.performance)
        self._current = 0
        self._pieces = self._targets(offset, limits)
        if self._follows:
            acceleration = state.body_frame(state.acceleration)[0]
            try:
                self._pieces, why_straight = follow(self._pieces, acceleration, limits)
            except NoSolutionError as error:
                self.note(f"{error}: played as straight lines between the speeds")
                return
            if why_straight:
                self.note(f"{why_straight}: played as straight lines between the speeds from there on")

    def _act(self, time: float, step: float) -> None:
        state, pieces = self.actor, self._pieces
        now = time + step
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

    def _targets(self, offset: float, limits: Performance) -> list[Piece]:
        """Speeds at absolute times, the present one first unless the first entry is to hold now."""
        time, speed = self.simulation.time, self.actor.speed
        points = [(time, speed)]
        for index, entry in enumerate(self.content.entries):
            target = entry.speed + offset
            if index == 0 and entry.time is not None and entry.time <= EPSILON:
                if not self._follows:
                    points[0] = (time, target)
                continue
            change = target - points[-1][1]
            limit = limits.max_acceleration if change > 0.0 else limits.max_deceleration
            time += max(abs(change) / max(limit, EPSILON), entry.time or 0.0)
            if time - points[-1][0] < EPSILON:
                points[-1] = (points[-1][0], target)
            else:
                points.append((time, target))
        slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in itertools.pairwise(points)]
        return [Piece(t, v, k) for (t, v), k in zip(points, (*slopes, 0.0), strict=True)]


RUNNING: dict[type, Maker] = {SpeedProfileAction: RunningSpeedProfile}
