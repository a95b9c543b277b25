"""LateralDistanceAction: keep a lateral distance to another entity."""

from __future__ import annotations

from math import asin, copysign, inf, pi, sqrt

from xosc_lateral.motion.actions.base import Domain, RunningAction
from xosc_lateral.motion.actions.constraints import Limits
from xosc_lateral.motion.distances import ahead_and_left, road_gap, spot_of
from xosc_lateral.motion.drive import along_reference, travel
from xosc_lateral.motion.nominal import Activity
from xosc_lateral.motion.state import NOWHERE
from xosc_lateral.motion.transition import EPSILON
from xosc_lateral.scenario.actions import LateralDistanceAction
from xosc_lateral.scenario.dynamics import DynamicConstraints
from xosc_lateral.scenario.enums import CoordinateSystem, LateralDisplacement

CLOSE_ENOUGH = 0.01
"""A distance that is not kept continuously counts as reached. [m]"""

STIFFNESS = 0.4
"""Of the spring that pulls towards the distance, per acceleration available. [1/m]"""


class RunningLateralDistance(RunningAction):
    """Sideways at the speed allowed, or by a critically damped spring where an acceleration is given.

    With free space, the distance is that between boxes standing side by side. The way of one frame on the entity's own
    track is `speed * step`: what goes sideways is missing ahead. Nothing moves in the first frame.
    """

    domains = Domain.LATERAL
    content: LateralDistanceAction

    def prepare(self) -> None:
        """Find the entity to keep the distance to."""
        self._other = self.run.entity(self.content.entity_ref, self.content.place)
        self._left = True
        self._wanted = 0.0
        self._speed = 0.0
        self._is_first = True

    def start(self) -> None:
        """Decide on which side of the other entity to be."""
        self._speed = 0.0
        self._is_first = True
        beside = self._beside()
        displacement = self.content.displacement
        if displacement is LateralDisplacement.ANY:
            self._left = beside >= 0.0
        else:
            self._left = displacement is LateralDisplacement.LEFT
        wanted = abs(beside)
        if self.content.distance is not None:
            wanted = abs(self.content.distance)
            if self.content.freespace:
                wanted += 0.5 * (self.state.entity.bounding_box.width + self._other.entity.bounding_box.width)
        self._wanted = wanted if self._left else -wanted

    def step(self, time: float, step: float) -> None:
        """Move ahead and sideways."""
        state = self.state
        state.locate()
        if state.road == NOWHERE:
            self.note(f"'{state.name}' is on no road: the lateral distance is not kept")
            self.end()
            return
        state.activity |= Activity.LATERAL
        if self._is_first:
            self._is_first = False
            return
        rest = self._wanted - self._beside()
        across = self._sideways(rest, step)
        self._move(across, step)
        if self._is_unlimited:
            self.jumped(max(abs(across) - abs(state.speed) * step, 0.0))
        if not self.content.continuous and abs(rest) < CLOSE_ENOUGH:
            state.turn(0.0 if state.is_forward else pi)
            self.end()

    # ---- in detail ---------------------------------------------------------------------------------------------------
    def _beside(self) -> float:
        """Of the other, positive to the left of it. [m]"""
        state, other = self.state, self._other
        if self.content.coordinate_system in (CoordinateSystem.ROAD, CoordinateSystem.LANE):
            gap = road_gap(self.run.network, other, spot_of(state))
            if gap is not None:
                return gap.dt if other.is_forward else -gap.dt
        return ahead_and_left(other, state.pose.x, state.pose.y)[1]

    def _sideways(self, rest: float, step: float) -> float:
        """Movement of the frame to the left. [m]"""
        limits = self._limits()
        if limits.acceleration == inf:
            most = inf if limits.speed == inf else limits.speed * step
            return min(max(rest, -most), most)
        stiffness = STIFFNESS * limits.acceleration
        pull = rest * stiffness - self._speed * 2.0 * sqrt(stiffness)
        pull = min(max(pull, -limits.deceleration), limits.acceleration)
        self._speed = min(max(self._speed + pull * step, -limits.speed), limits.speed)
        return self._speed * step

    @property
    def _is_unlimited(self) -> bool:
        limits = self._limits()
        return limits.acceleration == inf and limits.speed == inf

    def _limits(self) -> Limits:
        """As given, not capped by what the entity can do ahead; without an acceleration there is no spring."""
        given = self.content.constraints or DynamicConstraints()
        speed = inf if given.max_speed is None else given.max_speed
        if given.max_acceleration is None:
            return Limits(speed, inf, inf, inf, inf)
        acceleration = given.max_acceleration
        deceleration = acceleration if given.max_deceleration is None else given.max_deceleration
        return Limits(speed, acceleration, deceleration, inf, inf)

    def _move(self, sideways: float, step: float) -> None:
        state, network = self.state, self.run.network
        state.follow_lane()
        state.take_control(Activity.LATERAL)
        state.speed_taken = True
        way = abs(state.speed) * step
        across = min(max(sideways, -way), way) if way > EPSILON else 0.0
        ahead = copysign(sqrt(way * way - across * across), state.speed)
        forward = state.is_forward
        t = state.t + (sideways if forward else -sideways)
        found = network.lane_at(state.road, state.s, t)
        lane = found.lane or state.lane
        state.move_to(state.road, lane, state.s, t - network.lane_state_at(state.road, lane, state.s).centre_t)
        state.section = (0.0, -1.0)
        on_line = along_reference(network, state.road, state.lane, state.s, state.offset_t, ahead)
        travel(state, 1 if forward else -1, on_line)
        turn = copysign(asin(across / way), across * state.speed) if way > EPSILON and across else 0.0
        state.turn((0.0 if state.is_forward else pi) + turn)
