"""Sample offsets for every road-following segment of a played scenario and shift the paths by them."""

from __future__ import annotations

import zlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.answers import basis_of
from xosc_lateral.driver.drivability import drivable
from xosc_lateral.driver.plausibility import check_offsets
from xosc_lateral.driver.profile import COLUMNS, SIDES, Basis, DriverProfile
from xosc_lateral.driver.sampled_offsets import known_sensor, sensor_error
from xosc_lateral.driver.sampling import OffsetSampler, Responses, responses_to
from xosc_lateral.enrich.consequences import HalfWidths, gaps_of, lane_departures
from xosc_lateral.enrich.give_way import SampledVehicle, give_way, mirrored, other_side
from xosc_lateral.enrich.result import Enriched, EntityResult, Neighbours, SampledSegment
from xosc_lateral.errors import FormatError
from xosc_lateral.motion.context import entity_context
from xosc_lateral.motion.deviation import SETTLING_TIME, SampledDeviation, deviation_through
from xosc_lateral.motion.gaps import Gap
from xosc_lateral.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.motion.segments import SegmentSpan, cut_segments
from xosc_lateral.motion.trajectory import WorldTrajectory, displace, distance_driven
from xosc_lateral.road.network import RoadNetwork
from xosc_lateral.rows import blocks, columns, give_back, kept
from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SAMPLE_STEP = 0.2
"""Step of the driver model. [s]"""

PAST, FUTURE = 30.0, 10.0
"""Context before and after a segment that its effects may look at [s]: several response times, and any look-ahead."""

NEIGHBOURS = frozenset(column for columns in COLUMNS.values() for column in columns)
"""Columns by which a profile responds to neighbours by itself."""

Drivers = Mapping[str, DriverProfile | str]
"""Per entity the profile that drives it, or the reason why it gets none."""


def enrich(
    motion: NominalMotion,
    network: RoadNetwork,
    drivers: Drivers,
    *,
    seed: int,
    variant: int = 0,
    entropy: Mapping[str, Sequence[int]] | None = None,
    context: Mapping[str, tuple[FloatArray, FloatArray]] | None = None,
    trailers: Mapping[str, str] | None = None,
    attempts: int = 1,
    neighbours: Neighbours = Neighbours.BORROW,
    with_sensor: bool = False,
    uncertain: Collection[str] = (),
    at_least: float = 0.0,
) -> Enriched:
    """Enrich a played scenario.

    Parameters
    ----------
    motion : NominalMotion
    network : RoadNetwork
        The one that it was played on.
    drivers : mapping of entity name to DriverProfile or str
        A profile, or the reason why the entity is not enriched; an entity that is absent is not enriched.
    seed, variant : int
        Together with `entropy` and the entity's name they seed each entity's own random numbers, so that adding an
        entity changes no other's offsets.
    entropy : mapping of entity name to sequence of int, optional
        Further seed words of each entity.
    context : mapping of str to (time, values), optional
        Context that the scenario doesn't state, or that replaces what it states; the same for all entities. [s]
    trailers : mapping of str to str, optional
        Entity that is pulled -> entity that pulls it: it follows in the tractor's track.
    attempts : int
        Sample anew up to so many times while vehicles touch or leave their lane that nominally don't; the best is kept.
    neighbours : Neighbours
        `profile`: every vehicle answers to those beside it as its profile alone has it. `borrow`: neighbours give way
        to each other by a population's law, too, where a profile's answer is not known (`give_way`). `none`: nobody
        answers to anybody beside him.
    with_sensor : bool
        Add what the sensor added to the drives that each profile was fitted on. Nobody drives that: it is added after
        drivers have given way and after what nobody could drive was smoothed.
    uncertain : collection of str
        Entities whose motion will be another one, since it depends on a vehicle under test: nobody responds to where
        they nominally are, nor do they to others.
    at_least : float
        Time for which each segment is sampled, should it last longer in another run. [s]

    Raises
    ------
    DriverProfileError
        When the sensor is asked for and a profile knows of none.
    """
    trailers, words = trailers or {}, entropy or {}
    rows = sum(len(entity.time) for entity in motion.entities)
    few = rows <= FEW and not context
    run = (_run if few else _run.__wrapped__)(motion, network, frozenset(trailers), frozenset(uncertain), neighbours)

    def drawn_for(index: int, attempt: int) -> _Drawn:
        entity = motion.entities[index]
        driver, spans = drivers.get(entity.name, "not chosen"), run.spans[index]
        if isinstance(driver, str):
            return _Drawn(entity, spans, None, driver)
        whose, met = run.met.get(index, (None, None))
        if met is None or whose is not driver:
            among = replace(motion, entities=(entity,)) if entity.name in uncertain else run.certain
            met = _meet(entity, among, network, spans, driver, context or {}, neighbours)
            if few:
                run.met[index] = driver, met
        own = np.random.SeedSequence(
            [seed, variant, attempt, zlib.crc32(entity.name.encode()), *words.get(entity.name, ())]
        )
        return _draw(entity, spans, driver, met, own, with_sensor, round(at_least / SAMPLE_STEP))

    best: Enriched | None = None
    for attempt in range(max(1, attempts)):
        drawn = [drawn_for(index, attempt) for index in range(len(motion.entities))]
        if neighbours is Neighbours.BORROW:
            drawn = _apart(drawn, motion, network, uncertain)
        entities = tuple(_result(one, network) for one in drawn)
        entities = _with_trailers(entities, network, trailers)
        gaps_after = gaps_of(motion, [entity.trajectory for entity in entities])
        departures = tuple(
            found for entity in entities for found in lane_departures(entity, network, run.half_widths if few else None)
        )
        result = Enriched(motion, network, entities, run.gaps, gaps_after, departures, seed, variant, attempt)
        if best is None or _trouble(result) < _trouble(best):
            best = result
        if not _trouble(result):
            break
    assert best is not None
    return best


