"""Conditions on distances: to a position, to an entity, headway and time to collision, and contact.

References
----------
.. [1] J. C. Hayward, "Near-miss determination through use of a scale of danger", Highway Research Record 384, 1972:
       time to collision.
"""

from __future__ import annotations

from math import copysign, hypot, inf

from xosc_lateral.world.player.distances import Measure, Spot, apart, free_road_gap, overlap, road_gap, spot_of
from xosc_lateral.world.player.positions.resolve import pose_of, spot_at
from xosc_lateral.world.player.simulation import Simulation, holds
from xosc_lateral.world.player.state import NO_ROAD, EntityState
from xosc_lateral.world.player.storyboard import EntityCheck, EntityChecks
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.lanes import DRIVING, lanes_between
from xosc_lateral.world.road.positions import difference
from xosc_lateral.world.scenario import conditions
from xosc_lateral.world.scenario.enums import CoordinateSystem, RelativeDistanceType, RoutingAlgorithm, Rule

_SHORTEST_ROUTE_ALGORITHMS = (None, RoutingAlgorithm.UNDEFINED, RoutingAlgorithm.SHORTEST)


def measure_of(content: conditions.Measured | conditions.RelativeDistanceCondition, simulation: Simulation) -> Measure:
    """Defaults of the standard: entity frame, euclidian. `alongRoute` of version 1.0 names the road, but not which
    component of the distance; a euclidian one is the same in every frame (so the reference player has it, too).

    What is measured otherwise than asked for is noted.
    """
    along_route = getattr(content, "along_route", None)
    system = content.coordinate_system or (CoordinateSystem.ROAD if along_route else CoordinateSystem.ENTITY)
    measure = Measure(
        system,
        content.distance_type or RelativeDistanceType.EUCLIDIAN,
        content.freespace,
        lambda what, state: simulation.note(what, content.place, entity=state.name),
    )
    if measure.is_along_roads and content.routing_algorithm not in _SHORTEST_ROUTE_ALGORITHMS:
        simulation.note(
            f"routingAlgorithm '{content.routing_algorithm}': measured along the shortest way instead", content.place
        )
    if (
        content.freespace
        and system is CoordinateSystem.TRAJECTORY
        and measure.kind is not RelativeDistanceType.EUCLIDIAN
    ):
        simulation.note("free space along a trajectory: measured along the entity's own axes instead", content.place)
    return measure


def _amount(measure: Measure, state: EntityState, target: Spot | EntityState, enough: float = inf) -> float:
    """Never negative; exact where it is `enough`. [m]"""
    if measure.kind is RelativeDistanceType.EUCLIDIAN and not measure.freespace:
        place = target.plane if isinstance(target, EntityState) else target
        return apart(state, place.x, place.y)
    return abs(measure.between(state, target, enough=enough, near=enough))


def prepare_distance(content: conditions.DistanceCondition, simulation: Simulation) -> EntityCheck:
    """Its amount counts. [m]"""
    measure = measure_of(content, simulation)
    spot = spot_at(content.position, simulation)
    return lambda state: holds(_amount(measure, state, spot()), content.rule, content.value)


def prepare_relative_distance(content: conditions.RelativeDistanceCondition, simulation: Simulation) -> EntityCheck:
    """Its amount counts. [m]"""
    other = simulation.entity(content.entity_ref, content.place)
    measure, value = measure_of(content, simulation), content.value
    return lambda state: other.active and holds(_amount(measure, state, other, value), content.rule, value)


ANGULAR_TOLERANCE = 0.05
"""How far heading, pitch and roll may be from an orientation that is given; the reference player's value. [rad]"""


def prepare_reach_position(content: conditions.ReachPositionCondition, simulation: Simulation) -> EntityCheck:
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


def prepare_time_headway(content: conditions.TimeHeadwayCondition, simulation: Simulation) -> EntityCheck:
    """Not defined, hence false, when the other is behind or the entity does not move forward. [s]"""
    other = simulation.entity(content.entity_ref, content.place)
    measure, soon = measure_of(content, simulation), _soon(content)

    def check(state: EntityState) -> bool:
        if not other.active or state.speed < EPSILON:
            return False
        distance = measure.between(state, other, enough=soon * state.speed)
        return distance >= 0.0 and holds(distance / state.speed, content.rule, content.value)

    return check


