"""What the driver of a vehicle sees on the road-following segments of its motion.

A driver of right-hand traffic does to the left, in left-hand traffic, what he does to the right at home: the overtaking
lane, the hard shoulder and the seat have changed sides. So his context is mirrored, the profile sampled in it, and its
offsets are mirrored back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray, blocks
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.segment import Segment, is_slow, ticks_of, way_of
from xosc_lateral.drivers.model.profile import COLUMNS, SIDES, Basis, DriverProfile
from xosc_lateral.drivers.model.sampled_offsets import FUTURE_CONTEXT, PAST_CONTEXT
from xosc_lateral.drivers.model.sampling import Responses, responses_to
from xosc_lateral.workflows.conversion.result import Neighbours
from xosc_lateral.world.motion.nominal import Activity, EntityMotion
from xosc_lateral.world.motion.segments import SegmentSpan
from xosc_lateral.world.motion.trajectory import distance_driven
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.surroundings.context import Surroundings

SAMPLE_STEP = 0.2
"""Step of the driver model. [s]"""

NEIGHBOURS = frozenset(column for columns in COLUMNS.values() for column in columns)
"""Columns by which a profile responds to neighbours by itself."""

NO_WIDTH = 0.01
"""A lane narrower than this is none. [m]"""

OTHER_SIGN = ("curvature", "crossfall")
"""Positive to the one side, negative to the other."""

_SIDES = {"left": "right", "right": "left"}

Contexts = Mapping[str, tuple[FloatArray, FloatArray]]
"""Columns that a scenario doesn't state, or that replace what it states, as times [s] and values."""


class SeenSegment(NamedTuple):
    """A road-following segment as its driver sees it, or several and what lies between and beside them."""

    spans: tuple[SegmentSpan, ...]  # one after another; see `movement_runs`
    knots: IntArray  # rows of the motion that are sampled, shape (n,); where it is slow, those nearest to it
    distance: FloatArray  # driven there [m]
    segment: Segment  # in a mirror where the profile is one of the other hand's traffic: `side` is -1 then, else 1
    side: float
    responses: Responses  # see `responses_to`


class DriverContext(NamedTuple):
    """All that a driver sees on his way, and how he answers to neighbours."""

    segments: tuple[SeenSegment, ...] = ()
    neutral: tuple[str, ...] = ()  # context columns that his profile asks for and that are not known
    responds: frozenset[str] = frozenset()
    """Sides on which the profile responds to neighbours by itself, as its population does."""
    answer_known: frozenset[str] = frozenset()  # sides on which that is known of the driver: none is borrowed


NOTHING_SEEN = DriverContext()


