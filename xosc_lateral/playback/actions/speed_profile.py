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
from dataclasses import dataclass
from math import inf, sqrt
from typing import NamedTuple

from xosc_lateral.playback.actions.base import Domain, RunningAction
from xosc_lateral.playback.transition import EPSILON
from xosc_lateral.scenario import Performance
from xosc_lateral.scenario.enums import FollowingMode
from xosc_lateral.scenario.private_actions import DynamicConstraints, SpeedProfileAction


@dataclass(frozen=True, slots=True)
class Limits:
    """[m/s], [m/s2], [m/s3]; infinite: none."""

    speed: float
    acceleration: float
    deceleration: float
    acceleration_rate: float
    deceleration_rate: float


def limits_of(constraints: DynamicConstraints | None, performance: Performance) -> Limits:
    """Constraints that are not given are the entity's own; without any constraints, there are none at all."""
    if constraints is None:
        return Limits(performance.max_speed, inf, inf, inf, inf)
    return Limits(
        _capped(constraints.max_speed, performance.max_speed),
        _capped(constraints.max_acceleration, performance.max_acceleration),
        _capped(constraints.max_deceleration, performance.max_deceleration),
        _capped(constraints.max_acceleration_rate, performance.max_acceleration_rate),
        _capped(constraints.max_deceleration_rate, performance.max_deceleration_rate),
    )


def _capped(value: float | None, own: float) -> float:
    return own if value is None else min(value, own)


_NO_LIMIT = 1e10
"""In place of infinite jerks and accelerations, so that formulas stay finite."""

Row = tuple[float, float, float, float]
"""Time [s], speed [m/s], acceleration [m/s2], jerk [m/s3] of a piece."""


class SpeedTarget(NamedTuple):
    """A speed to have at a time, and the acceleration from there to the next. [s], [m/s], [m/s2]"""

    time: float
    speed: float
    slope: float


class NoSolutionError(ValueError):
    """No jerk-limited profile meets the speeds at their times."""


def follow(targets: Sequence[SpeedTarget], acceleration: float, limits: Limits) -> tuple[list[Row], str]:
    """Pieces of the profile through `targets`, beginning with the present acceleration, and why the last of them are
    straight lines (empty: they are not). [m/s2]

    Raises `NoSolutionError`: when not even the first target can be met so.
    """
    up, down = min(limits.acceleration_rate, _NO_LIMIT), min(limits.deceleration_rate, _NO_LIMIT)
    if len(targets) < 2:
        return [(target.time, target.speed, 0.0, 0.0) for target in targets], ""
    if len(targets) == 2:
        return _single(targets, acceleration, limits, up, down), ""
    if not -limits.deceleration - EPSILON <= acceleration <= limits.acceleration + EPSILON:
        raise NoSolutionError(f"the present acceleration of {acceleration:.2f} m/s2 is beyond the limits")
    return _several(targets, acceleration, up, down)


def _several(targets: Sequence[SpeedTarget], acceleration: float, up: float, down: float) -> tuple[list[Row], str]:
    first = targets[0]
    rows: list[Row] = []
    time, jerk = first.time, 0.0
    if abs(first.slope) > EPSILON:
        jerk = -down if first.slope < acceleration else up
        rows.append((first.time, first.speed, acceleration, jerk))
        time += (first.slope - acceleration) / jerk
    u = time - first.time
    speed = first.speed + u * (acceleration + 0.5 * jerk * u)
    rows.append((time, speed, first.slope, 0.0))
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
                rest = [(later.time, later.speed, later.slope, 0.0) for later in targets[index:]]
                return rows + rest, f"the speed at {target.time:.2f} s leaves no time for the jerk"
            at_corner = speed + slope * (corner - time)
            rows.append((corner, at_corner, slope, jerk))
            time = corner + (following - slope) / jerk
            u = time - corner
            speed = at_corner + u * (slope + 0.5 * jerk * u)
        rows.append((time, speed, following, 0.0))
        slope, intercept = following, its_intercept
    return rows, ""


def _single(targets: Sequence[SpeedTarget], acceleration: float, limits: Limits, up: float, down: float) -> list[Row]:
    (t0, v0, wanted), (t3, v3, _) = targets
    a0 = acceleration
    j0 = -down if wanted < a0 else up
    j1 = up if wanted < 0.0 else -down
    if abs(j1 - j0) < EPSILON:
        return _one_way(targets, a0, j1)
    middle: Row | None = None
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
        middle = (t1, v1, a1, 0.0)
    if not -limits.deceleration <= a1 <= limits.acceleration:
        a1 = min(max(a1, -limits.deceleration), limits.acceleration)
        t1 = t0 + (a1 - a0) / j0
        v1 = v0 + a0 * (t1 - t0) + 0.5 * j0 * (t1 - t0) ** 2
        t2 = (v3 - v1) / a1 + t1 + a1 / (2 * j1)
        v2 = v3 + a1 * a1 / (2 * j1)
        t3 = (v3 - v1) / a1 + t1 - a1 / (2 * j1)
        middle = (t1, v1, a1, 0.0)
    rows = [(t0, v0, a0, j0)]
    if middle is not None:
        rows.append(middle)
    return [*rows, (t2, v2, a1, j1), (t3, v3, 0.0, 0.0)]


def _one_way(targets: Sequence[SpeedTarget], a0: float, jerk: float) -> list[Row]:
    """Both ends with the same jerk: the present acceleration is beyond what is needed, and is taken back."""
    (t0, v0, _), (t3, v3, _) = targets
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
    return [(t0, v0, a0, jerk), (t1, v1, a1, 0.0), (t2, v1 + a1 * (t2 - t1), a1, jerk), (t3, v3, 0.0, 0.0)]


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


RUNNING: dict[type, type[RunningAction]] = {
    SpeedProfileAction: RunningSpeedProfile,
}