def with_offsets(enriched: Enriched, names: Collection[str], factor: float, why: str) -> Enriched:
    """With the offsets of some entities times a factor, and none where it is 0: `why` says the reason."""
    entities = tuple(
        _scaled(entity, enriched.network, factor, why) if entity.name in names else entity
        for entity in enriched.entities
    )
    gaps_after = gaps_of(enriched.motion, [entity.trajectory for entity in entities])
    departures = tuple(found for entity in entities for found in lane_departures(entity, enriched.network))
    return replace(enriched, entities=entities, gaps_after=gaps_after, departures=departures)


def _scaled(entity: EntityResult, network: RoadNetwork, factor: float, why: str) -> EntityResult:
    if factor == 0.0:
        return _untouched(entity.motion, entity.spans, why)
    segments = tuple(
        replace(segment, offset=factor * segment.offset, beyond=factor * segment.beyond) for segment in entity.segments
    )
    n = len(entity.deviation)
    deviation = columns(n, ([factor * entity.deviation[rows]] for rows in blocks(n)))[0]
    trajectory = displace(entity.motion, network, deviation)
    return replace(entity, segments=segments, deviation=deviation, trajectory=trajectory)


def _trouble(enriched: Enriched) -> int:
    return len(enriched.new_contacts) + len(enriched.departures)


@dataclass(frozen=True, eq=False)
class _Drawn:
    """One entity, its segments sampled.

    Parameters
    ----------
    spans : tuple of SegmentSpan
        All; `segments` are those that were sampled: span, rows of its samples, offsets there [m].
    why : str
        It was not sampled.
    errors : tuple of array
        What a sensor adds to each segment's offsets; zeros unless asked for. [m]
    beyond : tuple of array
        How each would go on after its end. [m]
    responds : frozenset of str
        Sides on which the profile responds to neighbours by itself, as its population does.
    alone : frozenset of str
        Sides on which that is known of the driver himself: nothing is borrowed.
    """

    motion: EntityMotion
    spans: tuple[SegmentSpan, ...]
    profile: DriverProfile | None
    why: str
    segments: tuple[tuple[SegmentSpan, IntArray, FloatArray], ...] = ()
    neutral: tuple[str, ...] = ()
    errors: tuple[FloatArray, ...] = ()
    responds: frozenset[str] = frozenset()
    alone: frozenset[str] = frozenset()
    beyond: tuple[FloatArray, ...] = ()

    def deviation(self, rows: IntArray | None = None) -> FloatArray:
        """On some rows or all, positive left. [m]"""
        distance, speed = distance_driven(self.motion), self.motion.speed
        through = deviation_through(
            [
                SampledDeviation(
                    distance[knots], offset, (SETTLING_TIME * speed[knots[0]], SETTLING_TIME * speed[knots[-1]])
                )
                for _, knots, offset in self.segments
            ]
        )
        if rows is not None:
            return through(distance[rows])
        return columns(len(distance), ([through(distance[part])] for part in blocks(len(distance))))[0]


