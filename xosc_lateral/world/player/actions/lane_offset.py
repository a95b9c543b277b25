"""LaneOffsetAction."""

from __future__ import annotations

from math import atan, pi

from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.player.actions.base import Domain, Maker, RunningPrivateAction
from xosc_lateral.world.player.distances import is_turned
from xosc_lateral.world.player.state import NO_ROAD
from xosc_lateral.world.player.transition import EPSILON, Transition
from xosc_lateral.world.scenario.enums import DynamicsDimension, DynamicsShape
from xosc_lateral.world.scenario.private_actions import LaneOffsetAction

DEFAULT_LATERAL_ACCELERATION = 0.5
"""Where the file has none; the standard says as fast as can be, the reference player has this value. [m/s2]"""


class RunningLaneOffset(RunningPrivateAction):
    """Sideways within the lane, or beyond, while the default driver (or an action) moves ahead.

    The duration follows from the lateral acceleration; a relative target is read once. Each frame has the offset of its
    start, and a heading along the movement: in the first one nothing moves yet.
    """

    domains = Domain.LATERAL
    content: LaneOffsetAction

    def _prepare(self) -> None:
        self._reference = self._referred(self.content.target)

    def _begin(self) -> None:
        state = self.actor
        state.locate()
        if state.road == NO_ROAD:
            self._refuse(f"'{state.name}' is on no road: the lane offset is not played")
            return
        state.follow_lane()
        transition = self._transition = Transition(self.content.shape, DynamicsDimension.TIME, 0.0)
        transition.begin(state.offset_t, self._target())
        limit = self.content.max_lateral_acc
        if limit is None:
            limit = DEFAULT_LATERAL_ACCELERATION
            if self.content.shape is not DynamicsShape.STEP:
                self.note(f"no maxLateralAcc: played with {limit:g} m/s2")
        transition.range = transition.range_for_curvature(limit)
        self._forward = state.is_forward

    def _act(self, time: float, step: float) -> None:
        state, transition = self.actor, self._transition
        state.locate()  # another action may have moved it in the world
        if state.is_forward is not self._forward:
            # The road under the entity now runs the other way, and so does its +t.
            transition.start, transition.target = -transition.start, -transition.target
            self._forward = state.is_forward
        offset = transition.value()
        done = transition.is_done or abs(offset - transition.target) < EPSILON
        along = 0.0 if state.is_forward else pi
        state.activity |= Activity.LATERAL
        if done:
            if transition.is_step:
                self._jumped(transition.target - state.offset_t)
            state.move_to(state.road, state.lane, state.s, transition.target)
            state.turn(along)
            self.end()
        else:
            state.move_to(state.road, state.lane, state.s, offset)
            speed = state.speed or EPSILON
            turn = atan(transition.slope() / speed)
            state.turn(along + (turn if state.is_forward else -turn))
        transition.advance(step)

    def _target(self) -> float:
        value, state, reference = self.content.target.value, self.actor, self._reference
        if reference is not None:
            reference.locate()
            t = reference.t + (value if reference.is_forward else -value)
            return (-t if is_turned(state, reference) else t) - (state.t - state.offset_t)
        if self.simulation.scenario.header.is_left_handed:  # counts from the lane's direction, not the road's
            return value * state.network.travel_direction(state.road, state.lane)
        return value


RUNNING: dict[type, Maker] = {LaneOffsetAction: RunningLaneOffset}
