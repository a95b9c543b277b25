"""FollowTrajectoryAction: along a path, with the entity's own speed or by the path's clock."""

from __future__ import annotations

from math import copysign, cos, hypot, pi, sin

from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.player.actions.base import Domain, Maker, RunningPrivateAction
from xosc_lateral.world.player.paths.base import PathPoint, PathProgress
from xosc_lateral.world.player.paths.registry import VERTEX_RADIUS, duration, path_of
from xosc_lateral.world.player.positions.resolve import poses_of
from xosc_lateral.world.player.state import free
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.positions import HALF_PI, difference
from xosc_lateral.world.scenario.enums import FollowingMode, ReferenceContext
from xosc_lateral.world.scenario.private_actions import FollowTrajectoryAction


class RunningFollowTrajectory(RunningPrivateAction):
    """The entity jumps onto the path when the action starts (there is no approach).

    Headings that the file gives are kept; an entity that thereby points against the path drives backwards, as does one
    that comes with a negative speed. At the end of the path, what is left of the frame goes straight on; then the lane
    under the entity is followed, with the offset that it has there.
    """

    content: FollowTrajectoryAction

    def _prepare(self) -> None:
        self._is_timed = self.content.timing is not None and duration(self.content.trajectory.shape) > EPSILON
        self.domains = Domain.BOTH if self._is_timed else Domain.LATERAL  # without times, others see to the speed

    def _begin(self) -> None:
        state, content = self.actor, self.content
        follow = content.following_mode is FollowingMode.FOLLOW
        before = state.plane
        timed, trajectory = self._is_timed, content.trajectory
        path = path_of(trajectory, self.simulation, poses_of, follower=state, follow=follow, is_timed=timed)
        self._path = path
        timing = content.timing
        if timing is not None and timing.offset and timing.domain is ReferenceContext.RELATIVE:
            what = "is counted as in esmini: by the standard, the times of the trajectory come later by it"
            self.note(f"the offset of relative timing, {timing.offset:g} s, {what}")
        if content.timing is not None and not self._is_timed:
            self.note(f"trajectory '{content.trajectory.name}' has no times: followed with the entity's own speed")
        start, end = path.at(0.0), path.at(path.length)
        self._goes_round = trajectory.closed and hypot(end.x - start.x, end.y - start.y) <= VERTEX_RADIUS
        self._s = min(max(content.initial_distance_offset, 0.0), path.length)
        point = path.at(self._s)
        self._time = path.time_at(self._s) if self._is_timed else 0.0
        sign = 1.0 if self._is_timed else copysign(1.0, state.speed)
        heading = point.heading
        if not point.is_headed:
            heading = point.tangent + (pi if sign < 0.0 else 0.0)
        elif self._is_timed:
            sign = _way(heading, point)
        self._was_headed = point.is_headed
        self._is_first = True
        """No frame of any length has been driven yet: absolute times may begin further on."""
        # A property of the reference player's vehicles: headings are for the eye, the direction is the path's.
        ignores_headings = state.entity.properties.get("ignoreHeadingForTrajMotion") == "true"
        self._points = 1.0 if point.is_headed and ignores_headings else _way(heading, point)
        """+1: the entity points along the path, -1: against it."""
        self._put(point, heading)
        state.path = PathProgress(path, self._s)
        if self._is_timed:
            state.set_speed(sign * path.speed_at(self._s))
        state.take_control(Activity.TRAJECTORY)
        self._jumped(hypot(point.x - before.x, point.y - before.y))

    def _act(self, time: float, step: float) -> None:
        state, path = self.actor, self._path
        state.take_control(Activity.TRAJECTORY)
        state.speed_taken = True
        before = self._s
        way = self._advance(time, step)
        point = path.at(self._s)
        self._place(point)
        state.path = PathProgress(path, self._s)
        if self._is_at_end(way, step):
            rest, pose = self._left_over(abs(self._s - before), step), state.plane
            x, y = pose.x + rest * cos(point.heading), pose.y + rest * sin(point.heading)
            state.put_in_world(pose._replace(x=x, y=y))
            self.end()

    def _finish(self) -> None:
        self.actor.path = None

    @property
    def _clock(self) -> float:
        """Time of the path's own clock. [s]"""
        return self._time + (0.0 if self.content.timing is None else self.content.timing.offset)

    def _advance(self, time: float, step: float) -> float:
        """Move by one frame; returns the direction of movement on the path, +1 or -1."""
        state, path, timing = self.actor, self._path, self.content.timing
        if timing is None or not self._is_timed:
            way = copysign(1.0, state.speed) * self._points
            s = self._s + way * abs(state.speed) * step
            if self._goes_round and path.length > 0.0:
                s %= path.length
            self._s = min(max(s, 0.0), path.length)
            return way
        points = _way(state.plane.heading, path.at(self._s))
        if timing.domain is ReferenceContext.RELATIVE:
            self._time += timing.scale * step
            clock = self._time + timing.offset
        else:
            self._time = clock = (time + step) * timing.scale
        before, self._s = self._s, path.s_at(self._clock)
        if self._is_first and timing.domain is ReferenceContext.ABSOLUTE:
            if clock > path.end_time + EPSILON and step > 0.0:
                self.note(
                    f"the times of trajectory '{self.content.trajectory.name}' are over when it starts: "
                    f"'{state.name}' is put where its speed would have taken it since"
                )
            self._jumped(max(abs(self._s - before) - 2.0 * abs(path.speed_at(before)) * step, 0.0))
        self._is_first = step <= 0.0
        # Beyond its end the path has no speed to give: the last one stays.
        if step > EPSILON and clock < path.end_time + EPSILON:
            state.set_speed(points * (self._s - before) / step)
        return 1.0

    def _is_at_end(self, way: float, step: float) -> bool:
        if self._is_timed:
            return self._clock > self._path.end_time - EPSILON
        if self._goes_round or step <= 0.0 or self.actor.speed == 0.0:
            return False
        return self._s > self._path.length - EPSILON if way > 0.0 else self._s < EPSILON

    def _left_over(self, moved: float, step: float) -> float:
        """Way of the frame beyond the end of the path. [m]"""
        if self._is_timed:
            return (self._clock - self._path.end_time) * self.actor.speed
        return abs(self.actor.speed) * step - moved if self._s > 0.0 else 0.0

    def _place(self, point: PathPoint) -> None:
        """On the path, with the heading given there, else along it as it came."""
        if self._was_headed and not point.is_headed:
            self._points = _way(point.heading, point)
        self._was_headed = point.is_headed
        turned = self._points < 0.0 and not point.is_headed
        self._put(point, point.heading + (pi if turned else 0.0))

    def _put(self, point: PathPoint, heading: float) -> None:
        on_ground = point.z != point.z
        pitch, roll = (point.z, point.z) if on_ground else (point.pitch, point.roll)
        self.actor.put_in_world(free(point.x, point.y, heading, point.z, pitch, roll))


def _way(heading: float, point: PathPoint) -> float:
    """+1 for a heading along the path, -1 for one against it."""
    return -1.0 if abs(difference(heading, point.tangent)) > HALF_PI + EPSILON else 1.0


RUNNING: dict[type, Maker] = {FollowTrajectoryAction: RunningFollowTrajectory}
