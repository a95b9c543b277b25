"""Beside another entity in the frame of the road: at a difference of t.

Derived here: x" = k (target - x) - 2 sqrt(k) x' has the double root -sqrt(k), which is the fastest return without
overshoot.
"""

from __future__ import annotations

from math import atan2, copysign, cos, inf, pi, sin, sqrt

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.playback.distances import road_gap, spot_of
from xosc_lateral.playback.drive import along_reference, travel
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.transition import EPSILON
from xosc_lateral.road import Pose
from xosc_lateral.scenario.dynamics import DynamicConstraints

STIFFNESS = 0.4
"""Of the spring that pulls towards the distance, per acceleration available. [1/m]"""


class BesideOnRoad:
    """Moves an entity sideways on the road: at once, at a limited speed, or by a critically damped spring.

    The spring is for a limited acceleration. Nothing moves in the first frame. The way of a frame on the entity's own
    track is `speed * step`: what goes sideways is missing ahead, but for an entity that moves at once.

    Parameters
    ----------
    state, other : EntityState
    wanted : float
        To the left of the other entity. [m]
    limits : DynamicConstraints or None
    """

    def __init__(
        self, state: EntityState, other: EntityState, wanted: float, limits: DynamicConstraints | None
    ) -> None:
        self._state, self._other, self._wanted = state, other, wanted
        given = limits or DynamicConstraints()
        self._most_speed = inf if given.max_speed is None else given.max_speed
        self._most_acceleration = inf if given.max_acceleration is None else given.max_acceleration
        self._most_jerk = inf if given.max_acceleration_rate is None else given.max_acceleration_rate
        self._before: Pose | None = None
        """Where it was left in the frame before."""
        self._speed = 0.0
        """Along +t. [m/s]"""
        self._acceleration = 0.0

    @property
    def is_unlimited(self) -> bool:
        """Whether it may jump."""
        return self._most_speed == inf and self._most_acceleration == inf

    def move(self, step: float) -> float | None:
        """One frame; returns how far the place beside the other was away; None: nothing moves yet. [m]"""
        state = self._state
        state.follow_lane()
        if self._before is None:
            self._before = state.pose
            return None
        rest = self._rest()
        if self.is_unlimited:
            self._shift(rest)
        else:
            rest = self._drive_across(rest, step)
        self._turn_along_movement(self._before)
        self._before = state.pose
        return rest

    def _drive_across(self, rest: float, step: float) -> float:
        """Along the lane and towards the place at once, as far as its dynamics let it; what is left. [m]"""
        state = self._state
        across = self._speed_across(rest, step)
        ahead = sqrt(max(state.speed * state.speed - across * across, 0.0))
        state.take_control(Activity.LATERAL)
        state.speed_taken = True
        distance = copysign(ahead * step, state.speed)
        ds = along_reference(state.network, state.road, state.lane, state.s, state.offset_t, distance)
        travel(state, 1 if state.is_forward else -1, ds)
        state.move_to(state.road, state.lane, state.s, state.offset_t + across * step)
        if abs(rest) <= abs(across) * step + EPSILON and self._most_acceleration == inf:
            rest = 0.0
        return rest

    def align(self) -> None:
        """The last heading of the movement stays, as in the reference player, but for a jump."""
        if self.is_unlimited:
            self._state.turn(0.0 if self._state.is_forward else pi)

    # ---- in detail ---------------------------------------------------------------------------------------------------
    def _rest(self) -> float:
        """How far to go along +t of the own road. [m]"""
        state, other = self._state, self._other
        gap = road_gap(state.network, other, spot_of(state))
        if gap is None:
            return 0.0
        return (self._wanted if other.is_forward is not gap.is_turned else -self._wanted) - gap.dt

    def _shift(self, rest: float) -> None:
        """Straight across the road, to whatever lane is there."""
        state, network = self._state, self._state.network
        heading = state.road_heading()
        x, y = state.pose.x - sin(heading) * rest, state.pose.y + cos(heading) * rest
        found = network.world_to_lane_at(x, y, near=(state.road, state.s))
        state.move_to(
            found.road, found.lane, found.s, network.offset_from_offset_t(found.road, found.lane, found.offset)
        )
        state.section = (0.0, -1.0)

    def _speed_across(self, rest: float, step: float) -> float:
        """Lateral speed of the frame along +t. [m/s]"""
        most = max(min(self._most_speed, abs(self._state.speed)) - EPSILON, 0.0)
        if self._most_acceleration == inf:
            self._speed = copysign(most, rest)
            if step > 0.0 and abs(rest) < most * step:
                self._speed = rest / step
            return self._speed
        stiffness = STIFFNESS * self._most_acceleration
        its = self._other.body_frame(self._other.velocity)[1]
        pull = stiffness * rest - 2.0 * sqrt(stiffness) * (self._speed - its)
        jerk = self._most_jerk * step if step > 0.0 else 0.0
        change = min(max(pull - self._acceleration, -jerk), jerk)
        acceleration = self._acceleration + change
        self._acceleration = min(max(acceleration, -self._most_acceleration), self._most_acceleration)
        self._speed = min(max(self._speed + self._acceleration * step, -most), most)
        return self._speed

    def _turn_along_movement(self, before: Pose) -> None:
        """Point the way that the entity has moved since the frame before; at rest, as it did."""
        state = self._state
        dx, dy = state.pose.x - before.x, state.pose.y - before.y
        if dx or dy:
            heading = atan2(dy, dx) + (pi if state.speed < 0.0 else 0.0)
            state.turn(heading - state.road_heading())
