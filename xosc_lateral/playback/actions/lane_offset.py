"""LaneOffsetAction."""

from __future__ import annotations

from math import atan, pi

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.playback.actions.base import Domain, RunningAction
from xosc_lateral.playback.state import NOWHERE
from xosc_lateral.playback.transition import EPSILON, Transition
from xosc_lateral.scenario.enums import DynamicsDimension, DynamicsShape
from xosc_lateral.scenario.private_actions import AbsoluteTargetLaneOffset, LaneOffsetAction

DEFAULT_LATERAL_ACCELERATION = 0.5
"""Where the file has none; the standard says as fast as can be, the reference player has this value. [m/s2]"""


class RunningLaneOffset(RunningAction):
    """Sideways within the lane, or beyond, while the default driver (or an action) moves ahead.

    The duration follows from the lateral acceleration. In the first frame nothing moves yet.
    """

    domains = Domain.LATERAL
    content: LaneOffsetAction

    def prepare(self) -> None:
        """Find the entity that the offset is relative to."""
        target = self.content.target
        self._reference = (
            None
            if isinstance(target, AbsoluteTargetLaneOffset)
            else self.simulation.entity(target.entity_ref, self.content.place)
        )
        self._transition: Transition | None = None
        self._road = NOWHERE

    def start(self) -> None:
        """From the present offset; a relative target is read once."""
        state = self.state
        state.locate()
        self._transition = None
        if state.road == NOWHERE:
            self.note(f"'{state.name}' is on no road: the lane offset is not played")
            return
        state.follow_lane()
        transition = Transition(self.content.shape, DynamicsDimension.TIME, 0.0)
        transition.begin(state.offset_t, self._target())
        limit = self.content.max_lateral_acc
        if limit is None:
            limit = DEFAULT_LATERAL_ACCELERATION
            if self.content.shape is not DynamicsShape.STEP:
                self.note(f"no maxLateralAcc: played with {limit:g} m/s2")
        transition.range = transition.range_for_curvature(limit)
        self._transition = transition
        self._forward = state.is_forward

    def step(self, time: float, step: float) -> None:
        """Set the offset of the start of the frame, and a heading along the movement."""
        state, transition = self.state, self._transition
        if transition is None:
            self.end()
            return
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
                self.jumped(transition.target - state.offset_t)
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
        target, state = self.content.target, self.state
        if isinstance(target, AbsoluteTargetLaneOffset):
            if self.simulation.scenario.header.is_left_handed:  # counts from the lane's direction, not the road's
                return target.value * self.simulation.network.travel_direction(state.road, state.lane)
            return target.value
        reference = self._reference
        assert reference is not None
        reference.locate()
        wanted_t = reference.t + (target.value if reference.is_forward else -target.value)
        return wanted_t - (state.t - state.offset_t)


RUNNING: dict[type, type[RunningAction]] = {LaneOffsetAction: RunningLaneOffset}