class _Stretch(NamedTuple):
    """A road-following segment as its driver meets it.

    Parameters
    ----------
    span : SegmentSpan
    knots : array of int, shape (n,)
        Rows of the motion that are sampled.
    seen : Segment
        In a mirror where the profile is one of the other hand's traffic: `side` -1 then, else 1.
    responses : sequence of array or None
        See `responses_to`.
    """

    span: SegmentSpan
    knots: IntArray
    seen: Segment
    side: float
    responses: Responses


class _Met(NamedTuple):
    """What an entity's driver meets on its way, and what is known of how he answers; see `_Drawn`."""

    stretches: tuple[_Stretch, ...]
    neutral: tuple[str, ...]
    responds: frozenset[str]
    alone: frozenset[str]


FEW = 100_000
"""Rows of all entities of a run up to which what drivers meet is kept for its next variant: a run like that of 16 cars
for two minutes then keeps about 10 MB. [-]"""


class _Run(NamedTuple):
    """What all variants of a run have in common.

    Parameters
    ----------
    spans : tuple of tuple of SegmentSpan
        Of each entity.
    gaps : tuple of Gap
        Of the nominal motion.
    certain : NominalMotion
        Those alone whose place is.
    met : dict
        By the number of the entity, its last driver and what he meets.
    half_widths : dict
        See `lane_departures`.
    """

    spans: tuple[tuple[SegmentSpan, ...], ...]
    gaps: tuple[Gap, ...]
    certain: NominalMotion
    met: dict[int, tuple[DriverProfile, _Met]]
    half_widths: HalfWidths


@lru_cache(maxsize=2)  # variants of one run come one after another
def _run(
    motion: NominalMotion,
    network: RoadNetwork,
    pulled: frozenset[str],
    uncertain: frozenset[str],
    neighbours: Neighbours,
) -> _Run:
    spans = tuple(cut_segments(entity, network, is_trailer=entity.name in pulled) for entity in motion.entities)
    gaps = gaps_of(motion, [_nominal(entity) for entity in motion.entities])
    certain = tuple(one for one in motion.entities if one.name not in uncertain)
    return _Run(spans, gaps, replace(motion, entities=certain), {}, {})


def _meet(
    entity: EntityMotion,
    motion: NominalMotion,
    network: RoadNetwork,
    spans: tuple[SegmentSpan, ...],
    driver: DriverProfile,
    foreign_context: Mapping[str, tuple[FloatArray, FloatArray]],
    neighbours: Neighbours,
) -> _Met:
    """What a driver meets; `motion` is the run with those alone whose place beside him is certain."""
    index = next(k for k, one in enumerate(motion.entities) if one is entity)
    every = max(1, round(SAMPLE_STEP / motion.step))
    stretches: list[_Stretch] = []
    neutral, responds, alone = set[str](), set[str](), set[str]()
    for span in spans:
        knots = kept(np.arange(span.first, span.last + 1, every))
        if not span.is_road_following or len(knots) < 2:
            continue
        _refuse_no_width(entity, span, network)
        segment = _segment(motion, network, index, knots, every, foreign_context)
        if neighbours is Neighbours.NONE:
            segment = _with_nobody_beside(segment)
        neutral |= _unknown(driver, segment)
        other_hand = _is_left_hand(entity, network, knots) != driver.left_hand
        responds |= sides_known(driver, {Basis.POPULATION}, other_hand=other_hand)
        alone |= sides_known(driver, {Basis.MEASURED, Basis.DECLARED}, other_hand=other_hand)
        seen, side = (mirrored(segment), -1.0) if other_hand else (segment, 1.0)
        stretches.append(_Stretch(span, knots, seen, side, responses_to(seen, driver)))
    return _Met(tuple(stretches), tuple(sorted(neutral)), frozenset(responds), frozenset(alone))


NO_WIDTH = 0.01
"""A lane narrower than this is none. [m]"""


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