def prepare_time_to_collision(content: conditions.TimeToCollisionCondition, simulation: Simulation) -> EntityCheck:
    """Not defined, hence false, when they don't come closer. [s]"""
    measure, target, soon = measure_of(content, simulation), content.target, _soon(content)
    if isinstance(target, str):
        other = simulation.entity(target, content.place)
        simulation.derives_motion = True

        def check(state: EntityState) -> bool:
            closing, as_standing = _closing_speed(state, other), state.speed if simulation.time == 0.0 else 0.0
            fastest = max(abs(closing), abs(as_standing))
            if not other.active or fastest < EPSILON:
                return False
            distance = measure.between(state, other, enough=soon * fastest)
            collides = _collides(distance, closing, content)
            if simulation.time == 0.0 and collides is not _collides(distance, as_standing, content):
                what = "holds" if collides else "does not hold"
                what += f" at 0 s; in esmini, for which '{target}' stands in the first frame, it is the other way round"
                simulation.note(what, content.place, entity=state.name)
            return collides

        return check
    spot = spot_at(target, simulation)
    return lambda state: _collides(measure.between(state, spot()), state.speed, content)


def _soon(content: conditions.TimeHeadwayCondition | conditions.TimeToCollisionCondition) -> float:
    """What is later than this never fulfils a condition, ahead or behind; infinite: it may. [s]"""
    return content.value if content.rule in (Rule.LESS_THAN, Rule.LESS_OR_EQUAL, Rule.EQUAL_TO) else inf


def _collides(distance: float, closing: float, content: conditions.TimeToCollisionCondition) -> bool:
    if abs(distance) < EPSILON or abs(closing) < EPSILON or distance / closing < 0.0:
        return False
    return holds(distance / closing, content.rule, content.value)


def _closing_speed(state: EntityState, other: EntityState) -> float:
    """Own velocity along the other's velocity, minus the other's speed; own speed when the other stands. [m/s]"""
    vx, vy, _ = other.velocity
    if abs(vx) < EPSILON and abs(vy) < EPSILON:
        return state.speed
    along = (state.velocity[0] * vx + state.velocity[1] * vy) / hypot(vx, vy)
    return copysign(1.0, state.speed) * copysign(1.0, along) * (along - abs(other.speed))


def prepare_collision(content: conditions.CollisionCondition, simulation: Simulation) -> EntityCheck:
    """With one entity, or with any other of a category. Who is named touches itself, as in the reference player."""
    if content.entity_ref is not None:
        named = simulation.entity(content.entity_ref, content.place)
        return lambda state: named.active and overlap(state, named)
    others = [o for o in simulation.everybody() if content.by_type in (None, o.entity.category)]
    return lambda state: any(o is not state and o.active and overlap(state, o) for o in others)


# ---- RelativeClearanceCondition ----
_MANY_LANES = 1000
"""Wider than any road: an open end of a lane range."""


def prepare_relative_clearance(content: conditions.RelativeClearanceCondition, simulation: Simulation) -> EntityCheck:
    """Whether the lanes of the range exist and hold nobody; ids along the road, as in the reference player. [m]"""
    ranges = tuple(
        (
            -_MANY_LANES if lanes.from_lane is None else lanes.from_lane,
            _MANY_LANES if lanes.to_lane is None else lanes.to_lane,
        )
        for lanes in content.lane_ranges
    ) or ((-_MANY_LANES, _MANY_LANES),)
    names = content.entity_refs
    others = tuple(simulation.entity(name, content.place) for name in names) if names else simulation.everybody()
    reach = max(content.distance_forward, content.distance_backward)

    def in_range(lanes: int) -> bool:
        return any(low <= lanes <= high for low, high in ranges)

    def occupied(state: EntityState, other: EntityState) -> bool:
        if content.freespace:
            gap = free_road_gap(state, other, limit=reach + 100.0)
        else:
            gap = road_gap(state, spot_of(other), limit=reach + 100.0)
        return (
            gap is not None
            and -content.distance_backward <= gap.ds <= content.distance_forward
            and in_range(gap.lanes)
            and (content.opposite_lanes or not gap.opposite)
        )

    def check(state: EntityState) -> bool:
        state.locate()
        if state.road == NO_ROAD:
            return False
        if any(other is not state and other.active and occupied(state, other) for other in others):
            return False
        return any(
            info.type in DRIVING
            and in_range(lanes_between(state.lane, info.id))
            and (content.opposite_lanes or info.id * state.lane > 0)
            for info in simulation.network.lanes_at(state.road, state.s)
        )

    return check


CHECKS: EntityChecks = {
    conditions.DistanceCondition: prepare_distance,
    conditions.RelativeDistanceCondition: prepare_relative_distance,
    conditions.ReachPositionCondition: prepare_reach_position,
    conditions.TimeHeadwayCondition: prepare_time_headway,
    conditions.TimeToCollisionCondition: prepare_time_to_collision,
    conditions.CollisionCondition: prepare_collision,
    conditions.RelativeClearanceCondition: prepare_relative_clearance,
}
