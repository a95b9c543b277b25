"""Sample offsets for every road-following segment of a played scenario and shift the paths by them."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from xosc_lateral.base.arrays import BLOCK, FloatArray, IntArray, blocks, columns
from xosc_lateral.base.segment import within_heading
from xosc_lateral.drivers.model.plausibility import check_offsets, drivable
from xosc_lateral.drivers.model.profile import DriverProfile, Maneuvers
from xosc_lateral.drivers.model.sampled_offsets import known_sensor, sensor_error
from xosc_lateral.drivers.model.sampling import OffsetSampler
from xosc_lateral.drivers.model.seeds import of_driver
from xosc_lateral.workflows.conversion.consequences import lane_departures
from xosc_lateral.workflows.conversion.driver_context import (
    NOTHING_SEEN,
    SAMPLE_STEP,
    Contexts,
    DriverContext,
    going_on,
    seen_by,
)
from xosc_lateral.workflows.conversion.result import (
    Drivers,
    Enriched,
    EntityResult,
    LaneChanges,
    Neighbours,
    SampledSegment,
    nominal_result,
)
from xosc_lateral.world.motion.gaps import gaps_of
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.motion.segments import (
    Crossing,
    SegmentKind,
    SegmentSpan,
    beside_written,
    crossings,
    cut_segments,
    movement_runs,
)
from xosc_lateral.world.motion.trajectory import (
    SETTLING_TIME,
    SampledDeviation,
    deviation_through,
    displace,
    distance_driven,
)
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.surroundings.context import Surroundings
from xosc_lateral.world.surroundings.give_way import SampledVehicle, give_way


def enrich(
    run: SegmentedRun,
    drivers: Drivers,
    *,
    seed: int,
    variant: int = 0,
    seed_words: Mapping[str, Sequence[int]] | None = None,
    context: Contexts | None = None,
    attempts: int = 1,
    with_sensor: bool = False,
    lane_changes: LaneChanges = LaneChanges.LIFELIKE,
    least_time: float = 0.0,
) -> Enriched:
    """Enrich a played scenario.

    - `drivers`: per entity a profile, or the reason why it is not enriched
    - `seed`, `variant`, `seed_words`: with an entity's name they seed its own random numbers: another one changes none
    - `context`: what the scenario doesn't state, or replaces: times [s] and values, the same for all entities
    - `attempts`: at most, while vehicles touch or leave their lane that nominally don't; the best is kept
    - `with_sensor`: add what the sensor added to the drives that each profile was fitted on: nobody drives that, so it
      comes after drivers have given way and after what nobody could drive was smoothed
    - `lane_changes`: how those of the run's `continuous` vehicles lead across
    - `least_time`: for which each segment is sampled, should it last longer in another run [s]

    Raises `DriverProfileError`: the sensor is asked for and a profile knows of none.
    """
    motion, network, words = run.motion, run.network, seed_words or {}
    least_rows = round(least_time / SAMPLE_STEP)

    def drawn_for(index: int, attempt: int) -> _Drawn:
        entity = motion.entities[index]
        driver, spans = drivers.get(entity.name, "not chosen"), run.spans[index]
        if isinstance(driver, str):
            return _Drawn(entity, spans, why=driver)
        seeds = of_driver(seed, entity.name, variant=variant, attempt=attempt, words=words.get(entity.name, ()))
        seen, lifelike = run.seen(index, driver, context or {}), lane_changes is LaneChanges.LIFELIKE
        blank = _Drawn(entity, spans, driver, seen, run.crossings[index], lifelike, unforeseen=run.unforeseen)
        return _draw(blank, driver, seeds, with_sensor, least_rows)

    best: Enriched | None = None
    for attempt in range(max(1, attempts)):
        drawn = [drawn_for(index, attempt) for index in range(len(motion.entities))]
        if run.neighbours is Neighbours.BORROW:
            drawn = _give_way(drawn, motion, network, run.ego_dependent)
        entities = _with_trailers([_result(one, network) for one in drawn], network, run.trailers)
        gaps_after = gaps_of(motion, [entity.trajectory for entity in entities])
        departures = tuple(departure for entity in entities for departure in lane_departures(entity, network))
        result = Enriched(motion, network, entities, run.gaps, gaps_after, departures, seed, variant, attempt)
        if best is None or result.trouble < best.trouble:
            best = result
        if not result.trouble:
            break
    assert best is not None
    return best


def seed_words_of(motion: NominalMotion, network: RoadNetwork) -> dict[str, tuple[int, ...]]:
    """Seed words of each entity from where it starts and how fast: nothing that anybody else does changes them."""
    words = {}
    for entity in motion.entities:
        there = ((entity.activity[rows] & Activity.ACTIVE) != 0 for rows in blocks(len(entity.activity)))
        row = next((BLOCK * k + int(np.argmax(mask)) for k, mask in enumerate(there) if mask.any()), 0)
        on_road = int(entity.road[row])
        where = (entity.x[row], entity.y[row]) if on_road < 0 else (entity.s[row], entity.offset[row])
        road = "" if on_road < 0 else network.road_ids[on_road]
        start = [road, str(entity.lane[row]), *(f"{value:.3f}" for value in (*where, entity.speed[row]))]
        digest = hashlib.sha256("\0".join(start).encode()).digest()
        words[entity.name] = tuple(int.from_bytes(digest[k : k + 4], "little") for k in range(0, 16, 4))
    return words


class _Sample(NamedTuple):
    """Offsets sampled on one run of spans."""

    spans: tuple[SegmentSpan, ...]
    knots: IntArray  # rows of the motion that were sampled, and the distance driven there [m]
    distance: FloatArray
    offset: FloatArray  # there [m]
    error: FloatArray  # what a sensor adds; zeros unless asked for [m]
    beyond: FloatArray  # how it would go on after the end [m]


@dataclass(frozen=True, eq=False)
class _Drawn:
    """One entity: what its driver sees, and what was sampled; `why` nothing was."""

    motion: EntityMotion
    spans: tuple[SegmentSpan, ...]
    profile: DriverProfile | None = None
    seen: DriverContext = NOTHING_SEEN  # without its segments once they are sampled: they are large
    crossings: tuple[Crossing, ...] = ()
    lifelike: bool = False  # where they can be
    samples: tuple[_Sample, ...] = ()
    why: str = ""
    unforeseen: Collection[tuple[str, ...]] = ()  # actions that nobody knows the begin of before

    def deviation(self, rows: IntArray | None = None) -> FloatArray:
        """On some rows or all, positive left. [m]"""
        distance, reach = distance_driven(self.motion), SETTLING_TIME * self.motion.speed
        through = deviation_through(
            [
                SampledDeviation(
                    one.distance,
                    within_heading(one.offset, one.distance),
                    (reach[one.knots[0]], reach[one.knots[-1]]),
                )
                for one in self.samples
            ]
        )
        aside = [beside_written(self.motion, one) for one in self.crossings if self.lifelike and not one.stays]
        if rows is not None:
            offsets = through(distance[rows])
            for part, values in aside:
                inside = (rows >= part.start) & (rows < part.stop)
                offsets[inside] += values[rows[inside] - part.start]
            return offsets
        offsets = columns(len(distance), ([through(distance[part])] for part in blocks(len(distance))))[0]
        for part, values in aside:
            offsets[part] += values
        return offsets


KEPT_ROWS = 100_000
"""Rows of all entities of a run up to which what drivers see is kept for its next variant: a run like that of 16 cars
for two minutes then keeps about 10 MB. [-]"""


class SegmentedRun:
    """A played scenario cut into segments, and what its drivers see: the same for all variants.

    - `trailers`: entity that is pulled -> its tractor, in whose track it follows
    - `ego_dependent`: entities that will move otherwise, since they depend on a vehicle under test or a controller:
      nobody responds to where they nominally are, nor do they to others
    - `continuous`: whose movement goes on through lane changes and lane offsets (`movement_runs`); that of the others
      leads from the segment before to the one behind
    - `neighbours`: `borrow`: a population's law of giving way, where a profile's answer is not known (`give_way`)
    - `respects_controllers`: where a controller of the player steers, nothing is sampled
    - `unforeseen`: actions, by their names from the story down, whose begin nobody knows before
    """

    def __init__(
        self,
        motion: NominalMotion,
        network: RoadNetwork,
        *,
        trailers: Mapping[str, str] | None = None,
        ego_dependent: Collection[str] = (),
        continuous: Collection[str] = (),
        neighbours: Neighbours = Neighbours.BORROW,
        respects_controllers: bool = True,
        unforeseen: Collection[tuple[str, ...]] = (),
    ) -> None:
        self.motion, self.network, self.neighbours, self.unforeseen = motion, network, neighbours, unforeseen
        self.trailers, self.ego_dependent = trailers or {}, frozenset(ego_dependent)
        self.spans = [
            cut_segments(
                entity, network, is_trailer=entity.name in self.trailers, respects_controllers=respects_controllers
            )
            for entity in motion.entities
        ]
        self.runs = [
            movement_runs(motion, entity, network, spans)
            if entity.name in continuous
            else tuple((span,) for span in spans if span.is_road_following)
            for entity, spans in zip(motion.entities, self.spans, strict=True)
        ]
        """Spans that are sampled, one after another without a break, of each entity."""
        self.crossings = [
            tuple(crossings(motion, entity, runs)) for entity, runs in zip(motion.entities, self.runs, strict=True)
        ]
        """Lane changes and lane offsets in them."""
        self.gaps = gaps_of(motion, motion.entities)
        certain = tuple(one for one in motion.entities if one.name not in self.ego_dependent)
        self._certain = Surroundings(replace(motion, entities=certain), network)
        self._seen: dict[int, tuple[DriverProfile, DriverContext]] = {}

    def seen(self, index: int, driver: DriverProfile, contexts: Contexts) -> DriverContext:
        """What the driver of an entity sees; looked at once for all variants with the same one."""
        before, seen = self._seen.get(index, (None, NOTHING_SEEN))
        if before is not driver or contexts:
            entity, around = self.motion.entities[index], self._certain
            if entity.name in self.ego_dependent:
                around = Surroundings(replace(self.motion, entities=(entity,)), self.network)
            seen = seen_by(driver, entity, around, self.runs[index], contexts, self.neighbours)
            if not contexts and self.is_small:
                self._seen[index] = driver, seen
        return seen

    @property
    def is_small(self) -> bool:
        """Whether it is worth its memory to keep it for the next variant."""
        return sum(len(entity.time) for entity in self.motion.entities) <= KEPT_ROWS


def _draw(blank: _Drawn, driver: DriverProfile, seed: np.random.SeedSequence, with_sensor: bool, least: int) -> _Drawn:
    """With the offsets of one entity; each segment goes on to `least` rows."""
    if not blank.seen.segments:
        steered = any(span.kind is SegmentKind.STEERED for span in blank.spans)
        return replace(blank, why="steered by its controller" if steered else "no road-following segment")
    sampler, sensor = OffsetSampler(driver, seed), known_sensor(driver) if with_sensor else None
    samples: list[_Sample] = []
    for spans, knots, distance, segment, side, responses in blank.seen.segments:
        offset = side * sampler.sample(segment, responses=responses)
        if driver.maneuvers is not None:
            offset += _anticipated(driver.maneuvers, blank, spans, knots, side)
        more = least - len(knots)
        beyond = side * sampler.copy().sample(going_on(segment, more)) if more > 0 else np.empty(0)
        subject = f"profile {driver.name} for {blank.motion.name!r}"
        check_offsets(offset, segment.lane_width[segment.inside], subject, segment.time[segment.inside])
        error = sensor_error(sensor, offset, SAMPLE_STEP, seed, part=len(samples))
        samples.append(_Sample(spans, knots, distance, offset, error, beyond))
    return replace(blank, seen=blank.seen._replace(segments=()), samples=tuple(samples))


def _anticipated(
    maneuvers: Maneuvers, drawn: _Drawn, spans: Sequence[SegmentSpan], knots: IntArray, side: float
) -> FloatArray:
    """What a driver does before his lane changes of a run, whose begin he knows, on its knots. [m]

    Those are lane changes that his movement goes on through, and that no vehicle under test decides to begin.
    """
    time = drawn.motion.time
    offset, free = np.zeros(len(knots)), float(time[spans[0].first])
    for crossing in drawn.crossings:
        begin, end = float(time[crossing.first]), float(time[crossing.last])
        if spans[0].first <= crossing.first and crossing.last <= spans[-1].last and end > begin:
            if crossing.is_lane_change and crossing.path not in drawn.unforeseen:
                left = side * float(crossing.way[-1]) > 0.0
                offset += side * maneuvers.anticipation(time[knots], begin, end, left=left, free=free)
            free = end
    return offset


def _give_way(
    drawn: Sequence[_Drawn], motion: NominalMotion, network: RoadNetwork, ego_dependent: Collection[str]
) -> list[_Drawn]:
    """Neighbours give way to each other, where it is certain that they meet."""
    certain = [one for one in drawn if one.motion.name not in ego_dependent]
    if len(certain) < 2 or not any(one.samples for one in certain):
        return list(drawn)
    rows = np.arange(0, len(motion.entities[0].time), max(1, round(SAMPLE_STEP / motion.step)))
    moves = give_way(motion, network, [_sampled(one, rows) for one in certain], rows)
    moved = dict[str, _Drawn]()
    for vehicle, move in zip(certain, moves, strict=True):
        if move is not None:
            aside = (one.offset + np.interp(one.knots, rows, move) for one in vehicle.samples)
            samples = tuple(one._replace(offset=offset) for one, offset in zip(vehicle.samples, aside, strict=True))
            moved[vehicle.motion.name] = replace(vehicle, samples=samples)
    return [moved.get(one.motion.name, one) for one in drawn]


def _sampled(vehicle: _Drawn, rows: IntArray) -> SampledVehicle:
    """What its neighbours see of a vehicle on some rows: how it deviates, and where it could do so more."""
    deviation, can_move = np.zeros(len(rows)), np.zeros(len(rows), dtype=np.bool_)
    if vehicle.samples:
        deviation = vehicle.deviation(rows)
        for sample in vehicle.samples:
            for span in sample.spans:
                can_move[(rows >= span.first) & (rows <= span.last)] = span.is_road_following
    seen = vehicle.seen
    return SampledVehicle(vehicle.motion, deviation, can_move, seen.responds, seen.answer_known)


def _result(drawn: _Drawn, network: RoadNetwork) -> EntityResult:
    """Paths through the offsets, smoothed where nobody could drive them."""
    entity = drawn.motion
    if not drawn.samples:
        return nominal_result(entity, drawn.spans, drawn.why)
    driven = [drivable(one.offset, SAMPLE_STEP, entity.speed[one.knots]) for one in drawn.samples]
    samples = tuple(
        one._replace(offset=offset + one.error) for one, (offset, _) in zip(drawn.samples, driven, strict=True)
    )
    bounds = [bound for _, bound in driven if bound is not None]
    deviation = replace(drawn, samples=samples).deviation()
    return EntityResult(
        entity,
        drawn.spans,
        drawn.profile,
        "",
        tuple(part for one in samples for part in _parts(one, entity)),
        deviation,
        displace(entity, network, deviation),
        drawn.seen.neutral,
        max(bounds, key=lambda bound: bound.before.excess, default=None),
        drawn.crossings,
    )


def _parts(sample: _Sample, entity: EntityMotion) -> Iterator[SampledSegment]:
    """Its road-following segments; what comes after the run comes after the last of them."""
    for span in sample.spans:
        inside = slice(*np.searchsorted(sample.knots, (span.first, span.last + 1)))
        if span.is_road_following and inside.stop - inside.start > 1:
            beyond = sample.beyond if span is sample.spans[-1] else np.empty(0)
            time, distance = entity.time[sample.knots[inside]], sample.distance[inside]
            yield SampledSegment(span, time, sample.offset[inside], beyond, distance)


def _with_trailers(
    entities: Sequence[EntityResult], network: RoadNetwork, trailers: Mapping[str, str]
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
