"""LaneChangeAction and LaneOffsetAction."""

from __future__ import annotations

from math import atan, atan2, copysign, inf, pi, sqrt

from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.player.actions.base import Domain, Maker, RunningToTarget
from xosc_lateral.world.player.distances import is_turned
from xosc_lateral.world.player.drive import move_along_lane
from xosc_lateral.world.player.state import NO_ROAD, EntityState
from xosc_lateral.world.player.transition import EPSILON, Transition
from xosc_lateral.world.road.lanes import beside
from xosc_lateral.world.scenario.enums import DynamicsDimension, DynamicsShape
from xosc_lateral.world.scenario.private_actions import AbsoluteTargetLane, LaneChangeAction, LaneOffsetAction

STANDING_TURN = 0.25 * pi
"""Nobody who drives turns so far across his lane. [rad]"""


class RunningLaneChange(RunningToTarget):
    """From the present lateral position to the target lane, while moving on.

    The lateral position is measured from the centre of the target lane: its width and course are thereby followed. The
    way of one frame on the entity's track is `speed * step`; what goes sideways is missing ahead. The heading follows
    the movement of the frame and is 0 again at the end.
    """

    domains = Domain.LATERAL
    content: LaneChangeAction

    def _begin(self) -> None:
        state = self.actor
        state.locate()
        if state.road == NO_ROAD:
            self._refuse(f"'{state.name}' is on no road: the lane change is not played")
            return
        lane, network = self._target_lane(), state.network
        if not network.has_lane_at(state.road, lane, state.s):
            there = ", ".join(str(info.id) for info in network.lanes_at(state.road, state.s))
            what = f"road '{network.road_ids[state.road]}' has no lane {lane} at s = {state.s:.1f} m (lanes: {there})"
            self._refuse(f"{what}: lane change not played")
            return
        state.follow_lane()  # along the road at once, though another action may take over in this very frame
        state.turn(0.0 if state.is_forward else pi)
        self._types = state.kept_types(lane)
        kind = network.roads[state.road].section_at(state.s).by_id[lane].type
        if kind not in state.lane_types:
            stays = (
                "it stays there until it changes lanes again (in esmini it belongs to the nearest lane for vehicles)"
            )
            self.note(f"'{state.name}' changes to lane {lane} of type {kind}: {stays}")
        self._guide = EntityState(state.entity, network, route=state.route)
        """Follows the target lane beside the entity, at its own place across the road."""
        across = state.t - network.lane_state_at(state.road, lane, state.s).centre_t
        self._guide.put(state.place._replace(lane=lane, offset_t=across, pose=None))
        self._transition = Transition.of(self.content.dynamics)
        self._transition.begin(across, self.content.target_lane_offset)

    def _act(self, time: float, step: float) -> None:
        state, guide, transition = self.actor, self._guide, self._transition
        state.take_control(Activity.LATERAL)
        way = abs(state.speed) * step
        if abs(state.speed) < EPSILON:
            return
        side = copysign(1.0, transition.target - transition.start)
        was_forward = guide.is_forward
        ahead, offset, turn = self._move_of_frame(way, step)
        guide.offset_t = offset
        if transition.is_step:
            ahead = way
        move_along_lane(guide, copysign(ahead, state.speed))
        if guide.is_forward is not was_forward:  # onto a road whose s runs the other way: +t is the other side
            transition.start, transition.target = -transition.start, -transition.target
            side, offset, turn = -side, -offset, -turn
        self._place(guide, turn)
        if transition.is_step:
            self._jumped(transition.target - transition.start)
        state.speed_taken = True
        if transition.is_done or self._is_there(offset, side):
            state.turn(0.0 if guide.is_forward else pi)
            self.end()
        elif guide.at_road_end:
            self.end()

    def _target_lane(self) -> int:
        target = self.content.target
        if isinstance(target, AbsoluteTargetLane):
            return target.lane_id
        reference = self._reference
        assert reference is not None
        reference.locate()
        if reference.lane == 0 and target.value == 0:
            return 1  # no entity drives on lane 0: the lane to its left, as in the reference player
        lane = beside(reference.lane, target.value if reference.is_forward else -target.value)
        return -lane if is_turned(self.actor, reference.road, reference.s) else lane

    def _move_of_frame(self, way: float, step: float) -> tuple[float, float, float]:
        """Way ahead [m], new offset [m], and heading relative to the direction of driving, positive to +t [rad]."""
        transition = self._transition
        rate = transition.slope() / transition.scale
        if transition.dimension is DynamicsDimension.DISTANCE:
            if transition.is_step:
                return way, transition.value(), 0.0
            ahead = way / sqrt(1.0 + rate * rate)
            transition.advance(ahead)
            return ahead, transition.value(), atan(rate)
        sideways = step * abs(rate)
        ahead = sqrt(max(way * way - min(sideways, way) ** 2, 0.0))
        if sideways < way + EPSILON:
            transition.advance(step)
            return ahead, transition.value(), atan2(copysign(sideways, rate), ahead)
        if transition.is_step:
            transition.advance(inf)
            return ahead, transition.target, 0.0
        return self._aside(way, rate)

    def _aside(self, way: float, rate: float) -> tuple[float, float, float]:
        """Slower than the change asks for: all movement goes sideways, evenly."""
        transition = self._transition
        change = max(abs(transition.target - transition.start), EPSILON)
        transition.advance(way * transition.range / change)
        return 0.0, transition.value(DynamicsShape.LINEAR), copysign(0.5 * pi - EPSILON, rate)

    def _place(self, guide: EntityState, turn: float) -> None:
        """Put the actor where its guide is, on the lane that is under it."""
        network, state = self.simulation.network, self.actor
        t = guide.t
        under_it = network.lane_at(guide.road, guide.s, t, lane_types=self._types, prefer=state.lane)
        lane = under_it.lane or guide.lane
        under = network.lane_state_at(guide.road, lane, guide.s)
        state.move_to(guide.road, lane, guide.s, t - under.centre_t)
        # The course is relative to the target lane; lanes side by side are not parallel where one widens.
        aside = atan(network.lane_state_at(guide.road, guide.lane, guide.s).slope) - atan(under.slope)
        state.section = (0.0, -1.0)
        state.at_road_end = guide.at_road_end
        if guide.is_forward:
            state.turn(copysign(1.0, state.speed) * turn + aside)
        else:
            state.turn(pi - copysign(1.0, state.speed) * turn + aside)

    def _is_there(self, offset: float, side: float) -> bool:
        transition = self._transition
        rest = (transition.target - offset) * side
        return abs(rest) < EPSILON or (transition.parameter > 0.0 and rest < 0.0)


