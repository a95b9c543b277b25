"""SynchronizeAction: be at a place when another entity, the master, is at its own.

Derived here: the speed m where both accelerations meet, m = v + a x = w + a (t - x), and the way, x (v + m) / 2 +
(t - x) (m + w) / 2 = s, give a quadratic equation for m.
"""

from __future__ import annotations

from enum import Enum
from math import copysign, cos, inf, sin, sqrt

from xosc_lateral.world.player.actions.base import Domain, Maker, RunningPrivateAction
from xosc_lateral.world.player.actions.longitudinal import relative_to
from xosc_lateral.world.player.distances import UNREACHABLE_DISTANCE, Spot, ahead_and_left, apart, road_gap
from xosc_lateral.world.player.paths.base import Path, PathProgress, nearest_s
from xosc_lateral.world.player.positions.resolve import spot_at
from xosc_lateral.world.player.state import EntityState
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.positions import is_forward
from xosc_lateral.world.scenario.position import Position, TrajectoryPosition
from xosc_lateral.world.scenario.private_actions import RelativeSpeedToMaster, SynchronizeAction

HARD_BRAKING = 8.0
"""When the entity comes so early that it has to stop at once. [m/s2]"""

SAME_SPEED = 0.1
"""The entity is on the straight line to the final speed when its speed differs by less. [m/s]"""


class SpeedPhase(Enum):
    """Which part of the speed profile the entity is on."""

    NONE = "not decided"
    TO_APEX = "first of two accelerations"
    LINE = "straight to the final speed"
    STOPPING = "braking hard"
    WAITING = "standing, the master stands too"
    STOPPED = "standing until it is time"
    STEADY = "at the final speed"


