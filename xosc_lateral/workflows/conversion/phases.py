"""Phases of a vehicle that keeps its maneuvers, and the path that it drives in each.

From its start, from the end of each action that moves it sideways, and from behind each place that no path leads over.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.segment import way_of as way_of_clock
from xosc_lateral.base.segment import within_heading
from xosc_lateral.drivers.drives.drive import STEP
from xosc_lateral.files.openscenario.write.reactive import END_MARGIN, FIRST_WAIT, REACHED
from xosc_lateral.workflows.conversion.across import lane_changes_of, why_kept, why_untouched
from xosc_lateral.workflows.conversion.consequences import stays_as_written
from xosc_lateral.workflows.conversion.plan import Plan
from xosc_lateral.workflows.conversion.result import EntityResult, SampledSegment
from xosc_lateral.world.motion.driver_clock import DriverClock
from xosc_lateral.world.motion.look import DRIVING_SPEED
from xosc_lateral.world.motion.nominal import Activity, EntityMotion
from xosc_lateral.world.motion.offset_path import (
    LEAST_GAP,
    SHORTEST_GAP,
    Bridge,
    Offset,
    OffsetPath,
    PathPiece,
    Spacing,
    approached,
    bounded,
    calm,
    pieces_along,
    spacing_of,
)
from xosc_lateral.world.motion.segments import (
    Crossing,
    crossings,
    movement_runs,
)
from xosc_lateral.world.motion.trajectory import SETTLING_TIME, SampledDeviation, deviation_through, distance_driven
from xosc_lateral.world.motion.way import LANE_ENDS, Break, way_of
from xosc_lateral.world.scenario.controllers import Domains
from xosc_lateral.world.scenario.enums import DynamicsDimension
from xosc_lateral.world.scenario.private_actions import (
    LATERAL,
    AcquirePositionAction,
    AssignRouteAction,
    FollowTrajectoryAction,
    LaneChangeAction,
    LaneOffsetAction,
)

LEAST_MOVE = 1e-3
"""An action that moves by less is already there. [m]"""
LEAST_LENGTH = 20.0
"""A shorter path is none: it would hardly leave where it begins. [m]"""
BRIDGE_TIME, GRADE = 0.1, 1.6
"""From where it follows its road to its first place in the world is as far as is driven in two frames of 0.05 s [s];
pieces grow to there and shrink behind by this factor [-]: a player turns a vehicle within half a piece of each corner.
"""
BRIDGE_END = 5.0
"""It ends so far before the place where the next path begins. [m]"""
Path = tuple[str, ...]
"""Names of an action from the story down."""


def paths_of(entity: EntityResult, plan: Plan, *, lifelike: bool, leads: bool) -> tuple[list[OffsetPath], list[str]]:
    """Paths of one entity; none where a controller moves it along, which a path would double.

    `lifelike`: lane changes lead across as drivers take them, where they can. And which of them stay as written, a line
    each.
    """
    phases = _Phases(entity, plan, lifelike=lifelike, leads=leads)
    actions = plan.lateral.by_entity.get(entity.name, ())
    is_moved_along = Domains.LONGITUDINAL in plan.lateral.controlled.get(entity.name, Domains.NONE)
    paths = list[OffsetPath | None]()
    if not plan.lateral.from_the_start.get(entity.name, Domains.NONE):
        is_there = bool(entity.motion.activity[0] & Activity.ACTIVE)
        paths.append(phases.from_the_start(next((one.path for one in actions if one.adds and not is_there), None)))
    if not is_moved_along:
        paths += phases.behind_breaks(paths[0] if paths else None)
    for action in actions:
        if not action.adds and (action.steers is False or (action.steers is None and not is_moved_along)):
            paths.append(phases.after(action.path))
    if not is_moved_along:
        paths += phases.across.values()
        paths += phases.already_there()
    return [path for path in paths if path is not None], phases.stays


class _Phases:
    """Of one entity, with the offsets that it has in the nominal run there, or else with its longest ones."""

    def __init__(self, entity: EntityResult, plan: Plan, *, lifelike: bool, leads: bool) -> None:
        self._entity, self._plan, self._network = entity, plan, plan.played.network
        motion = entity.motion
        self._own = [one for one in plan.extended.motion.actions if one.actor == entity.name]
        self._actions = plan.lateral.by_entity.get(entity.name, ())
        self._lateral = {one.path for one in self._actions}
        self._driven = distance_driven(motion)
        runs = plan.prepared.equivalence(tuple(plan.egos))
        reach = runs.farthest(entity.name)
        has_route = any(isinstance(one.action.content, AssignRouteAction | AcquirePositionAction) for one in self._own)
        self._way = way_of(motion, self._network, reach, has_route=has_route)
        self._runs = [(one, run) for _, run in runs.runs for one in run.entities if one.name == entity.name]
        motions = [motion, *(one for one, _ in self._runs)]
        self._clock, self._clock_anywhere = (
            DriverClock.of_fastest(motions, reach, anywhere=each) for each in (False, True)
        )
        beyond = STEP * float(way_of_clock(self._clock.speed[-1:])[0])
        sampled: Offset = deviation_through(
            [
                _sampled(one, motion, self._driven, beyond if one is entity.segments[-1] else 0.0)
                for one in entity.segments
            ]
        )
        self._bounded = cache(lambda clock, is_cut: bounded(sampled, clock, is_cut=is_cut))
        self._offset: Offset = self._bounded(self._clock_anywhere, False)
        self._spacing = self._spacing_of(motion)
        self.across, self.stays, self._crossed = dict[Path, OffsetPath](), list[str](), dict[Path, float]()
        if lifelike:
            self._find_across(leads)

    def _find_across(self, leads: bool) -> None:
        """Paths in place of lane changes; lines on those that stay as written."""
        motion = self._entity.motion
        runs = movement_runs(self._plan.extended.motion, motion, self._network, self._entity.spans)
        for crossing in crossings(self._plan.extended.motion, motion, runs):
            fixed = why_untouched(self._plan.played.scenario, crossing.path, motion.name)
            if why := fixed or crossing.stays or self._kept_for(crossing):
                aside = "" if fixed else "; it ends where its driver is then"
                self.stays.append(stays_as_written(motion, crossing, why + aside))
            self._crossed[crossing.path] = float(self._driven[crossing.last])
            if not fixed:
                self.across[crossing.path] = self._to_aside(crossing) if why or not leads else self._across(crossing)
        written = lane_changes_of(self._plan.played.scenario, motion.name)
        for path in sorted(written.keys() - {one.path for one in self._own}):
            what = f"lane change '{path[-1]}' of '{motion.name}'"
            self.stays.append(f"{what} stays as written: the nominal run does not come to it")

    def _kept_for(self, crossing: Crossing) -> str:
        """Why the player has to take it as written; empty: a path can lead across."""
        motion, begin = self._entity.motion, float(self._driven[crossing.first])
        ahead = self._way.next_break(begin)
        if motion.speed[crossing.first : crossing.last + 1].min() < DRIVING_SPEED:
            return "it is slow meanwhile"
        if ahead is not None and ahead.distance < self._driven[crossing.last] + END_MARGIN:
            return f"no path leads over what is ahead ({ahead.why})"
        entities = self._plan.extended.motion.entities
        keeping = [one.name for one in entities if one.name not in self._plan.depends.entities and not np.ptp(one.lane)]
        return why_kept(self._plan.played.scenario, crossing.path, motion.name, keeping)

    def _to_aside(self, crossing: Crossing) -> OffsetPath:
        """As written, but for its end, where the driver drives beside the middle; nominally as long as without offsets.

        A rate is in proportion to the way: so it lasts as long, and longer where a vehicle under test leads it farther.
        """
        motion, last = self._entity.motion, self._crossed[crossing.path]
        aside, side = float(self._offset(np.array([last]))[0]), self._way.side_at(last)
        there = self._offset_t(crossing.last, side * aside)
        dynamics = lane_changes_of(self._plan.played.scenario, motion.name)[crossing.path][1].dynamics
        way, rate = float(crossing.way[-1]), 0.0
        if dynamics.dimension is DynamicsDimension.RATE and abs(way) > LEAST_MOVE:
            begin = float(self._offset(self._driven[[crossing.first]])[0])
            rate = float(dynamics.value) * abs(way + aside - begin) / abs(way)
        return OffsetPath(motion.name, crossing.path, (), side, end=aside, instead=True, settles=(there, rate))

    def _across(self, crossing: Crossing) -> OffsetPath:
        """By the distance driven; over when the written way is: the bell's last centimetres are left for later."""
        motion, (first, last) = self._entity.motion, self._driven[[crossing.first, crossing.last]].tolist()
        clock = self._clock_anywhere if crossing.path in self._plan.depends.begins else self._clock
        rows, at_first = slice(crossing.first, crossing.last + 1), np.array([first])
        aside = bounded(lambda at: np.interp(at, self._driven, self._entity.deviation), clock)
        before = float((aside(at_first) - self._offset(at_first))[0])  # the bell's, not driven yet

        def way(distance: FloatArray) -> FloatArray:
            across = np.interp(distance, self._driven[rows], crossing.way)
            return np.asarray(aside(distance) + across - before * (1.0 - across / crossing.way[-1]))

        pieces = tuple(pieces_along(way, clock, self._spacing.doubled(), (first, last), calm_end=True))
        end = float(way(np.array([last]))[0] - crossing.way[-1])
        return OffsetPath(motion.name, crossing.path, pieces, self._way.side_at(first), end=end, instead=True)

    def from_the_start(self, adding: Path | None) -> OffsetPath | None:
        """It is put down where its offsets begin, unless it is added later, or begins with a lateral action.

        Whoever tows a trailer starts where it is written: put down aside, the trailer would swing.
        """
        motion, name = self._entity.motion, self._entity.name
        first = [one for one in self._own if one.path == ("Init",) and isinstance(one.action.content, LATERAL)]
        time = max((np.inf if one.end is None else one.end for one in first), default=0.0)
        if time > motion.time[-1]:
            return None
        is_aside = adding is None and time == 0.0 and name not in self._plan.played.trailers.values()
        start = float(self._offset(np.zeros(1))[0]) if is_aside else 0.0
        path = self._path(adding, self._driven_at(time), start)
        if path is None or not is_aside:
            return path if path is None else structs.replace(path, time=time)
        return structs.replace(path, placed_t=self._offset_t(0, path.side * start), start=start)

    def _offset_t(self, row: int, aside: float) -> float:
        """Along +t from its lane's centre, so far along +t from where it is in a row of its nominal run. [m]"""
        motion = self._entity.motion
        direction = self._network.travel_direction(int(motion.road[row]), int(motion.lane[row]))
        return direction * float(motion.offset[row]) + aside

    def after(self, action: Path) -> OffsetPath | None:
        """From the end of an action in the nominal run, or else as on the longest segment."""
        ends = [played.end for played in self._own if played.path == action and played.end is not None]
        if action in self.across:
            return self._settled(action)
        if ends:
            return self._path(action, self._driven_at(min(ends)), 0.0)
        longest = max(self._entity.segments, key=lambda segment: segment.span.end - segment.span.start)
        return self._path(action, self._driven_at(longest.span.start), 0.0, is_nominal=False)

    def _settled(self, action: Path) -> OffsetPath | None:
        """From the end of a path across on, where its driver is by then: known if it began where it nominally does."""
        motion, depends, begin = self._entity.motion, self._plan.depends, self._crossed[action]
        leads = self.across[action].settles is None
        if not leads or (action not in depends.begins and motion.name not in depends.entities):
            return self._path(action, begin, self.across[action].end)
        length = SETTLING_TIME * float(way_of_clock(np.array([self._speed_at(begin)]))[0])
        aside = float(self._offset(np.array([begin + length]))[0])
        path = self._path(action, begin + length, aside)
        row = min(int(np.searchsorted(self._driven, begin)), len(motion.time) - 1)
        there = self._offset_t(row, self._way.side_at(begin) * aside)
        return path if path is None else structs.replace(path, settles=(there, length))

    def already_there(self) -> Iterator[OffsetPath]:
        """What ends actions of the source that are over at once in one of its runs, after the same ones as there."""
        histories, moves = dict[tuple[Path, Path | None], set[Path]](), set[tuple[Path, Path | None]]()
        for entity, run in self._runs:
            actions = sorted(
                (action for action in run.actions if action.path in self._lateral), key=lambda action: action.start
            )
            actions = [action for action in actions if action.actor == entity.name]
            for k, action in enumerate(actions):
                if not isinstance(action.action.content, LaneChangeAction | LaneOffsetAction):
                    continue
                rows = np.searchsorted(entity.time, (action.start - run.step, action.end or np.inf))
                places = [column[rows[0] : rows[1] + 1] for column in (entity.lane, entity.offset)]
                before = [earlier.path for earlier in actions[:k]]
                which = action.path, before[-1] if before else None
                if rows[1] - rows[0] < 4 and all(float(np.ptp(place)) < LEAST_MOVE for place in places):
                    histories[which] = {*before, action.path}
                else:
                    moves.add(which)  # what came before does not tell them apart
        at = np.arange(0.0, LEAST_LENGTH, SHORTEST_GAP)
        straight = (PathPiece(at, np.zeros(len(at))),)
        for path, after in histories.keys() - moves:
            begun = histories[path, after]
            unless = tuple(sorted(self._lateral - begun))
            yield OffsetPath(self._entity.name, after, straight, over=path, unless=unless)

    def behind_breaks(self, first: OffsetPath | None) -> Iterator[OffsetPath]:
        """From places on; each keeps the offset that the path before ended with, as long as no action is between."""
        known: float | None = 0.0 if first is None else first.end
        actions = [self._driven_at(played.start) for played in self._own if played.path in self._lateral]
        for way_break in self._way.breaks:
            if any(at < way_break.behind for at in actions):
                known = None
            path = self._path(None, way_break.behind - REACHED, known) if way_break.lanes else None
            if path is not None:
                known = None if known is None else path.end
                yield structs.replace(path, places=way_break.lanes)

    def _path(
        self, after: Path | None, begin: float, start: float | None, *, is_nominal: bool = True
    ) -> OffsetPath | None:
        """From a distance along the way on, and an offset there, if it is known; None: too short, or off the road."""
        way, depends = self._way, self._plan.depends
        if not len(way.distance):
            return None
        begin += FIRST_WAIT * self._speed_at(begin)
        is_known = is_nominal and (after is None or after not in depends.ends)
        ahead = way.next_break(begin) if is_known else None
        end = float(way.distance[-1]) if ahead is None else ahead.distance - END_MARGIN
        if end - begin < LEAST_LENGTH:
            return None
        lateral = [one for one in self._own if one.path in self._lateral]
        actions = {one.path: self._driven_at(one.start) for one in lateral}
        foreseen = (at for path, at in actions.items() if at > begin and path not in depends.begins)
        cut = min(foreseen, default=np.inf) if is_known else np.inf
        trajectories = (one.path for one in lateral if isinstance(one.action.content, FollowTrajectoryAction))
        cuts = [begin, *([cut] if begin + LEAST_LENGTH < cut < end - LEAST_LENGTH else ()), end]
        clock = self._clock if is_known else self._clock_anywhere
        may_begin = {one.path for one in self._actions if one.path != after or one.repeats}
        offset: Offset = self._bounded(clock, not may_begin.isdisjoint(depends.begins if is_known else may_begin))
        if start is not None:
            offset = approached(offset, clock, begin, start)
            if cut in cuts and any(actions[path] == cut for path in trajectories):  # which starts without an offset
                offset = approached(offset, clock, cut, 0.0, back=True)
        along = pieces_along(offset, clock, self._spacing, cuts, calm_end=ahead is not None)
        pieces: list[PathPiece | Bridge] = list(along)
        is_followed = ahead is not None and ahead.lanes and ahead.why != LANE_ENDS and start is not None
        if ahead is not None and is_followed and not any(begin < at < ahead.behind for at in actions.values()):
            end = ahead.behind - BRIDGE_END
            waits = FIRST_WAIT * (len(pieces) - 1)
            pieces.append(self._bridge(offset, ahead, end, BRIDGE_TIME + waits))
        crossed = begin if ahead is None else ahead.distance
        ends = tuple(one.place for one in way.breaks if not is_known or one.distance > crossed)
        span = (0.0, np.inf) if is_known else way.span_at(begin)
        side, last = way.side_at(begin), float(offset(np.array([end]))[0])
        return OffsetPath(self._entity.name, after, tuple(pieces), side, ends=ends, span=span, end=last)

    def _bridge(self, offset: Offset, over: Break, end: float, late: float) -> Bridge:
        """Over a place that no other path leads over: the lane of the nominal way is known, without actions before."""
        begin = over.distance - END_MARGIN
        speed, fastest = self._speed_at(begin), self._clock.speed_at(begin)
        gap = LEAST_GAP + late * fastest + FIRST_WAIT * (fastest - speed)
        graded = np.cumsum(gap / GRADE ** np.arange(1.0, 1.5 + np.log(gap / LEAST_GAP) / np.log(GRADE)))
        near = np.concatenate(([0.0], graded[-1] - graded[-2::-1], graded[-1:]))
        at = self._spacing.between(begin + near[-1] + gap + graded[-1], end)
        at = begin + np.concatenate((near, near[-1] + gap + np.append(0.0, graded[:-1]), at - begin))
        aside, n = calm(offset, self._clock, at), len(near)
        along = np.interp(at[:n], self._spacing.distance, self._spacing.along)
        beside = PathPiece(along - along[0], aside[:n] - aside[0])
        return Bridge(beside, *self._way.points(self._network, at[n:], aside[n:]))

    def _speed_at(self, distance: float) -> float:
        return float(np.interp(distance, self._driven, np.abs(self._entity.motion.speed)))

    def _driven_at(self, time: float) -> float:
        return float(np.interp(time, self._entity.motion.time, self._driven))

    def _spacing_of(self, motion: EntityMotion) -> Spacing:
        distance, rows = np.unique(self._way.distance, return_index=True)
        places = (column[rows] for column in (self._way.road, self._way.lane, self._way.s))
        return spacing_of(
            distance,
            np.interp(distance, self._driven, motion.speed),
            self._network.lane_curvature(*places),
            self._way.along(distance),
            self._clock,
        )


def _sampled(segment: SampledSegment, motion: EntityMotion, driven: FloatArray, beyond: float) -> SampledDeviation:
    """One segment by the distance driven; the last one with what was sampled beyond it, so far from one to the next."""
    distance, offset = segment.distance, segment.offset
    if distance is None:
        distance = np.interp(segment.time, motion.time, driven)
    settling = SETTLING_TIME * way_of_clock(motion.speed[[segment.span.first, segment.span.last]])
    if beyond and len(segment.beyond):
        distance = np.append(distance, distance[-1] + beyond * np.arange(1, len(segment.beyond) + 1))
        offset = np.append(offset, segment.beyond)
    return SampledDeviation(distance, within_heading(offset, distance), (float(settling[0]), float(settling[1])))