# ---- LaneOffsetAction ----
DEFAULT_LATERAL_ACCELERATION = 0.5
"""Where the file has none; the standard says as fast as can be, the reference player has this value. [m/s2]"""


class RunningLaneOffset(RunningToTarget):
    """Sideways within the lane, or beyond, while the default driver (or an action) moves ahead.

    The duration follows from the lateral acceleration; a relative target is read once. Each frame has the offset of its
    start, and a heading along the movement: in the first one nothing moves yet.
    """

    domains = Domain.LATERAL
    content: LaneOffsetAction

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
        state.speed_taken |= abs(state.speed) < EPSILON  # who stands does not drive for being moved sideways
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
            if abs(turn) > STANDING_TURN:
                what = "moves sideways while it hardly drives, and is turned across its lane (in esmini not alike)"
                self.note(f"'{state.name}' {what}")
            state.turn(along + (turn if state.is_forward else -turn))
        transition.advance(step)

    def _target(self) -> float:
        value, state, reference = self.content.target.value, self.actor, self._reference
        if reference is not None:
            reference.locate()
            t = reference.t + (value if reference.is_forward else -value)
            return (-t if is_turned(state, reference.road, reference.s) else t) - (state.t - state.offset_t)
        if self.simulation.scenario.header.is_left_handed:  # counts from the lane's direction, not the road's
            return value * state.network.travel_direction(state.road, state.lane)
        return value


RUNNING: dict[type, Maker] = {
    LaneChangeAction: RunningLaneChange,
    LaneOffsetAction: RunningLaneOffset,
}