def _draw(
    entity: EntityMotion,
    spans: tuple[SegmentSpan, ...],
    driver: DriverProfile,
    met: _Met,
    seed: np.random.SeedSequence,
    with_sensor: bool,
    least: int,
) -> _Drawn:
    """Offsets of one entity."""
    if not met.stretches:
        return _Drawn(entity, spans, None, "no road-following segment")
    sampler, sensor = OffsetSampler(driver, seed), known_sensor(driver) if with_sensor else None
    segments: list[tuple[SegmentSpan, IntArray, FloatArray]] = []
    errors: list[FloatArray] = []
    beyond: list[FloatArray] = []
    for span, knots, seen, side, responses in met.stretches:
        wanted = side * sampler.sample(seen, responses=responses)
        more = least - len(knots)
        give_back(len(seen.time))
        beyond.append(side * sampler.copy().sample(_going_on(seen, more)) if more > 0 else np.empty(0))
        inside = seen.inside
        who = f"profile {driver.name} for {entity.name!r}"
        check_offsets(wanted, seen.lane_width[inside], who, seen.time[inside])
        errors.append(kept(sensor_error(sensor, wanted, SAMPLE_STEP, seed, part=len(segments))))
        segments.append((span, knots, kept(wanted)))
    return _Drawn(
        entity, spans, driver, "", tuple(segments), met.neutral, tuple(errors), met.responds, met.alone, tuple(beyond)
    )


def sides_known(driver: DriverProfile, known: set[Basis], *, other_hand: bool) -> set[str]:
    """Sides of the road, "left" and "right", on which the driver's answer to neighbours is known in such a way."""
    return {other_side(side) if other_hand else side for side in SIDES if basis_of(driver, side) in known}


def _with_nobody_beside(segment: Segment) -> Segment:
    nobody = {
        name: np.full_like(values, np.nan if name.endswith("distance") else 0.0)
        for name, values in segment.context.items()
        if name in NEIGHBOURS
    }
    return replace(segment, context={**segment.context, **nobody})


def _apart(
    drawn: Sequence[_Drawn], motion: NominalMotion, network: RoadNetwork, uncertain: Collection[str]
) -> list[_Drawn]:
    """Neighbours give way to each other, where it is certain that they meet."""
    if uncertain:
        certain = [one for one in drawn if one.motion.name not in uncertain]
        moved = {one.motion.name: one for one in _apart(certain, motion, network, ())}
        return [moved.get(one.motion.name, one) for one in drawn]
    if sum(bool(one.segments) for one in drawn) == 0 or len(drawn) < 2:
        return list(drawn)
    every = max(1, round(SAMPLE_STEP / motion.step))
    rows = np.arange(0, len(motion.entities[0].time), every)
    moves = give_way(motion, network, [_sampled(one, rows) for one in drawn], rows)
    return [one if move is None else _moved(one, rows, move) for one, move in zip(drawn, moves, strict=True)]


def _moved(one: _Drawn, rows: IntArray, move: FloatArray) -> _Drawn:
    """Its offsets and what it moves aside, known on these rows. [m]"""
    give_back(len(rows))
    segments = ((span, knots, kept(offset + np.interp(knots, rows, move))) for span, knots, offset in one.segments)
    return replace(one, segments=tuple(segments))


def _sampled(one: _Drawn, rows: IntArray) -> SampledVehicle:
    """What its neighbours see of a vehicle on some rows: how it deviates, and where it could do so more."""
    deviation, can_move = np.zeros(len(rows)), np.zeros(len(rows), dtype=np.bool_)
    if one.segments:
        deviation = one.deviation(rows)
        for span, _, _ in one.segments:
            can_move[(rows >= span.first) & (rows <= span.last)] = True
    give_back(len(one.motion.time))
    return SampledVehicle(one.motion, kept(deviation), kept(can_move), one.responds, one.alone)


def _result(drawn: _Drawn, network: RoadNetwork) -> EntityResult:
    """Paths through the offsets, smoothed where nobody could drive them."""
    entity = drawn.motion
    if not drawn.segments:
        return _untouched(entity, drawn.spans, drawn.why)
    bounded = [drivable(offset, SAMPLE_STEP, entity.speed[knots]) for _, knots, offset in drawn.segments]
    worst = max((bound for _, bound in bounded if bound), key=lambda bound: bound.before.excess, default=None)
    segments = tuple(
        (span, knots, kept(offset + error))
        for (span, knots, _), (offset, _), error in zip(drawn.segments, bounded, drawn.errors, strict=True)
    )
    deviation = replace(drawn, segments=segments).deviation()
    return EntityResult(
        entity,
        drawn.spans,
        drawn.profile,
        "",
        tuple(
            SampledSegment(span, entity.time[knots[0] : knots[-1] + 1 : knots[1] - knots[0]], offset, later)
            for (span, knots, offset), later in zip(segments, drawn.beyond, strict=True)
        ),
        deviation,
        displace(entity, network, deviation),
        drawn.neutral,
        worst,
    )


