"""Whether vehicles with offsets move, frame by frame, as somebody does who drives as the source has him drive.

What may be wrong with a vehicle need not change any event: it slides while it stands, is turned, takes another road, or
does not move sideways at all.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.workflows.conversion.shifts import STORY_PREFIX, Change
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.private_actions import FollowTrajectoryAction

WINDOW = 1.0
"""In which somebody who drives is seen to move, or to slide. [s]"""
MOVED = 0.001
"""So far sideways at least. [m]"""
DRIVING_SPEED = 3.0
"""Above which somebody drives. [m/s]"""
LARGEST_SLIDE = 0.05
"""By which a way may be longer in a window than what the speed says, more than in the source. [m]"""
LARGEST_TURN = 0.1
"""Of a heading against the lane, more than in the source, where no lateral action runs. [rad]"""


def changed_movement(
    network: RoadNetwork, before: NominalMotion, after: NominalMotion, names: Collection[str]
) -> Iterator[Change]:
    """What some vehicles do otherwise in a run with offsets than in the one without, a line each."""
    sources = {entity.name: entity for entity in before.entities}
    for entity in after.entities:
        if entity.name in names:
            source = sources[entity.name]
            for what, row in _differences(network, source, entity, _led_across(after, entity)):
                yield Change(f"'{entity.name}' at {entity.time[row]:.1f} s", entity.name, float(entity.time[row]), what)


def moving_share(entity: EntityMotion) -> float | None:
    """Share of the time in which a vehicle drives, none of its lateral actions running, that it moves sideways; None:
    it never does. [-]
    """
    drives = _is_free(entity) & (np.abs(entity.speed) > DRIVING_SPEED)
    step = np.diff(entity.offset, prepend=entity.offset[:1])
    step[np.flatnonzero(np.diff(entity.lane) | np.diff(entity.road)) + 1] = 0.0
    step[entity.breaks] = 0.0
    moves = _over_window(entity, np.abs(step)) > MOVED
    return float(np.mean(moves[drives])) if drives.any() else None


def _led_across(run: NominalMotion, entity: EntityMotion) -> BoolArray:
    """Rows in which an action of the source leads it along a path: to another lane."""
    rows = np.zeros(len(entity.time), dtype=np.bool_)
    for played in run.actions:
        is_own = not played.path[0].startswith(STORY_PREFIX)
        if played.actor == entity.name and is_own and isinstance(played.action.content, FollowTrajectoryAction):
            rows |= (entity.time >= played.start) & (entity.time <= (np.inf if played.end is None else played.end))
    return rows


def _differences(
    network: RoadNetwork, source: EntityMotion, entity: EntityMotion, across: BoolArray
) -> Iterator[tuple[str, int]]:
    """What is otherwise, and the row in which it is so most; `across`: rows in which a path leads to another lane."""
    slides = [_over_window(one, np.maximum(_longer_way(one), 0.0)) for one in (source, entity)]
    row = int(np.argmax(slides[1]))
    if slides[1][row] > slides[0].max() + LARGEST_SLIDE:
        yield f"is put {slides[1][row]:.2f} m from where it drives", row
    # roads of a junction lie on each other: which one it is on there is anybody's guess
    crossing = np.array([road.junction is not None for road in network.roads])
    turns = [
        np.where(is_free & ~crossing[one.road], np.abs(np.sin(one.heading_relative)), 0.0)
        for one, is_free in ((source, _is_free(source)), (entity, _is_free(entity) & ~across))
    ]
    row = int(np.argmax(turns[1]))
    if turns[1][row] > turns[0].max() + LARGEST_TURN:
        yield f"is turned by {turns[1][row]:.2f} rad", row
    roads = [_roads(network, one) for one in (source, entity)]
    for k, ((road, row), (other, _)) in enumerate(zip(roads[1], roads[0], strict=False)):
        if road != other:
            yield f"drives onto road '{network.road_ids[road]}' as number {k + 1}", row
            break


def _longer_way(entity: EntityMotion) -> FloatArray:
    """By how much the way of each frame is longer than its speed says. [m]"""
    way = np.hypot(np.diff(entity.x, prepend=entity.x[:1]), np.diff(entity.y, prepend=entity.y[:1]))
    longer = way - np.maximum(np.abs(entity.speed), np.abs(np.roll(entity.speed, 1))) * (
        entity.time[1] - entity.time[0]
    )
    longer[entity.breaks] = 0.0
    return np.where((entity.activity & Activity.ACTIVE) != 0, longer, 0.0)


def _is_free(entity: EntityMotion) -> BoolArray:
    """Rows in which it is there, and no lateral action moves it."""
    return np.asarray((entity.activity & (Activity.ACTIVE | Activity.LATERAL)) == Activity.ACTIVE)


def _over_window(entity: EntityMotion, values: FloatArray) -> FloatArray:
    """Sum over the window around each row."""
    half = max(1, round(0.5 * WINDOW / (entity.time[1] - entity.time[0])))
    total = np.concatenate(([0.0], np.cumsum(values)))
    rows = np.arange(len(values))
    return np.asarray(total[np.minimum(rows + half, len(values))] - total[np.maximum(rows - half, 0)])


def _roads(network: RoadNetwork, entity: EntityMotion) -> list[tuple[int, int]]:
    """Roads that are none of a junction, in order, each with the row in which it is entered."""
    rows = np.flatnonzero(np.diff(entity.road, prepend=-2) != 0)
    entries: list[tuple[int, int]] = []
    for row in rows.tolist():
        road = int(entity.road[row])
        if road >= 0 and network.roads[road].junction is None and (not entries or entries[-1][0] != road):
            entries.append((road, row))
    return entries
