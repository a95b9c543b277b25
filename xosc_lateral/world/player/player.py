"""Play a scenario: frame by frame, triggers first, then actions, then the default driver.

A frame from time T: the triggers are evaluated with T and the state at T; actions that start do so at once; all running
actions step, in the file's order; time moves on; entities that no action has moved follow their lanes; trailers are
drawn along. The first frame has no length: it starts the init actions and gives the row of time 0, and time 0 is
evaluated once more in the frame after it.
"""

from __future__ import annotations

from array import array
from math import cos, hypot, sin

import numpy as np

from xosc_lateral.base.arrays import BLOCK, FloatArray, columns
from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.base.note import Note, remarked_before
from xosc_lateral.base.process import free_bytes
from xosc_lateral.world.motion.nominal import CUT_OFF, Activity, NominalMotion
from xosc_lateral.world.player.drive import align_trailers, connect, drive, halt_at_road_end, pull_trailers
from xosc_lateral.world.player.recorder import NO_LANE
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import NO_ROAD, EntityState
from xosc_lateral.world.player.storyboard_builder import build_storyboard, init_actions
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.enums import StoryboardElementState
from xosc_lateral.world.scenario.private_actions import FollowTrajectoryAction, TeleportAction
from xosc_lateral.world.scenario.scenario import Scenario

_LATERAL = int(Activity.LATERAL)  # plain: arithmetic of flags takes ten times as long

LEAST_PUT_AWAY = 2048
"""Frames after which rows are put away at the earliest: fewer in each piece would make too many of them."""

ROW_SIZE = 150
"""What becomes of a row: 89 bytes of motion, and 64 of the path that is made from it. [byte]"""

STANDING_SPEED = 1e-3
"""Below this speed an entity stands. [m/s]"""


TIME_LIMIT, RUN_TIME_LIMITS = 60.0, 3600.0
"""Where runs end unless told otherwise: of scenarios that never end, and of those with an end of their own. [s]"""


def play(
    scenario: Scenario, network: RoadNetwork, *, step: float = 0.02, time_limit: float | None = None
) -> NominalMotion:
    """Play a scenario to its stop trigger, or to the time limit.

    `network`: its roads; one without roads where the scenario has none; `step`: length of a frame. [s]; `time_limit`:
    where runs end that don't stop before; None: `TIME_LIMIT`, or `RUN_TIME_LIMITS` with a stop trigger. [s]
    What was not played, or not as written, is in the notes of the motion.

    Raises `PlaybackError`: if the scenario makes no sense on these roads (a lane or road that is not there);
    `UnsupportedElementError`: if it needs something that can't be played and that motion depends on.
    """
    if time_limit is None:
        time_limit = RUN_TIME_LIMITS if _has_end(scenario) else TIME_LIMIT
    if not step > 0.0 or not time_limit >= 0.0:
        raise ValueError(f"step {step!r} s must be above 0, time limit {time_limit!r} s not below")
    simulation = Simulation(scenario, network)
    with remarked_before(lambda: simulation.notes):
        return _Player(simulation, step).play(time_limit)


def _has_end(scenario: Scenario) -> bool:
    trigger = scenario.storyboard.stop_trigger
    return trigger is not None and any(group.conditions for group in trigger.groups)


