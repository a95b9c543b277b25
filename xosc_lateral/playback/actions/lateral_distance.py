"""LateralDistanceAction: keep a lateral distance to another entity."""

from __future__ import annotations

from math import copysign

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.playback.actions.base import Domain, RunningAction
from xosc_lateral.playback.actions.beside_entity import BesideEntity
from xosc_lateral.playback.actions.beside_on_road import BesideOnRoad
from xosc_lateral.playback.distances import ahead_and_left
from xosc_lateral.playback.placement import NOWHERE
from xosc_lateral.scenario.actions.lateral import LateralDistanceAction
from xosc_lateral.scenario.enums import CoordinateSystem, LateralDisplacement

CLOSE_ENOUGH = 0.01
"""A distance that is not kept continuously counts as reached. [m]"""


class RunningLateralDistance(RunningAction):
    """Beside another entity, in its own frame or in that of the road.

    With free space, the distance is that between boxes standing side by side. `any` side is the left one, as in the
    reference player; without a distance, the present one is kept.
    """

    domains = Domain.LONGITUDINAL
    """As in the reference player, where it ends speed actions and is ended by them, and goes on beside lane changes."""
    content: LateralDistanceAction

    def prepare(self) -> None:
        """Find the entity to keep the distance to."""
        self._other = self.simulation.entity(self.content.entity_ref, self.content.place)
        self.simulation.derives_motion = True
        self._way: BesideEntity | BesideOnRoad | None = None

    def start(self) -> None:
        """Decide on which side of the other entity to be."""
        content, state, other = self.content, self.state, self._other
        on_road = content.coordinate_system in (CoordinateSystem.ROAD, CoordinateSystem.LANE)
        state.locate()
        other.locate()
        self._way = None
        if on_road and (state.road == NOWHERE or other.road == NOWHERE):
            self.note(f"'{state.name}' or '{other.name}' is on no road: the lateral distance is not kept")
            return
        wanted = self._wanted()
        if on_road:
            self._way = BesideOnRoad(state, other, wanted, content.constraints)
            return
        self._way = BesideEntity(state, other, wanted, content.constraints)
        if content.constraints is not None and content.constraints.max_speed is not None:
            self.note("maxSpeed of a lateral distance in the entity's frame is not played (maxAcceleration is)")

    def step(self, time: float, step: float) -> None:
        """Move ahead and sideways."""
        way = self._way
        if way is None:
            self.end()
            return
        state = self.state
        state.activity |= Activity.LATERAL
        before = state.plane
        rest = way.move(step)
        if rest is None:
            return
        if way.is_unlimited:
            dx, dy = state.plane.x - before.x, state.plane.y - before.y
            self.jumped(max((dx * dx + dy * dy) ** 0.5 - abs(state.speed) * step, 0.0))
        if not self.content.continuous and abs(rest) < CLOSE_ENOUGH:
            way.align()
            self.end()

    def _wanted(self) -> float:
        """Distance to the left of the other entity; negative: to the right. [m]"""
        content, other = self.content, self._other
        if content.distance is None:
            return ahead_and_left(other, self.state.plane.x, self.state.plane.y)[1]
        wanted = content.distance
        if content.freespace:
            half = 0.5 * (self.state.entity.bounding_box.width + other.entity.bounding_box.width)
            wanted += copysign(half, wanted)
        if content.displacement is LateralDisplacement.ANY and self.simulation.scenario.header.version == (1, 0):
            return wanted  # version 1.0 has no displacement: the sign of the distance tells the side
        return -abs(wanted) if content.displacement is LateralDisplacement.RIGHT else abs(wanted)


RUNNING: dict[type, type[RunningAction]] = {LateralDistanceAction: RunningLateralDistance}