def _with_trailers(
    entities: tuple[EntityResult, ...], network: RoadNetwork, trailers: Mapping[str, str]
) -> tuple[EntityResult, ...]:
    """Trailers in their tractor's track: its deviation, where its coupling was one trailer length ago."""
    results = {entity.name: entity for entity in entities}
    for name in results:  # in file order, in which a tractor comes before what it pulls, also in a chain
        tractor = results.get(trailers.get(name, ""))
        if tractor is None or not tractor.deviation.any():
            continue
        trailer = results[name]
        behind = float(np.hypot(trailer.motion.x[0] - tractor.motion.x[0], trailer.motion.y[0] - tractor.motion.y[0]))
        distance = distance_driven(tractor.motion)
        n = len(distance)
        along = ([np.interp(distance[rows] - behind, distance, tractor.deviation)] for rows in blocks(n))
        deviation = columns(n, along)[0]
        trajectory = displace(trailer.motion, network, deviation)
        results[name] = replace(trailer, deviation=deviation, trajectory=trajectory, why="follows its tractor")
    return tuple(results.values())


def _untouched(entity: EntityMotion, spans: tuple[SegmentSpan, ...], why: str) -> EntityResult:
    no_deviation = np.broadcast_to(0.0, len(entity.time))
    return EntityResult(entity, spans, None, why, (), no_deviation, _nominal(entity))


def _nominal(entity: EntityMotion) -> WorldTrajectory:
    return WorldTrajectory(
        entity.time, entity.x, entity.y, entity.z, entity.heading, entity.pitch, entity.roll, entity.speed
    )


def _segment(
    motion: NominalMotion,
    network: RoadNetwork,
    index: int,
    knots: IntArray,
    every: int,
    foreign_context: Mapping[str, tuple[FloatArray, FloatArray]],
) -> Segment:
    """The segment on its knots, with context before and after as far as the entity's motion is one piece."""
    entity = motion.entities[index]

    start = max(0, knots[0] - every * round(PAST / SAMPLE_STEP))
    stop = min(len(entity.time), knots[-1] + every * round(FUTURE / SAMPLE_STEP) + 1)
    earlier, later = (
        np.flatnonzero(((activity & Activity.TELEPORTED) != 0) | ((activity & Activity.ACTIVE) == 0))
        for activity in (entity.activity[start : knots[0] + 1], entity.activity[knots[-1] + 1 : stop])
    )
    before = (knots[0] - start - int(earlier.max(initial=0))) // every
    after = int(later.min(initial=stop - knots[-1] - 1)) // every
    grid = np.arange(knots[0] - before * every, knots[-1] + after * every + 1, every)
    context = entity_context(motion, network, index, grid)
    for name, (time, values) in foreign_context.items():
        context[name] = np.interp(entity.time[grid], time, values)
    return Segment(
        time=entity.time[grid],
        lane_width=_filled(context["lane_width"], slice(before, len(grid) - after)),
        speed=context["speed"],
        context=context,
        before=before,
        after=after,
    )


def _going_on(segment: Segment, rows: int) -> Segment:
    """What follows a segment where everything stays as at its end."""
    last = segment.inside.stop
    kept = np.append(np.arange(last), np.full(rows, last - 1))
    time = np.append(segment.time[:last], segment.time[last - 1] + SAMPLE_STEP * np.arange(1, rows + 1))
    context = {name: values[kept] for name, values in segment.context.items()}
    return Segment(time, segment.lane_width[kept], segment.speed[kept], context, before=last, after=0)


def _filled(values: FloatArray, inside: slice) -> FloatArray:
    """Lane widths with the nearest one inside the segment where the margins hold none (off the road)."""
    filled = values.copy()
    filled[: inside.start][np.isnan(filled[: inside.start])] = values[inside.start]
    filled[inside.stop :][np.isnan(filled[inside.stop :])] = values[inside.stop - 1]
    return filled


def _is_left_hand(entity: EntityMotion, network: RoadNetwork, knots: IntArray) -> bool:
    """Whether one keeps left where a segment begins."""
    return network.roads[int(entity.road[knots[0]])].rule == "LHT"


def _unknown(driver: DriverProfile, segment: Segment) -> set[str]:
    """Columns that the scenario could have told."""
    return {column for column in driver.columns if column not in segment.context}
