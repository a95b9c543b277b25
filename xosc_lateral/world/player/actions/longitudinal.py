"""SpeedAction and LongitudinalDistanceAction: to a speed or a distance, absolute or from another entity's."""

from __future__ import annotations

from math import copysign, inf, sqrt

from xosc_lateral.world.player.actions.base import Domain, Maker, RunningPrivateAction, RunningToTarget
from xosc_lateral.world.player.actions.speed_profile import limits_of
from xosc_lateral.world.player.distances import Measure, ahead_and_left
from xosc_lateral.world.player.drive import drive
from xosc_lateral.world.player.transition import EPSILON, Transition
from xosc_lateral.world.scenario import enums, private_actions


class RunningSpeed(RunningToTarget):
    """Speed along a transition over time, within the performance of the entity.

    A transition over a distance is turned into one over the time that it takes at the mean of both speeds. A relative
    target is read anew in each frame; a continuous one is followed for ever once it is reached. A frame is driven with
    the speed of its end.
    """

    domains = Domain.LONGITUDINAL
    content: private_actions.SpeedAction

    def _begin(self) -> None:
        state = self.actor
        self._reached = False
        self._transition = transition = Transition.of(self.content.dynamics)
        target = self._limited(self._target())
        if transition.dimension is enums.DynamicsDimension.DISTANCE:
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

    def _target(self) -> float:
        target = self.content.target
        if self._reference is None or isinstance(target, private_actions.AbsoluteTargetSpeed):
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


def relative_to(
    speed: float, target: private_actions.RelativeTargetSpeed | private_actions.RelativeSpeedToMaster
) -> float:
    """What is asked for while the other entity has this speed. [m/s]"""
    return speed + target.value if target.value_type is enums.SpeedTargetValueType.DELTA else speed * target.value


def duration_of(start: float, target: float, distance: float) -> float:
    """Time to change speed evenly over a distance; through 0, in two parts in proportion to the squares. [s]"""
    if abs(target - start) < EPSILON:
        return 0.0
    if abs(start) > EPSILON and abs(target) > EPSILON and copysign(1.0, start) != copysign(1.0, target):
        before = start * start / (start * start + target * target) * distance
        return 2.0 * before / abs(start) + 2.0 * (distance - before) / abs(target)
    return 2.0 * distance / abs(start + target)


# ---- LongitudinalDistanceAction ----
CLOSE_ENOUGH = 0.1
"""A distance that is not kept continuously counts as reached. [m]"""

STIFFNESS = 0.4
"""Of the spring that pulls towards the distance, per acceleration available. [1/m]"""


class RunningLongitudinalDistance(RunningPrivateAction):
    """At once without dynamic constraints, else a critically damped spring within them."""

    domains = Domain.LONGITUDINAL
    content: private_actions.LongitudinalDistanceAction

    def _prepare(self) -> None:
        self._measure = Measure(
            # with free space, the reference player measures in the own frame, whatever is asked for
            (not self.content.freespace and self.content.coordinate_system) or enums.CoordinateSystem.ENTITY,
            enums.RelativeDistanceType.LONGITUDINAL,
            self.content.freespace,
        )
        self._other = self.simulation.entity(self.content.entity_ref, self.content.place)
        self._limits = limits_of(self.content.constraints, self.actor.entity.performance)
        self._ahead: bool | None = None

    def _begin(self) -> None:
        """Decide on which side of the other entity to stay: the first time, as in the reference player."""
        self._acceleration = 0.0
        displacement = self.content.displacement
        if displacement is enums.LongitudinalDisplacement.ANY and self._ahead is None:
            self._ahead = self._is_ahead()
        elif displacement is not enums.LongitudinalDisplacement.ANY:
            # None given: behind the other (the reference player's default; version 1.0 knows nothing else).
            self._ahead = displacement is not enums.LongitudinalDisplacement.LEADING
        keeps = self.content.distance is None and self.content.time_gap is None
        self._kept = self._distance() if keeps else None

    def _act(self, time: float, step: float) -> None:
        state, other = self.actor, self._other
        distance = self._distance()
        if distance is None:
            self.note(f"no way from '{state.name}' to '{other.name}': the distance is not kept")
            self.end()
            return
        rest = distance - self._wanted()
        if not self.content.continuous and abs(rest) < CLOSE_ENOUGH:
            self.end()
        limits = self._limits
        if limits.max_acceleration == inf and limits.max_deceleration == inf:
            drive(state, rest)
            state.set_speed(other.speed)
            return
        self._acceleration = self._pull(rest, step)
        speed = state.speed + self._acceleration * step
        state.set_speed(min(max(speed, -limits.max_speed), limits.max_speed))

    def _is_ahead(self) -> bool:
        """Whether the other one is ahead; with free space also while it is alongside."""
        if self.content.freespace:
            return (self._distance() or 0.0) >= 0.0
        return ahead_and_left(self.actor, self._other.pose.x, self._other.pose.y)[0] >= 0.0

    def _distance(self) -> float | None:
        return self._measure.to_entity(self.actor, self._other)

    def _wanted(self) -> float:
        if self._kept is not None:
            return self._kept
        if self.content.distance is not None:
            amount = abs(self.content.distance)
        else:
            amount = abs(self._other.speed) * (self.content.time_gap or 0.0)
        return amount if self._ahead else -amount

    def _pull(self, rest: float, step: float) -> float:
        limits = self._limits
        tension = limits.max_acceleration if rest < 0.0 else limits.max_deceleration
        stiffness = STIFFNESS * min(tension, 1e10)
        wanted = rest * stiffness - (self.actor.speed - self._other.speed) * 2.0 * sqrt(stiffness)
        wanted = min(max(wanted, -limits.max_deceleration), limits.max_acceleration)
        before = self._acceleration
        if wanted < 0.0 and wanted < before:
            return max(before - _grown(limits.max_deceleration_rate, step), wanted)
        if wanted >= 0.0 and wanted > before:
            return min(before + _grown(limits.max_acceleration_rate, step), wanted)
        return wanted


def _grown(rate: float, step: float) -> float:
    """How far an acceleration may change; nothing in no time, even without a limit."""
    return 0.0 if step <= 0.0 else rate * step


RUNNING: dict[type, Maker] = {
    private_actions.SpeedAction: RunningSpeed,
    private_actions.LongitudinalDistanceAction: RunningLongitudinalDistance,
}
