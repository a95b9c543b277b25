"""LateralDistanceAction: a distance beside another entity, on the road or along that entity's axes.

On the road, derived here: x" = k (target - x) - 2 sqrt(k) x' has the double root -sqrt(k), which is the fastest return
without overshoot.
"""

from __future__ import annotations

from math import acos, atan2, copysign, cos, hypot, inf, pi, sin, sqrt

from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.player.actions.base import Domain, Maker, RunningPrivateAction
from xosc_lateral.world.player.actions.longitudinal import STIFFNESS
from xosc_lateral.world.player.distances import ahead_and_left, road_gap, spot_of
from xosc_lateral.world.player.drive import move_along_lane
from xosc_lateral.world.player.state import NO_ROAD, EntityState, free
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.positions import Pose, difference
from xosc_lateral.world.scenario.enums import CoordinateSystem, LateralDisplacement
from xosc_lateral.world.scenario.private_actions import DynamicConstraints, LateralDistanceAction


class BesideOnRoad:
    """Moves an entity sideways on the road, to `wanted` on the left of the other [m].

    At once, at a limited speed, or, where its acceleration is limited, by a critically damped spring. Nothing moves in
    the first frame. The way of a frame on the entity's own track is `speed * step`: what goes sideways is missing
    ahead, but for an entity that moves at once.
    """

    def __init__(self, state: EntityState, other: EntityState, wanted: float, limits: DynamicConstraints) -> None:
        self._state, self._other, self._wanted = state, other, wanted
        self._most_speed = inf if limits.max_speed is None else limits.max_speed
        self._most_acceleration = inf if limits.max_acceleration is None else limits.max_acceleration
        self._most_jerk = inf if limits.max_acceleration_rate is None else limits.max_acceleration_rate
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
        was_forward = state.is_forward
        move_along_lane(state, copysign(ahead * step, state.speed))
        if state.is_forward is not was_forward:  # onto a road whose s runs the other way: +t is the other side
            across, self._speed, self._acceleration = -across, -self._speed, -self._acceleration
        state.move_to(state.road, state.lane, state.s, state.offset_t + across * step)
        if abs(rest) <= abs(across) * step + EPSILON and self._most_acceleration == inf:
            rest = 0.0
        return rest

    def align(self) -> None:
        """The last heading of the movement stays, as in the reference player, but for a jump."""
        if self.is_unlimited:
            self._state.turn(0.0 if self._state.is_forward else pi)

    def _rest(self) -> float:
        """How far to go along +t of the own road. [m]"""
        state, other = self._state, self._other
        gap = road_gap(other, spot_of(state))
        if gap is None:
            return 0.0
        return (self._wanted if other.is_forward is not gap.is_turned else -self._wanted) - gap.dt

    def _shift(self, rest: float) -> None:
        """Straight across the road, to whatever lane is there."""
        state, network = self._state, self._state.network
        heading = state.road_heading()
        x, y = state.pose.x - sin(heading) * rest, state.pose.y + cos(heading) * rest
        there = network.world_to_lane_at(x, y, near=(state.road, state.s), lane_types=state.kept_types())
        state.move_to(
            there.road, there.lane, there.s, network.offset_from_offset_t(there.road, there.lane, there.offset)
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


MOST_ACCELERATION = 1000.0
"""More lateral acceleration makes no difference. [m/s2]"""

LEAST_RADIUS = 0.5
"""Of a turn towards the line. [m]"""

PEAK_CURVATURE_RATIO = 1.5
"""A turn with a smooth course has this much more curvature in its middle than a circle. [-]"""


class BesideEntity:
    """Moves an entity to the line, `wanted` to the left of the other [m], and along it.

    Without a limit of acceleration it is on the line at once. With one, it heads for the line, and turns into it when
    it is nearer than the radius of its turn.
    """

    def __init__(self, state: EntityState, other: EntityState, wanted: float, limits: DynamicConstraints) -> None:
        self._state, self._other, self._wanted = state, other, wanted
        self._acceleration = inf if limits.max_acceleration is None else abs(limits.max_acceleration)

    @property
    def is_unlimited(self) -> bool:
        """Whether it may jump."""
        return self._acceleration == inf

    def move(self, step: float) -> float:
        """One frame; returns how far the line was away. [m]"""
        state, ours, other = self._state, self._state.plane, self._other.plane
        state.take_control(Activity.LATERAL)
        state.speed_taken = True
        c, s = cos(other.heading), sin(other.heading)
        to_left = (ours.y - other.y) * c - (ours.x - other.x) * s
        dx, dy = (to_left - self._wanted) * s, (self._wanted - to_left) * c
        rest = hypot(dx, dy)
        way = state.speed * step
        if self.is_unlimited:
            ahead = max(abs(way) - rest, 0.0)
            state.put_in_world(free(ours.x + dx + c * ahead, ours.y + dy + s * ahead, other.heading))
        elif rest < EPSILON:
            state.put_in_world(free(ours.x + c * way, ours.y + s * way, other.heading))
        else:
            heading = self._heading(ours.heading, other.heading, (dx, dy), rest, step)
            state.put_in_world(free(ours.x + cos(heading) * way, ours.y + sin(heading) * way, heading))
        return rest

    def align(self) -> None:
        """Nothing to put straight: it has the other entity's heading."""

    def _heading(self, heading: float, other: float, delta: tuple[float, float], rest: float, step: float) -> float:
        speed = self._state.speed
        way = speed * step
        radius = max(LEAST_RADIUS, PEAK_CURVATURE_RATIO * speed * speed / min(self._acceleration, MOST_ACCELERATION))
        if rest < 0.5 * way - EPSILON and 0.5 * way > radius - EPSILON:
            return _onto_line(other, delta, way)
        most = min(abs(speed / radius * step) * PEAK_CURVATURE_RATIO, pi - EPSILON)
        towards = difference(atan2(delta[1], delta[0]), heading)
        if rest > radius - EPSILON:
            turn = towards
        else:
            segment = way / radius
            angle = max(acos(1.0 - rest / radius), 0.5 * segment)
            share = (2.0 * angle - 0.5 * segment) / pi
            share = share * share * (3.0 - 2.0 * share)
            turn = share * towards + (1.0 - share) * difference(other, heading)
        return heading + min(max(turn, -most), most)


def _onto_line(heading: float, delta: tuple[float, float], way: float) -> float:
    """Direction in which the frame's way ends on the line, of the two the one along the line."""
    ahead = sqrt(max(way * way - delta[0] ** 2 - delta[1] ** 2, 0.0))
    return atan2(delta[1] + ahead * sin(heading), delta[0] + ahead * cos(heading))


CLOSE_ENOUGH = 0.01
"""A distance that is not kept continuously counts as reached. [m]"""


class RunningLateralDistance(RunningPrivateAction):
    """Beside another entity, in its own frame or in that of the road.

    With free space, the distance is that between boxes standing side by side. `any` side is the left one, as in the
    reference player; without a distance, the present one is kept.
    """

    domains = Domain.LONGITUDINAL
    """As in the reference player, where it ends speed actions and is ended by them, and goes on beside lane changes."""
    content: LateralDistanceAction

    def _prepare(self) -> None:
        self._other = self.simulation.entity(self.content.entity_ref, self.content.place)
        self.simulation.derives_motion = True

    def _begin(self) -> None:
        content, state, other = self.content, self.actor, self._other
        on_road = content.coordinate_system in (CoordinateSystem.ROAD, CoordinateSystem.LANE)
        state.locate()
        other.locate()
        if on_road and (state.road == NO_ROAD or other.road == NO_ROAD):
            self._refuse(f"'{state.name}' or '{other.name}' is on no road: the lateral distance is not kept")
            return
        limits = content.constraints or DynamicConstraints()
        self._way = (BesideOnRoad if on_road else BesideEntity)(state, other, self._wanted(), limits)
        if not on_road and limits.max_speed is not None:
            self.note("maxSpeed of a lateral distance in the entity's frame is not played (maxAcceleration is)")

    def _act(self, time: float, step: float) -> None:
        state, way = self.actor, self._way
        state.activity |= Activity.LATERAL
        before = state.plane
        rest = way.move(step)
        if rest is None:
            return
        if way.is_unlimited:
            dx, dy = state.plane.x - before.x, state.plane.y - before.y
            self._jumped(max((dx * dx + dy * dy) ** 0.5 - abs(state.speed) * step, 0.0))
        if not self.content.continuous and abs(rest) < CLOSE_ENOUGH:
            way.align()
            self.end()

    def _wanted(self) -> float:
        """Distance to the left of the other entity; negative: to the right. [m]"""
        content, other = self.content, self._other
        if content.distance is None:
            return ahead_and_left(other, self.actor.plane.x, self.actor.plane.y)[1]
        wanted = content.distance
        if content.freespace:
            half = 0.5 * (self.actor.entity.bounding_box.width + other.entity.bounding_box.width)
            wanted += copysign(half, wanted)
        if content.displacement is LateralDisplacement.ANY and self.simulation.scenario.header.version == (1, 0):
            return wanted  # version 1.0 has no displacement: the sign of the distance tells the side
        return -abs(wanted) if content.displacement is LateralDisplacement.RIGHT else abs(wanted)


RUNNING: dict[type, Maker] = {LateralDistanceAction: RunningLateralDistance}
