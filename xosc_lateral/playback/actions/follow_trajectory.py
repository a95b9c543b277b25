"""FollowTrajectoryAction: along a path, with the entity's own speed or by the path's clock."""

from __future__ import annotations

from math import copysign, cos, hypot, pi, sin

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.playback.actions.base import Domain, RunningAction
from xosc_lateral.playback.angles import HALF_PI, difference
from xosc_lateral.playback.paths.base import Path, PathPoint, PathProgress
from xosc_lateral.playback.paths.registry import duration, path_of
from xosc_lateral.playback.positions.resolve import pose_of
from xosc_lateral.playback.state import free
from xosc_lateral.playback.transition import EPSILON
from xosc_lateral.scenario.enums import FollowingMode, ReferenceContext
from xosc_lateral.scenario.private_actions import FollowTrajectoryAction


class RunningFollowTrajectory(RunningAction):
    """The entity jumps onto the path when the action starts (there is no approach).

    Headings that the file gives are kept; an entity that thereby points against the path drives backwards, as does one
    that comes with a negative speed. At the end of the path, what is left of the frame goes straight on; then the lane
    under the entity is followed, with the offset that it has there.
    """

    content: FollowTrajectoryAction

    def prepare(self) -> None:
        """Without times the speed is left to others; the path may depend on where entities are when it starts."""
        self._is_timed = self.content.timing is not None and duration(self.content.trajectory.shape) > EPSILON
        self.domains = Domain.BOTH if self._is_timed else Domain.LATERAL
        self._path: Path | None = None
        self._s = 0.0
        self._time = 0.0
        self._points = 1.0
        """+1: the entity points along the path, -1: against it."""
        self._was_headed = False
        self._is_first = True
        """No frame of any length has been driven yet: absolute times may begin further on."""

    def start(self) -> None:
        """Lay the path out and jump onto it."""
        state, content = self.state, self.content
        follow = content.following_mode is FollowingMode.FOLLOW
        before = state.plane
        path = path_of(content.trajectory, self.simulation, pose_of, follower=state, follow=follow, speed=state.speed)
        self._path = path
        if content.timing is not None and not self._is_timed:
            self.note(f"trajectory '{content.trajectory.name}' has no times: followed with the entity's own speed")
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
        self._points = 1.0 if point.is_headed and self._ignores_headings else _way(heading, point)
        self._put(point, heading)
        state.path = PathProgress(path, self._s)
        if self._is_timed:
            state.set_speed(sign * path.speed_at(self._s))
        state.take_control(Activity.TRAJECTORY)
        self.jumped(hypot(point.x - before.x, point.y - before.y))

    def step(self, time: float, step: float) -> None:
        """Move along."""
        state, path = self.state, self._path
        if path is None:
            self.end()
            return
        state.take_control(Activity.TRAJECTORY)
        state.speed_taken = True
        before = self._s
        way = self._advance(path, time, step)
        point = path.at(self._s)
        self._place(point)
        state.path = PathProgress(path, self._s)
        if self._is_at_end(path, way, step):
            self._go_straight_on(point.heading, self._left_over(path, abs(self._s - before), step))
            self.end()

    def finish(self) -> None:
        """Leave the path; where it ended is the place to go on from."""
        self.state.path = None

    # ---- in detail ---------------------------------------------------------------------------------------------------
    @property
    def _ignores_headings(self) -> bool:
        """A property of the reference player's vehicles: headings are for the eye, the direction is the path's."""
        return self.state.entity.properties.get("ignoreHeadingForTrajMotion") == "true"

    @property
    def _offset(self) -> float:
        timing = self.content.timing
        return 0.0 if timing is None else timing.offset

    def _advance(self, path: Path, time: float, step: float) -> float:
        """Move by one frame; returns the direction of movement on the path, +1 or -1."""
        state, timing = self.state, self.content.timing
        if timing is None or not self._is_timed:
            way = copysign(1.0, state.speed) * self._points
            s = self._s + way * abs(state.speed) * step
            if self.content.trajectory.closed and path.length > 0.0:
                s %= path.length
            self._s = min(max(s, 0.0), path.length)
            return way
        points = _way(state.plane.heading, path.at(self._s))
        if timing.domain is ReferenceContext.RELATIVE:
            self._time += timing.scale * step
            clock = self._time + timing.offset
        else:
            self._time = clock = (time + step) * timing.scale
        before, self._s = self._s, path.s_at(self._time + timing.offset)
        if self._is_first and timing.domain is ReferenceContext.ABSOLUTE:
            if clock > path.end_time + EPSILON and step > 0.0:
                self.note(
                    f"the times of trajectory '{self.content.trajectory.name}' are over when it starts: "
                    f"'{state.name}' is put where its speed would have taken it since"
                )
            self.jumped(max(abs(self._s - before) - 2.0 * abs(path.speed_at(before)) * step, 0.0))
        self._is_first = step <= 0.0
        # Beyond its end the path has no speed to give: the last one stays.
        if step > EPSILON and clock < path.end_time + EPSILON:
            state.set_speed(points * (self._s - before) / step)
        return 1.0

    def _is_at_end(self, path: Path, way: float, step: float) -> bool:
        if self._is_timed:
            return self._time + self._offset > path.end_time - EPSILON
        if self.content.trajectory.closed or step <= 0.0 or self.state.speed == 0.0:
            return False
        return self._s > path.length - EPSILON if way > 0.0 else self._s < EPSILON

    def _left_over(self, path: Path, moved: float, step: float) -> float:
        """Way of the frame beyond the end of the path. [m]"""
        if self._is_timed:
            return (self._time + self._offset - path.end_time) * self.state.speed
        return abs(self.state.speed) * step - moved if self._s > 0.0 else 0.0

    def _place(self, point: PathPoint) -> None:
        """On the path, with the heading given there, else along it as it came."""
        if self._was_headed and not point.is_headed:
            self._points = _way(point.heading, point)
        self._was_headed = point.is_headed
        turned = self._points < 0.0 and not point.is_headed
        self._put(point, point.heading + (pi if turned else 0.0))

    def _go_straight_on(self, heading: float, distance: float) -> None:
        state = self.state
        pose = state.free_pose
        assert pose is not None
        state.put_in_world(pose._replace(x=pose.x + distance * cos(heading), y=pose.y + distance * sin(heading)))

    def _put(self, point: PathPoint, heading: float) -> None:
        on_ground = point.z != point.z
        pitch, roll = (point.z, point.z) if on_ground else (point.pitch, point.roll)
        self.state.put_in_world(free(point.x, point.y, heading, point.z, pitch, roll))


def _way(heading: float, point: PathPoint) -> float:
    """+1 for a heading along the path, -1 for one against it."""
    return -1.0 if abs(difference(heading, point.tangent)) > HALF_PI + EPSILON else 1.0


RUNNING: dict[type, type[RunningAction]] = {FollowTrajectoryAction: RunningFollowTrajectory}