class _Player:
    def __init__(self, simulation: Simulation, step: float) -> None:
        self.step_size, self.simulation, scenario = step, simulation, simulation.scenario
        if not scenario.entities:
            raise PlaybackError("has no entities: there is nothing to play", path=scenario.path)
        self._couple_trailers()
        self.init = init_actions(scenario.storyboard.init, simulation)
        self.root = build_storyboard(scenario.storyboard, simulation)
        self._leave_out_later_entities()
        self.rows = list(simulation.unwatched.awake.values())
        self.times = array("d")
        self._put_away_every = max(LEAST_PUT_AWAY, BLOCK // len(self.rows))
        self._times_put_away: list[FloatArray] = []

    def play(self, time_limit: float) -> NominalMotion:
        """Run to the end."""
        simulation, unwatched = self.simulation, self.simulation.unwatched
        going = self._begin()
        last = time_limit - 0.5 * self.step_size
        while going and simulation.time < last:
            unwatched.wake_due(derives_motion=simulation.derives_motion)
            for state in unwatched.awake:
                state.begin_frame()
            going = self._frame(self.step_size)
            if going:
                self._write(simulation.time)
                unwatched.rest(self.step_size)
        unwatched.wake_all()
        ended_by = "time limit" if going else "stop trigger"
        place, cut_off = simulation.scenario.storyboard.place, None
        goes_on = any(story.state is not StoryboardElementState.COMPLETE for story in self.root.children)
        if going and (_has_end(simulation.scenario) or goes_on):
            cut_off = place.note(f"{CUT_OFF} of {time_limit:g} s", is_warning=True)
        return self._result(ended_by, cut_off)

    def _begin(self) -> bool:
        """The moment in which everything starts; whether there is another."""
        for state in self.simulation.entities:
            state.begin_frame()
        for action in self.init:
            action.start()
        self.root.start()
        if self.simulation.derives_motion:
            for state in self.simulation.entities:
                _derive_motion(state, 0.0, height=self.simulation.derives_height)
        going = self._frame(0.0)
        self._write(0.0)
        return going

    # ---- one frame ---------------------------------------------------------------------------------------------------
    def _frame(self, step: float) -> bool:
        """Play one frame; False when the storyboard has stopped, and nothing moved."""
        simulation, root = self.simulation, self.root
        time = simulation.time
        simulation.stamp = time
        root.evaluate_triggers(time)
        if not root.is_running:
            return False
        simulation.stamp = time + step
        for action in self.init:
            action.step(time, step)
        self.init = [action for action in self.init if action.is_running]
        root.step(time, step)
        simulation.time = time + step
        for state in simulation.unwatched.awake:
            if not state.active:
                continue
            if not state.longitudinal_taken and state.tow is None and abs(state.speed) > EPSILON:
                drive(state, state.speed * step)
            halt_at_road_end(state, step)
        pull_trailers(simulation.unwatched.awake)
        if simulation.derives_motion:
            for state in simulation.unwatched.awake:
                if state.active:  # who is taken out keeps the speed that others may refer to
                    _derive_motion(state, step, height=simulation.derives_height)
        else:
            self._speeds_of_moved(step)
        if simulation.derives_states:
            self._derive_states()
        return True

    def _speeds_of_moved(self, step: float) -> None:
        """An entity that was moved without anybody setting its speed has the speed of that movement."""
        for state in self.simulation.unwatched.awake:
            if not state.speed_taken and state.activity & _LATERAL:
                _derive_motion(state, step)
            else:
                state.previous = None

    def _derive_states(self) -> None:
        simulation = self.simulation
        for state in simulation.unwatched.awake:
            standing = -STANDING_SPEED < state.speed < STANDING_SPEED
            state.standing_since = _since(state.standing_since, standing, simulation.time)
            state.road_end_since = _since(state.road_end_since, state.at_road_end, simulation.time)
            if simulation.derives_off_road:
                state.off_road_since = _since(state.off_road_since, _is_off_road(state), simulation.time)

    # ---- before and after --------------------------------------------------------------------------------------------
    def _couple_trailers(self) -> None:
        for state in self.simulation.entities:
            if state.entity.trailer is not None:
                connect(state, self.simulation.entity(state.entity.trailer, state.entity.place))
        for state in self.simulation.entities:
            if state.tow is None:
                align_trailers(state)

    def _leave_out_later_entities(self) -> None:
        """Entities without init actions are not there until an action adds them (trailers are, with their tractor)."""
        privates = self.simulation.scenario.storyboard.init.privates
        present = {private.entity_ref for private in privates}
        placing = TeleportAction | FollowTrajectoryAction
        placed = {one.entity_ref for one in privates if any(isinstance(a.content, placing) for a in one.actions)}
        for state in self.simulation.entities:
            if state.tow is not None or state.name in placed:
                continue
            if state.name not in present:
                state.active = False
                what = "no init actions: it is not there until it is added"
            else:
                state.put_in_world(state.pose)
                what = "no initial position: it stands at the world's origin"
            self.simulation.note(f"'{state.name}' has {what}", state.entity.place, is_doubt=state.active)

    def _write(self, time: float) -> None:
        self.times.append(time)
        unwatched = self.simulation.unwatched
        for rows in unwatched.awake.values():
            rows.write(time)
        unwatched.frames += 1
        if unwatched.frames % self._put_away_every == 0:
            self._put_away()

    def _put_away(self) -> None:
        """Make place for rows to come."""
        for rows in self.rows:
            rows.put_away()
        if self.times:
            self._times_put_away.append(np.array(self.times))
            del self.times[:]
            self._require_memory()

    def _require_memory(self) -> None:
        rows = len(self.rows) * self.simulation.unwatched.frames
        needed, free = ROW_SIZE * rows, free_bytes()
        if needed > free:
            what = f"{rows} rows until {self.simulation.time:.0f} s need {needed / 1e6:.0f} MB of memory"
            advice = "play a shorter time, or in longer steps"
            raise PlaybackError(
                f"{what}, and {max(free, 0.0) / 1e6:.0f} MB are free: {advice}", path=self.simulation.scenario.path
            )

    def _result(self, ended_by: str, cut_off: Note | None) -> NominalMotion:
        simulation = self.simulation
        self._put_away()
        time = columns(sum(map(len, self._times_put_away)), ([part] for part in self._times_put_away))[0]
        return NominalMotion(
            step=self.step_size,
            entities=tuple(rows.motion(simulation.network, time) for rows in self.rows),
            actions=tuple(simulation.played),
            end_time=float(time[-1]),
            ended_by=ended_by,
            notes=tuple(simulation.notes),
            routes=tuple(simulation.routes),
            cut_off=cut_off,
        )


def _derive_motion(state: EntityState, step: float, *, height: bool = False) -> None:
    """Velocity, acceleration and way travelled from the movement of the frame; speed, if nobody has set it."""
    pose, before = state.pose if height else state.plane, state.previous
    state.previous = pose
    if step <= EPSILON or before is None or state.teleported:
        velocity = (state.speed * cos(pose.heading), state.speed * sin(pose.heading), 0.0)
        if step > EPSILON and before is not None:
            state.acceleration = _rate(velocity, state.velocity, step)
        state.velocity = velocity
        return
    rise = pose.z - before.z
    move = (pose.x - before.x, pose.y - before.y, rise if rise == rise else 0.0)
    velocity = (move[0] / step, move[1] / step, move[2] / step)
    state.acceleration = _rate(velocity, state.velocity, step)
    state.velocity = velocity
    state.odometer += hypot(move[0], move[1])
    if not state.speed_taken:
        state.speed = hypot(velocity[0], velocity[1])


def _rate(
    now: tuple[float, float, float], before: tuple[float, float, float], step: float
) -> tuple[float, float, float]:
    return (now[0] - before[0]) / step, (now[1] - before[1]) / step, (now[2] - before[2]) / step


def _since(since: float | None, holds: bool, now: float) -> float | None:
    return None if not holds else now if since is None else since


def _is_off_road(state: EntityState) -> bool:
    """Beside all lanes of its road; lanes of type `none` are no part of it."""
    state.locate()
    if state.road == NO_ROAD:
        return False
    lanes = state.network.lanes_at(state.road, state.s)
    t = state.t
    return not any(abs(t - lane.centre_t) <= 0.5 * lane.width for lane in lanes if lane.type != NO_LANE)
