"""Conditions on distances: to a position, to an entity, headway in time, and contact."""

from __future__ import annotations

from typing import Protocol

from xosc_lateral.playback.angles import difference
from xosc_lateral.playback.boxes import overlap
from xosc_lateral.playback.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.playback.distances import FAR, apart, spot_distance, train_distance
from xosc_lateral.playback.positions.resolve import pose_of, spot_at
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.transition import EPSILON
from xosc_lateral.playback.values import holds
from xosc_lateral.scenario import Place
from xosc_lateral.scenario.conditions import (
    CollisionCondition,
    DistanceCondition,
    ReachPositionCondition,
    RelativeDistanceCondition,
    TimeHeadwayCondition,
)
from xosc_lateral.scenario.enums import CoordinateSystem, RelativeDistanceType, RoutingAlgorithm

_SHORTEST = (None, RoutingAlgorithm.UNDEFINED, RoutingAlgorithm.SHORTEST)


class Measured(Protocol):
    """A condition that measures a distance."""

    @property
    def coordinate_system(self) -> CoordinateSystem | None:
        """In which it is measured; None: not said."""

    @property
    def distance_type(self) -> RelativeDistanceType | None:
        """What of it; None: not said."""

    @property
    def routing_algorithm(self) -> RoutingAlgorithm | None:
        """Which way along the road; None: not said."""

    @property
    def freespace(self) -> bool:
        """Between boxes, not between reference points."""

    @property
    def place(self) -> Place:
        """Where it stands."""


def measure_of(content: Measured, simulation: Simulation) -> tuple[CoordinateSystem, RelativeDistanceType]:
    """Defaults of the standard: entity frame, euclidian. `alongRoute` of version 1.0 names the road, but not which
    component of the distance; a euclidian one is the same in every frame (so the reference player has it, too).

    What is measured otherwise than asked for is noted.
    """
    along_route = getattr(content, "along_route", None)
    system = content.coordinate_system or (CoordinateSystem.ROAD if along_route else CoordinateSystem.ENTITY)
    kind = content.distance_type or RelativeDistanceType.EUCLIDIAN
    if kind is RelativeDistanceType.EUCLIDIAN:
        return system, kind
    if content.routing_algorithm not in _SHORTEST and system in (CoordinateSystem.ROAD, CoordinateSystem.LANE):
        simulation.note(
            f"routingAlgorithm '{content.routing_algorithm}': measured along the shortest way instead", content.place
        )
    if content.freespace and system is CoordinateSystem.TRAJECTORY:
        simulation.note("free space along a trajectory: measured along the entity's own axes instead", content.place)
    return system, kind


def prepare_distance(content: DistanceCondition, simulation: Simulation) -> EntityCheck:
    """Its amount counts; where no road leads there, it is huge. [m]"""
    system, kind = measure_of(content, simulation)
    spot = spot_at(content.position, simulation)

    if kind is RelativeDistanceType.EUCLIDIAN and not content.freespace:

        def check_straight(state: EntityState) -> bool:
            target = spot()
            return holds(apart(state, target.x, target.y), content.rule, content.value)

        return check_straight

    def check(state: EntityState) -> bool:
        distance = spot_distance(simulation.network, state, spot(), system, kind, freespace=content.freespace)
        return holds(FAR if distance is None else abs(distance), content.rule, content.value)

    return check


def prepare_relative_distance(content: RelativeDistanceCondition, simulation: Simulation) -> EntityCheck:
    """Its amount counts; where no road leads there, it is huge. [m]"""
    other = simulation.entity(content.entity_ref, content.place)
    system, kind = measure_of(content, simulation)
    straight = kind is RelativeDistanceType.EUCLIDIAN and not content.freespace

    def check(state: EntityState) -> bool:
        if not other.active:
            return False
        if straight:
            place = other.plane
            return holds(apart(state, place.x, place.y), content.rule, content.value)
        distance = train_distance(simulation.network, state, other, system, kind, freespace=content.freespace)
        return holds(FAR if distance is None else abs(distance), content.rule, content.value)

    return check


ANGULAR_TOLERANCE = 0.05
"""How far heading, pitch and roll may be from an orientation that is given; the reference player's value. [rad]"""


def prepare_reach_position(content: ReachPositionCondition, simulation: Simulation) -> EntityCheck:
    """Straight distance in the plane [m]; an orientation that the position gives has to be met, too."""
    spot = spot_at(content.position, simulation)
    oriented = getattr(content.position, "orientation", None) is not None

    def check(state: EntityState) -> bool:
        target = spot()
        if not apart(state, target.x, target.y) < content.tolerance:
            return False
        if not oriented:
            return True
        wanted, pose = pose_of(content.position, simulation), state.pose
        return all(
            abs(difference(getattr(pose, angle), getattr(wanted, angle))) < ANGULAR_TOLERANCE
            for angle in ("heading", "pitch", "roll")
        )

    return check


def prepare_time_headway(content: TimeHeadwayCondition, simulation: Simulation) -> EntityCheck:
    """Not defined, hence false, when the other is behind or the entity does not move forward. [s]"""
    other = simulation.entity(content.entity_ref, content.place)
    system, kind = measure_of(content, simulation)

    def check(state: EntityState) -> bool:
        if not other.active or state.speed < EPSILON:
            return False
        distance = train_distance(simulation.network, state, other, system, kind, freespace=content.freespace)
        distance = FAR if distance is None else distance
        return distance >= 0.0 and holds(distance / state.speed, content.rule, content.value)

    return check


def prepare_collision(content: CollisionCondition, simulation: Simulation) -> EntityCheck:
    """With one entity, or with any other of a category. Who is named touches itself, as in the reference player."""
    others: tuple[EntityState, ...]
    is_named = content.entity_ref is not None
    if content.entity_ref is not None:
        others = (simulation.entity(content.entity_ref, content.place),)
    else:
        others = tuple(
            o for o in simulation.everybody() if content.by_type is None or o.entity.category is content.by_type
        )

    def check(state: EntityState) -> bool:
        return any((is_named or other is not state) and other.active and overlap(state, other) for other in others)

    return check


CHECKS: EntityChecks = {
    DistanceCondition: prepare_distance,
    RelativeDistanceCondition: prepare_relative_distance,
    ReachPositionCondition: prepare_reach_position,
    TimeHeadwayCondition: prepare_time_headway,
    CollisionCondition: prepare_collision,
}
