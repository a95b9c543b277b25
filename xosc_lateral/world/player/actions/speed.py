"""SpeedAction: to a speed, absolute or relative to another entity's."""

from __future__ import annotations

from math import copysign

from xosc_lateral.world.player.actions.base import Domain, Maker, RunningPrivateAction
from xosc_lateral.world.player.transition import EPSILON, Transition
from xosc_lateral.world.scenario.enums import DynamicsDimension, SpeedTargetValueType
from xosc_lateral.world.scenario.private_actions import (
    AbsoluteTargetSpeed,
    RelativeSpeedToMaster,
    RelativeTargetSpeed,
    SpeedAction,
)


class RunningSpeed(RunningPrivateAction):
    """Speed along a transition over time, within the performance of the entity.

    A transition over a distance is turned into one over the time that it takes at the mean of both speeds. A relative
    target is read anew in each frame; a continuous one is followed for ever once it is reached. A frame is driven with
    the speed of its end.
    """

    domains = Domain.LONGITUDINAL
    content: SpeedAction

    def _prepare(self) -> None:
        self._reference = self._referred(self.content.target)

    def _begin(self) -> None:
        state = self.actor
        self._reached = False
        self._transition = transition = Transition.of(self.content.dynamics)
        target = self._limited(self._target())
        if transition.dimension is DynamicsDimension.DISTANCE:
            transition.range = duration_of(state.speed, self._target(), transition.range)
        transition.begin(state.speed, target)
        limits = state.entity.performance
        transition.limit_slope(limits.max_acceleration if target > state.speed else limits.max_deceleration)
        state.set_speed(transition.value())

    def _act(self, time: float, step: float) -> None:
        state, transition = self.actor, self._transition
        if self._reference is not None:
            transition.aim(self._limited(self._target()))
        if transition.range > 0.0 and transition.is_done:
            speed = self._approach(self._target(), step)
        else:
            speed = self._along_transition(step)
        if transition.is_done and abs(speed - transition.target) < EPSILON:
            self._reached = True
            speed = self._limited(self._target())
        state.set_speed(speed)
        if self._reached and not getattr(self.content.target, "continuous", False):
            self.end()

    # ---- in detail ---------------------------------------------------------------------------------------------------
    def _target(self) -> float:
        target = self.content.target
        if self._reference is None or isinstance(target, AbsoluteTargetSpeed):
            return target.value
        return relative_to(self._reference.speed, target)

    def _limited(self, speed: float) -> float:
        limit = self.actor.entity.performance.max_speed
        return min(max(speed, -limit), limit)

    def _approach(self, target: float, step: float) -> float:
        """After the transition: as fast as the entity can."""
        state, limits = self.actor, self.actor.entity.performance
        if step <= EPSILON:
            return state.speed
        change = (target - state.speed) / step
        change = min(max(change, -limits.max_deceleration), limits.max_acceleration)
        return self._limited(state.speed + change * step)

    def _along_transition(self, step: float) -> float:
        state, limits, transition = self.actor, self.actor.entity.performance, self._transition
        transition.advance(step)
        speed = transition.value()
        if step <= EPSILON:
            return speed
        wanted = (speed - state.speed) / step
        if -limits.max_deceleration - EPSILON <= wanted <= limits.max_acceleration + EPSILON:
            return speed
        possible = min(max(wanted, -limits.max_deceleration), limits.max_acceleration)
        speed = self._limited(state.speed + possible * step)
        transition.advance(-(step - (speed - state.speed) / wanted))
        return speed


def relative_to(speed: float, target: RelativeTargetSpeed | RelativeSpeedToMaster) -> float:
    """What is asked for while the other entity has this speed. [m/s]"""
    return speed + target.value if target.value_type is SpeedTargetValueType.DELTA else speed * target.value


def duration_of(start: float, target: float, distance: float) -> float:
    """Time to change speed evenly over a distance; through 0, in two parts in proportion to the squares. [s]"""
    if abs(target - start) < EPSILON:
        return 0.0
    if abs(start) > EPSILON and abs(target) > EPSILON and copysign(1.0, start) != copysign(1.0, target):
        before = start * start / (start * start + target * target) * distance
        return 2.0 * before / abs(start) + 2.0 * (distance - before) / abs(target)
    return 2.0 * distance / abs(start + target)


RUNNING: dict[type, Maker] = {SpeedAction: RunningSpeed}
