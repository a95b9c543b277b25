"""LongitudinalDistanceAction: keep a distance, or a time gap, to another entity."""

from __future__ import annotations

from math import inf, sqrt

from xosc_lateral.world.player.actions.base import Domain, Maker, RunningPrivateAction
from xosc_lateral.world.player.actions.speed_profile import limits_of
from xosc_lateral.world.player.distances import Measure, ahead_and_left
from xosc_lateral.world.player.drive import drive
from xosc_lateral.world.scenario.enums import CoordinateSystem, LongitudinalDisplacement, RelativeDistanceType
from xosc_lateral.world.scenario.private_actions import LongitudinalDistanceAction

CLOSE_ENOUGH = 0.1
"""A distance that is not kept continuously counts as reached. [m]"""

STIFFNESS = 0.4
"""Of the spring that pulls towards the distance, per acceleration available. [1/m]"""


class RunningLongitudinalDistance(RunningPrivateAction):
    """At once without dynamic constraints, else a critically damped spring within them."""

    domains = Domain.LONGITUDINAL
    content: LongitudinalDistanceAction

    def _prepare(self) -> None:
        self._measure = Measure(
            # with free space, the reference player measures in the own frame, whatever is asked for
            (not self.content.freespace and self.content.coordinate_system) or CoordinateSystem.ENTITY,
            RelativeDistanceType.LONGITUDINAL,
            self.content.freespace,
        )
        self._other = self.simulation.entity(self.content.entity_ref, self.content.place)
        self._limits = limits_of(self.content.constraints, self.actor.entity.performance)
        self._ahead: bool | None = None

    def _begin(self) -> None:
        """Decide on which side of the other entity to stay: the first time, as in the reference player."""
        self._acceleration = 0.0
        displacement = self.content.displacement
        if displacement is LongitudinalDisplacement.ANY and self._ahead is None:
            self._ahead = self._is_ahead()
        elif displacement is not LongitudinalDisplacement.ANY:
            # None given: behind the other (the reference player's default; version 1.0 knows nothing else).
            self._ahead = displacement is not LongitudinalDisplacement.LEADING
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

    # ---- in detail ---------------------------------------------------------------------------------------------------
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


RUNNING: dict[type, Maker] = {LongitudinalDistanceAction: RunningLongitudinalDistance}
