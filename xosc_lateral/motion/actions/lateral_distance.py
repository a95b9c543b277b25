"""LateralDistanceAction: keep a lateral distance to another entity."""

from __future__ import annotations

from math import inf, pi, sqrt

from xosc_lateral.motion import boxes
from xosc_lateral.motion.actions.base import Domain, RunningAction
from xosc_lateral.motion.actions.constraints import limits_of
from xosc_lateral.motion.distances import ahead_and_left, road_gap, spot_of
from xosc_lateral.motion.nominal import Activity
from xosc_lateral.motion.state import NOWHERE
from xosc_lateral.scenario.actions import LateralDistanceAction
from xosc_lateral.scenario.enums import CoordinateSystem, LateralDisplacement

CLOSE_ENOUGH = 0.1
"""A distance that is not kept continuously counts as reached. [m]"""

STIFFNESS = 0.4
"""Of the spring that pulls towards the distance, per acceleration available. [1/m]"""


class RunningLateralDistance(RunningAction):
    """At once without dynamic constraints, else a critically damped spring within them; the default driver moves ahead."""

    domains = Domain.LATERAL
    content: LateralDistanceAction

    def prepare(self) -> None:
        """Find the entity to keep the distance to."""
        self._other = self.run.entity(self.content.entity_ref, self.content.place)
        self._left = True
        self._wanted = 0.0
        self._speed = 0.0

    def start(self) -> None:
        """Decide on which side of the other entity to stay."""
        self._speed = 0.0
        distance = self._distance()
        displacement = self.content.displacement
        if displacement is LateralDisplacement.ANY:
            self._left = distance <= 0.0
        else:
            self._left = displacement is LateralDisplacement.LEFT
        wanted = abs(distance) if self.content.distance is None else abs(self.content.distance)
        self._wanted = -wanted if self._left else wanted

    def step(self, time: float, step: float) -> None:
        """Move sideways."""
        state = self.state
        state.locate()
        if state.road == NOWHERE:
            self.note(f"'{state.name}' is on no road: the lateral distance is not kept")
            self.end()
            return
        state.activity |= Activity.LATERAL
        rest = self._distance() - self._wanted
        if not self.content.continuous and abs(rest) < CLOSE_ENOUGH:
            self.end()
        self._move(self._sideways(rest, step))

    # ---- in detail ---------------------------------------------------------------------------------------------------
    def _distance(self) -> float:
        """From the actor to the other, positive when the other is to the left. [m]"""
        state, other = self.state, self._other
        if self.content.freespace:
            return boxes.gaps(state, boxes.corners(other))[1]
        if self.content.coordinate_system in (CoordinateSystem.ROAD, CoordinateSystem.LANE):
            gap = road_gap(self.run.network, state, spot_of(other))
            if gap is not None:
                return gap.dt if state.is_forward else -gap.dt
        return -ahead_and_left(other, state.pose.x, state.pose.y)[1]

    def _sideways(self, rest: float, step: float) -> float:
        """Movement of the frame to the left. [m]"""
        constraints = self.content.constraints
        limits = limits_of(constraints, self.state.entity.performance)
        if constraints is None or constraints.max_acceleration is None or limits.acceleration == inf:
            return rest
        stiffness = STIFFNESS * limits.acceleration
        pull = rest * stiffness - self._speed * 2.0 * sqrt(stiffness)
        pull = min(max(pull, -limits.deceleration), limits.acceleration)
        self._speed = min(max(self._speed + pull * step, -limits.speed), limits.speed)
        return self._speed * step

    def _move(self, sideways: float) -> None:
        state, network = self.state, self.run.network
        state.follow_lane()
        t = state.t + (sideways if state.is_forward else -sideways)
        found = network.lane_at(state.road, state.s, t)
        lane = found.lane or state.lane
        state.move_to(state.road, lane, state.s, t - network.lane_state_at(state.road, lane, state.s).centre_t)
        state.section = (0.0, -1.0)
        state.turn(0.0 if state.is_forward else pi)
