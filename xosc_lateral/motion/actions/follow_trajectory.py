"""FollowTrajectoryAction: along a path, with the entity's own speed or by the path's clock."""

from __future__ import annotations

from math import copysign, cos, hypot, pi, sin

from xosc_lateral.motion.actions.base import Domain, RunningAction
from xosc_lateral.motion.angles import HALF_PI, difference, wrap
from xosc_lateral.motion.nominal import Activity
from xosc_lateral.motion.paths.base import Path, PathPoint, PathProgress
from xosc_lateral.motion.paths.registry import duration, path_of
from xosc_lateral.motion.state import free
from xosc_lateral.motion.transition import EPSILON
from xosc_lateral.scenario.actions import FollowTrajectoryAction
from xosc_lateral.scenario.enums import FollowingMode, ReferenceContext


class RunningFollowTrajectory(RunningAction):
    """The entity jumps onto the path when the action starts (there is no approach).

    At the end of the path, what is left of the frame goes straight on; then the lane under the entity is followed, with
    the offset that it has there.
    """

    content: FollowTrajectoryAction

    def prepare(self) -> None:
        """Without times the speed is left to others; the path may depend on where entities are when it starts."""
        self._is_timed = self.content.timing is not None and duration(self.content.trajectory.shape) > EPSILON
        self.domains = Domain.BOTH if self._is_timed else Domain.LATERAL
        self._path: Path | None = None
        self._s = 0.0
        self._time = 0.0
        self._backwards = False

    def start(self) -> None:
        """Lay the path out and jump onto it."""
        state, content = self.state, self.content
        follow = content.following_mode is FollowingMode.FOLLOW
        before = state.plane
        path = path_of(content.trajectory, self.run, follower=state, follow=follow, speed=state.speed)
        self._path = path
        if content.timing is not None and not self._is_timed:
            self.note(f"trajectory '{content.trajectory.name}' has no times: followed with the entity's own speed")
        self._s = min(max(content.initial_distance_offset, 0.0), path.length)
        point = path.at(self._s)
        self._time = path.time_at(self._s) if self._is_timed else 0.0
        along = copysign(1.0, state.speed) if not self._is_timed else 1.0
        heading = point.heading if path.has_headings else wrap(point.tangent + (0.0 if along > 0.0 else pi))
        self._backwards = abs(difference(heading, point.tangent)) > HALF_PI + EPSILON
        self._put(point, heading)
        state.path = PathProgress(path, self._s)
        if self._is_timed:
            state.set_speed((-1.0 if self._backwards else 1.0) * path.speed_at(self._s))
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
        self._put(path.at(self._s))
        state.path = PathProgress(path, self._s)
        if self._is_at_end(path, way, step):
            self._go_straight_on(self._left_over(path, abs(self._s - before), step))
            self.end()

    def finish(self) -> None:
        """Leave the path; where it ended is the place to go on from."""
        self.state.path = None

    # ---- in detail ---------------------------------------------------------------------------------------------------
    @property
    def _clock(self) -> float:
        timing = self.content.timing
        return self._time + (timing.offset if timing is not None else 0.0)

    def _advance(self, path: Path, time: float, step: float) -> float:
        """Move by one frame; returns the direction of movement on the path, +1 or -1."""
        state = self.state
        way = copysign(1.0, state.speed) * (-1.0 if self._backwards else 1.0)
        timing = self.content.timing
        if timing is None or not self._is_timed:
            s = self._s + way * abs(state.speed) * step
            if self.content.trajectory.closed and path.length > 0.0:
                s %= path.length
            self._s = min(max(s, 0.0), path.length)
            return way
        if timing.domain is ReferenceContext.RELATIVE:
            self._time += timing.scale * step
        else:
            self._time = (time + step) * timing.scale
        before, self._s = self._s, path.s_at(self._clock)
        if step > EPSILON and self._clock < path.end_time + EPSILON:
            state.set_speed((-1.0 if self._backwards else 1.0) * abs(self._s - before) / step)
        return 1.0

    def _is_at_end(self, path: Path, way: float, step: float) -> bool:
        if self._is_timed:
            return self._clock >= path.end_time - EPSILON
        if self.content.trajectory.closed or step <= 0.0 or self.state.speed == 0.0:
            return False
        return self._s > path.length - EPSILON if way > 0.0 else self._s < EPSILON

    def _left_over(self, path: Path, moved: float, step: float) -> float:
        """Way of the frame beyond the end of the path. [m]"""
        if self._is_timed:
            return max(self._clock - path.end_time, 0.0) * self.state.speed
        return copysign(max(abs(self.state.speed) * step - moved, 0.0), self.state.speed)

    def _go_straight_on(self, distance: float) -> None:
        state = self.state
        pose = state.free_pose
        assert pose is not None
        moved = pose._replace(x=pose.x + distance * cos(pose.heading), y=pose.y + distance * sin(pose.heading))
        state.put_in_world(moved)

    def _put(self, point: PathPoint, heading: float | None = None) -> None:
        if heading is None:
            turned = self._backwards and not (self._path is not None and self._path.has_headings)
            heading = wrap(point.heading + pi) if turned else point.heading
        on_ground = point.z != point.z
        pitch, roll = (point.pitch, point.roll) if not on_ground else (point.z, point.z)
        self.state.put_in_world(free(point.x, point.y, heading, point.z, pitch, roll))