class RunningSynchronize(RunningPrivateAction):
    """Speeds that bring both to their places at the same time; it ends when either is there, or has gone past.

    Without a final speed: one constant acceleration, worked out anew in each frame. With one: two accelerations
    that differ in sign (first up then down, or first down then up, perhaps with a stop in between).
    """

    domains = Domain.LONGITUDINAL
    content: SynchronizeAction

    def _prepare(self) -> None:
        self.simulation.derives_motion = True
        self._master = self.simulation.entity(self.content.master_entity_ref, self.content.place)
        self._on_paths: dict[Spot, tuple[Path, float]] = {}

    def _begin(self) -> None:
        """Places are looked up once."""
        self._own_spot = spot_at(self.content.target_position, self.simulation)()
        self._master_spot = spot_at(self.content.target_position_master, self.simulation)()
        if self._way_to(self.actor, self._own_spot, self.content.target_position) < 0.0:
            self.note(f"the place of '{self.actor.name}' lies behind it: at its final speed at once (not so in esmini)")
        self._mode = SpeedPhase.NONE
        self._last = (UNREACHABLE_DISTANCE, UNREACHABLE_DISTANCE)

    def _act(self, time: float, step: float) -> None:
        state, content = self.actor, self.content
        distance = abs(self._way_to(state, self._own_spot, content.target_position))
        master_way = self._way_to(self._master, self._master_spot, content.target_position_master)
        master_distance = abs(master_way)
        tolerance, master_tolerance = content.target_tolerance or 0.0, content.target_tolerance_master or 0.0
        there = distance < tolerance + EPSILON or master_distance < master_tolerance + EPSILON
        passed = distance > self._last[0] or master_distance > self._last[1]
        self._last = distance, master_distance
        distance = max(distance - tolerance, EPSILON)
        master_distance = max(master_distance - master_tolerance, EPSILON)
        # in the frame of no duration nothing has moved yet: every master stands (as in the reference player)
        master_speed = copysign(1.0, master_way) * along_road(self._master) if step > EPSILON else 0.0
        time_left = master_distance / master_speed if master_speed > EPSILON else UNREACHABLE_DISTANCE
        if time_left == UNREACHABLE_DISTANCE and self._mode is not SpeedPhase.WAITING:
            self._mode = SpeedPhase.WAITING
            state.set_speed(0.0)
        final = self._final_speed()
        if there or passed or (master_speed > EPSILON and time_left < step):
            if final is not None:
                state.set_speed(final)
            self.end()
            return
        state.speed_taken = True
        if final is not None:
            state.speed = self._speed_towards(final, distance, time_left, step)
        elif time_left != UNREACHABLE_DISTANCE:
            self._mode = SpeedPhase.LINE
            mean = distance / time_left
            acceleration = 2.0 * (mean - state.speed) / time_left
            state.speed += acceleration * step

    def _way_to(self, entity: EntityState, spot: Spot, position: Position) -> float:
        """Left on the trajectory, else along the road, else straight; negative: the entity has it in its back. [m]"""
        if entity.path is not None:
            way = self._target_s(entity.path, spot, position) - entity.path.s
            tangent = entity.path.path.at(entity.path.s).tangent
            return way if is_forward(entity.plane.heading - tangent) else -way
        entity.locate()
        along = None
        if entity.route is not None:
            along = entity.route.way_to((entity.road, entity.s), (spot.road, spot.s))
        if along is not None:
            return along
        gap = road_gap(entity, spot)
        if gap is not None:
            return gap.ds
        ahead, _ = ahead_and_left(entity, spot.x, spot.y)
        return copysign(apart(entity, spot.x, spot.y), ahead)

    def _target_s(self, progress: PathProgress, spot: Spot, position: Position) -> float:
        """Where on a path the place is; looked for once for each path. [m]"""
        if isinstance(position, TrajectoryPosition):
            return position.s
        known = self._on_paths.get(spot)
        if known is None or known[0] is not progress.path:
            known = (progress.path, nearest_s(progress.path, spot.x, spot.y))
            self._on_paths[spot] = known
        return known[1]

    def _final_speed(self) -> float | None:
        final = self.content.final_speed
        if isinstance(final, RelativeSpeedToMaster):
            return relative_to(self._master.speed, final)
        return None if final is None else final.value

    def _steady_distance(self, final: float) -> float | None:
        steady = None if self.content.final_speed is None else self.content.final_speed.steady_state
        if steady is None:
            return None
        return steady.distance if steady.distance is not None else (steady.time or 0.0) * final

    def _speed_towards(self, final: float, distance: float, time_left: float, step: float) -> float:
        """The next speed. [m/s]"""
        state = self.actor
        steady = self._steady_distance(final)
        if steady is not None and self._mode is not SpeedPhase.STEADY:
            steady_time = steady / final if final else inf
            if distance - steady < EPSILON or time_left - steady_time < EPSILON:
                self._mode = SpeedPhase.STEADY
            else:
                distance, time_left = distance - steady, time_left - steady_time
        if self._mode is SpeedPhase.STEADY:
            return final
        if self._mode is SpeedPhase.WAITING:
            if time_left >= UNREACHABLE_DISTANCE:
                return state.speed
            self._mode = SpeedPhase.NONE
        if self._mode is SpeedPhase.STOPPING:
            speed = state.speed - HARD_BRAKING * step
            if speed < 0.0:
                self._mode = SpeedPhase.WAITING
            return max(speed, 0.0)
        if self._mode is SpeedPhase.STOPPED:
            if time_left >= 2.0 * distance / max(final, EPSILON):
                return 0.0
            self._mode = SpeedPhase.LINE
        to_line = abs(state.speed - (2.0 * distance / time_left - final)) if time_left < UNREACHABLE_DISTANCE else inf
        if self._mode is SpeedPhase.TO_APEX and to_line < SAME_SPEED:
            self._mode = SpeedPhase.LINE
            return state.speed
        if self._mode is SpeedPhase.LINE:
            return _on_line(final, distance, time_left)
        if self._mode is SpeedPhase.NONE:
            self._mode = SpeedPhase.TO_APEX
            self._rushes = 0.5 * (final + state.speed) < distance / time_left
        return self._to_apex(final, distance, time_left, step)

    def _to_apex(self, final: float, s: float, t: float, step: float) -> float:
        state = self.actor
        now = along_road(state)
        apex, acceleration = _two_accelerations(now, final, s, t)
        if acceleration < 0.0 if self._rushes else acceleration > 0.0:
            self._mode = SpeedPhase.LINE
            return state.speed
        if apex >= 0.0:
            return state.speed + acceleration * step
        # The way is so short that the entity has to stop and wait, sharing way and time as the speeds do.
        stop_time = 2.0 * now * s / (now * now + final * final) if now or final else 0.0
        acceleration = -now / stop_time if abs(stop_time) > EPSILON else 0.0
        if stop_time * now > s:
            acceleration = -HARD_BRAKING
            self._mode = SpeedPhase.STOPPING
        if now + acceleration * step < 0.0:
            self._mode = SpeedPhase.STOPPED
            return 0.0
        return state.speed + acceleration * step


def along_road(state: EntityState) -> float:
    """Velocity along the road's reference line, with the sign of the speed. [m/s]"""
    heading = state.road_heading()
    vx, vy, _ = state.velocity
    return copysign(abs(vx * cos(heading) + vy * sin(heading)), state.speed)


def _on_line(final: float, distance: float, time_left: float) -> float:
    """Speed now that a constant acceleration turns into the final speed at the place; 0 while the master stands."""
    if time_left > UNREACHABLE_DISTANCE - 1.0 or time_left < 0.001 or distance < 0.001:
        return 0.0
    return max(2.0 * distance / time_left - max(final, 0.0), 0.0)


def _two_accelerations(now: float, final: float, s: float, t: float) -> tuple[float, float]:
    """Speed between two accelerations of equal amount that cover s in t, and the first of them; (0, 0): none."""
    if abs(final - now) < EPSILON:
        apex = (s - 0.5 * t * now) / (0.5 * t)
        return apex, (apex - now) / (0.5 * t)
    root = sqrt(max(2.0 * (2.0 * s * s - 2.0 * (final + now) * t * s + (final * final + now * now) * t * t), 0.0))
    for sign in (-1.0, 1.0):
        at = (sign * root - 2.0 * s + 2.0 * final * t) / (2.0 * (final - now))
        if 0.0 < at < t:
            apex = (2.0 * s + sign * root) / (2.0 * t)
            return apex, (apex - now) / at
    return 0.0, 0.0


RUNNING: dict[type, Maker] = {SynchronizeAction: RunningSynchronize}