def seen_by(
    driver: DriverProfile,
    entity: EntityMotion,
    surroundings: Surroundings,
    runs: Sequence[tuple[SegmentSpan, ...]],
    contexts: Contexts,
    neighbours: Neighbours,
) -> DriverContext:
    """What the driver of an entity sees on runs of spans; around are those whose place beside him is certain."""
    motion, network = surroundings.motion, surroundings.network
    index = next(k for k, one in enumerate(motion.entities) if one is entity)
    every = max(1, round(SAMPLE_STEP / motion.step))
    driven = distance_driven(entity)
    segments: list[SeenSegment] = []
    neutral, responds, answer_known = set[str](), set[str](), set[str]()
    for spans in runs:
        rows = np.arange(spans[0].first, spans[-1].last + 1, every)
        if len(rows) < 2:
            continue
        knots, distance = _knots(entity, driven, slice(spans[0].first, spans[-1].last + 1), every)
        for span in spans:
            if span.is_road_following:
                _refuse_no_width(entity, span, network)
        segment = _segment(surroundings, index, rows, every, contexts)
        if not np.array_equal(rows, knots):
            segment = segment.at(np.minimum((knots - rows[0]) // every, len(rows) - 1))
        if neighbours is Neighbours.NONE:
            beside = {name: values for name, values in segment.context.items() if name in NEIGHBOURS}
            emptied = {k: np.full_like(v, np.nan if k.endswith("distance") else 0.0) for k, v in beside.items()}
            segment = replace(segment, context={**segment.context, **emptied})
        neutral |= {column for column in driver.columns if column not in segment.context}
        is_left_hand = network.roads[int(entity.road[knots[0]])].rule == "LHT"
        other_hand = is_left_hand != driver.left_hand
        responds |= sides_known(driver, {Basis.POPULATION}, other_hand=other_hand)
        answer_known |= sides_known(driver, {Basis.MEASURED, Basis.DECLARED}, other_hand=other_hand)
        segment, side = (mirrored(segment), -1.0) if other_hand else (segment, 1.0)
        segments.append(SeenSegment(spans, knots, distance, segment, side, responses_to(segment, driver)))
    return DriverContext(tuple(segments), tuple(sorted(neutral)), frozenset(responds), frozenset(answer_known))


def _knots(entity: EntityMotion, driven: FloatArray, rows: slice, every: int) -> tuple[IntArray, FloatArray]:
    """Rows that are sampled, and the distance driven there [m]: a step apart on the driver's clock (`base.segment`).

    Below 40 km/h these are further apart in time, and those between rows are named by the nearest; the last then lies
    behind the end, where the car would go on as it does there.
    """
    time, speed = entity.time[rows], entity.speed[rows]
    if not is_slow(speed).any():
        knots = np.arange(rows.start, rows.stop, every)
        return knots, driven[knots]
    own_times, ticks, nearest = ticks_of(time, speed, every * float(time[1] - time[0]))
    moved = np.flatnonzero(np.diff(own_times, prepend=-1.0) > 0.0)
    distance = np.interp(ticks, own_times[moved], driven[rows][moved])
    distance[-1] += max(ticks[-1] - own_times[-1], 0.0) * float(way_of(speed[-1:])[0])
    return rows.start + nearest, distance


def sides_known(driver: DriverProfile, known: set[Basis], *, other_hand: bool) -> set[str]:
    """Sides of the road, "left" and "right", on which the driver's answer to neighbours is known in such a way."""
    return {other_side(side) if other_hand else side for side in SIDES if driver.basis_of(side) in known}


def _refuse_no_width(entity: EntityMotion, span: SegmentSpan, network: RoadNetwork) -> None:
    """A lane may begin or end with no width, but nobody follows one that has none all along."""
    for rows in blocks(span.last + 1, span.first):
        if network.lane_width(entity.road[rows], entity.lane[rows], entity.s[rows]).max() >= NO_WIDTH:
            return
    raise FormatError(
        f"lane {entity.lane[span.first]} has no width where {entity.name!r} follows it",
        path=network.path,
        element=f"road {network.road_ids[entity.road[span.first]]!r}",
    )


def _segment(surroundings: Surroundings, index: int, knots: IntArray, every: int, contexts: Contexts) -> Segment:
    """The segment on its knots, with context before and after as far as the entity's motion is one piece."""
    entity = surroundings.motion.entities[index]
    start = max(0, knots[0] - every * round(PAST_CONTEXT / SAMPLE_STEP))
    stop = min(len(entity.time), knots[-1] + every * round(FUTURE_CONTEXT / SAMPLE_STEP) + 1)
    earlier, later = (
        np.flatnonzero(((activity & Activity.TELEPORTED) != 0) | ((activity & Activity.ACTIVE) == 0))
        for activity in (entity.activity[start : knots[0] + 1], entity.activity[knots[-1] + 1 : stop])
    )
    before = (knots[0] - start - int(earlier.max(initial=0))) // every
    after = int(later.min(initial=stop - knots[-1] - 1)) // every
    grid = np.arange(knots[0] - before * every, knots[-1] + after * every + 1, every)
    context = surroundings.context(index, grid)
    on_motorway = np.array([road.is_motorway and road.junction is None for road in surroundings.network.roads], bool)
    context["motorway"] = ((entity.road[grid] >= 0) & on_motorway[entity.road[grid]]).astype(np.float64)
    for name, (time, values) in contexts.items():
        context[name] = np.interp(entity.time[grid], time, values)
    lane_width = _filled(context["lane_width"], slice(before, len(grid) - after))
    return Segment(entity.time[grid], lane_width, context["speed"], context, before, after)


def _filled(values: FloatArray, inside: slice) -> FloatArray:
    """Lane widths with the nearest one inside the segment where the margins hold none (off the road)."""
    filled = values.copy()
    filled[: inside.start][np.isnan(filled[: inside.start])] = values[inside.start]
    filled[inside.stop :][np.isnan(filled[inside.stop :])] = values[inside.stop - 1]
    return filled


def going_on(segment: Segment, rows: int) -> Segment:
    """So many rows that follow a segment where everything stays as at its end."""
    last = segment.inside.stop
    held = np.append(np.arange(last), np.full(rows, last - 1))
    time = np.append(segment.time[:last], segment.time[last - 1] + SAMPLE_STEP * np.arange(1, rows + 1))
    context = {name: values[held] for name, values in segment.context.items()}
    return Segment(time, segment.lane_width[held], segment.speed[held], context, before=last, after=0)


def mirrored(segment: Segment) -> Segment:
    """The segment with left and right exchanged; see `mirrored_context`."""
    return replace(segment, context=mirrored_context(segment.context))


def mirrored_context(context: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Context columns with left and right exchanged; one whose name has neither word stays."""
    columns = {other_side(name): values for name, values in context.items()}
    columns |= {name: -columns[name] for name in OTHER_SIGN if name in columns}
    if "wind_direction" in columns:
        columns["wind_direction"] = -columns["wind_direction"] % 360.0
    if "lane_index" in columns and "lane_count" in columns:
        columns["lane_index"] = columns["lane_count"] - 1.0 - columns["lane_index"]
    return columns


def other_side(name: str) -> str:
    """The name with the words `left` and `right` exchanged."""
    return "_".join(_SIDES.get(word, word) for word in name.split("_"))
