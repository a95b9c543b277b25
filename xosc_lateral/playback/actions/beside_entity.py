"""Beside another entity: on a line parallel to its longitudinal axis, wherever that leads."""

from __future__ import annotations

from math import acos, atan2, cos, hypot, inf, pi, sin, sqrt

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.playback.angles import difference
from xosc_lateral.playback.state import EntityState, free
from xosc_lateral.playback.transition import EPSILON
from xosc_lateral.scenario.dynamics import DynamicConstraints

MOST_ACCELERATION = 1000.0
"""More lateral acceleration makes no difference. [m/s2]"""

LEAST_RADIUS = 0.5
"""Of a turn towards the line. [m]"""

PEAK = 1.5
"""A turn with a smooth course has this much more curvature in its middle than a circle. [-]"""


class BesideEntity:
    """Moves an entity to the line, and along it.

    Without a limit of acceleration it is on the line at once. With one, it heads for the line, and turns into it when
    it is nearer than the radius of its turn.

    Parameters
    ----------
    state, other : EntityState
    wanted : float
        Of the line, to the left of the other entity. [m]
    limits : DynamicConstraints or None
    """

    def __init__(
        self, state: EntityState, other: EntityState, wanted: float, limits: DynamicConstraints | None
    ) -> None:
        self._state, self._other, self._wanted = state, other, wanted
        given = None if limits is None else limits.max_acceleration
        self._acceleration = inf if given is None else abs(given)

    @property
    def is_unlimited(self) -> bool:
        """Whether it may jump."""
        return self._acceleration == inf

    def move(self, step: float) -> float:
        """One frame; returns how far the line was away. [m]"""
        state, own, other = self._state, self._state.plane, self._other.plane
        state.take_control(Activity.LATERAL)
        state.speed_taken = True
        c, s = cos(other.heading), sin(other.heading)
        to_left = (own.y - other.y) * c - (own.x - other.x) * s
        dx, dy = (to_left - self._wanted) * s, (self._wanted - to_left) * c
        rest = hypot(dx, dy)
        way = state.speed * step
        if self.is_unlimited:
            ahead = max(abs(way) - rest, 0.0)
            state.put_in_world(free(own.x + dx + c * ahead, own.y + dy + s * ahead, other.heading))
        elif rest < EPSILON:
            state.put_in_world(free(own.x + c * way, own.y + s * way, other.heading))
        else:
            heading = self._heading(own.heading, other.heading, (dx, dy), rest, step)
            state.put_in_world(free(own.x + cos(heading) * way, own.y + sin(heading) * way, heading))
        return rest

    def align(self) -> None:
        """Nothing to put straight: it has the other entity's heading."""

    def _heading(self, own: float, other: float, delta: tuple[float, float], rest: float, step: float) -> float:
        speed = self._state.speed
        way = speed * step
        radius = max(LEAST_RADIUS, PEAK * speed * speed / min(self._acceleration, MOST_ACCELERATION))
        if rest < 0.5 * way - EPSILON and 0.5 * way > radius - EPSILON:
            return _onto_line(other, delta, way)
        most = min(abs(speed / radius * step) * PEAK, pi - EPSILON)
        towards = difference(atan2(delta[1], delta[0]), own)
        if rest > radius - EPSILON:
            turn = towards
        else:
            segment = way / radius
            angle = max(acos(1.0 - rest / radius), 0.5 * segment)
            share = (2.0 * angle - 0.5 * segment) / pi
            share = share * share * (3.0 - 2.0 * share)
            turn = share * towards + (1.0 - share) * difference(other, own)
        return own + min(max(turn, -most), most)


def _onto_line(heading: float, delta: tuple[float, float], way: float) -> float:
    """Direction in which the frame's way ends on the line, of the two the one along the line."""
    ahead = sqrt(max(way * way - delta[0] ** 2 - delta[1] ** 2, 0.0))
    return atan2(delta[1] + ahead * sin(heading), delta[0] + ahead * cos(heading))
