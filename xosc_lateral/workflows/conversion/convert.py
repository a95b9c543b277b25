"""Convert one scenario: read, play, enrich, write."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from xosc_lateral.base.errors import DriverProfileError, FormatError
from xosc_lateral.base.rows import BLOCK, beside, blocks
from xosc_lateral.base.version import BEHAVIOUR, __version__
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.openscenario.provenance import PENDING
from xosc_lateral.files.openscenario.write.build import named
from xosc_lateral.files.openscenario.write.draft import WrittenScenario
from xosc_lateral.files.openscenario.write.lateral_actions import changing_speed, lateral_actions
from xosc_lateral.files.openscenario.write.target import Player
from xosc_lateral.files.openscenario.write.trajectory_scenario import motion_unknown_to, write_trajectory_scenario
from xosc_lateral.files.output_paths import refuse_outputs
from xosc_lateral.files.profiles import profile_hash
from xosc_lateral.files.source import guarding_inputs
from xosc_lateral.files.tables import read_context
from xosc_lateral.workflows.conversion.as_written import CHANGES, as_written, read_written
from xosc_lateral.workflows.conversion.chains import chains_of
from xosc_lateral.workflows.conversion.drivers import choose_drivers
from xosc_lateral.workflows.conversion.enrich import enrich
from xosc_lateral.workflows.conversion.lane_changes import refuse_steps, stay_as_written
from xosc_lateral.workflows.conversion.load import Played, input_hashes, play_scenario, play_until
from xosc_lateral.workflows.conversion.meaning import KeptChains, keep_meaning, meaning_of
from xosc_lateral.workflows.conversion.modes import (
    WritingPlan,
    chosen_egos,
    follow_trajectories,
    heeds_controllers,
    is_replay,
    kept_controllers,
    writing_plan,
)
from xosc_lateral.workflows.conversion.result import ConversionProvenance, ConvertedScenario, Enriched, EventShift
from xosc_lateral.workflows.conversion.settings import ConvertSettings, OutputMode, relative
from xosc_lateral.workflows.conversion.shifts import Comparison, largest_of
from xosc_lateral.workflows.conversion.validity import validity_warnings, without_proving_grounds
from xosc_lateral.world.motion.nominal import Activity, NominalMotion
from xosc_lateral.world.motion.offset_chain import OffsetChain
from xosc_lateral.world.scenario import Scenario
from xosc_lateral.world.scenario.dependence import Dependence, dependence

LARGE_SHIFT = 0.3
"""Of its duration, by which an action lasts longer or shorter without a word. [-]"""
LEAST_LONGER, LONGER = 1.3, 2.0
"""A vehicle under test may be later at what ends the run, or never come to it: others follow trajectories for so
many times the nominal run. A fifth slower takes a quarter longer; a file of trajectories grows with their time. [-]"""
SUPPLY = 60.0
"""For so long at least, where it may last longer in another run, a stretch has movement of its own. What comes after it
is the same again; some of the slow movement of a driver is seen in that time. [s]"""


def convert_scenario(
    source: Path,
    output: Path,
    settings: ConvertSettings,
    *,
    variant: int = 0,
    report: Path | None = None,
    save: bool = True,
) -> ConvertedScenario:
    """Convert one scenario and write it.

    - `source`: maneuver-based scenario
    - `output`: where the converted one goes; its folder has to exist
    - `variant`: number of the variant: another one, other offsets
    - `report`: where the caller will write a report: refused like the output if it can't be meant, before anything is
      written
    - `save`: write the output; else the result holds its bytes, with file references as seen from `output`'s folder

    Raises `XoscLateralError`: when the input is at fault; nothing is written then; `OSError`: when the output can't be
    written; nothing is left half-written.
    """
    with guarding_inputs(), beside(output.parent if save else None):
        return _convert(source, output, settings, variant, report, save)


def _convert(
    source: Path, output: Path, settings: ConvertSettings, variant: int, report: Path | None, save: bool
) -> ConvertedScenario:
    played = play_scenario(
        source,
        parameters=settings.parameters,
        step=settings.step,
        time_limit=settings.time_limit,
        allowed=settings.allow,
        roads=settings.roads,
        strict=settings.strict,
    )
    _refuse_lane_offsets_for_carla(played.scenario, settings)
    egos = chosen_egos(played.scenario, settings)
    controllers = kept_controllers(played.scenario, settings, egos)
    unforeseeable = (*egos, *controllers)
    depends = dependence(played.scenario, unforeseeable)
    sampled = _sampled_too(played, settings, unforeseeable)
    context = None if settings.context is None else read_context(settings.context)
    inputs = dict(input_hashes(played.scenario, played.network))
    if context is not None and settings.context is not None:
        inputs[settings.context] = context.sha256
    refuse_outputs([output if save else None, report], inputs)
    for_carla = settings.target.player is Player.CARLA
    drivers = choose_drivers(played.scenario, settings, egos, controllers if for_carla else {})
    drivers = without_proving_grounds(drivers, played.motion, played.network, settings.entity)
    lasting = played
    reacts = settings.mode is OutputMode.AUTO and not is_replay(settings, depends)
    ends = depends.of_trigger(played.scenario.storyboard.stop_trigger) and played.motion.cut_off is None
    if reacts and ends:
        runs = meaning_of(played, unforeseeable, step=settings.step, time_limit=settings.time_limit)
        end = min(max(runs.end, LEAST_LONGER * played.motion.end_time), LONGER * played.motion.end_time)
        end = min(end, runs.limit)
        lasting = play_until(played, end, step=settings.step) if end > played.motion.end_time else played
    through = follow_trajectories(played.scenario, settings, depends, drivers)
    refuse_steps(played.scenario, settings, through)
    try:
        enriched = enrich(
            lasting.motion,
            played.network,
            drivers,
            seed=settings.seed,
            variant=variant,
            entropy=_entropy(played),
            context=context,
            trailers=played.trailers,
            attempts=settings.attempts,
            with_sensor=settings.with_sensor,
            neighbours=settings.neighbours,
            uncertain=depends.entities,
            heeds_controllers=heeds_controllers(settings),
            through=through,
            lane_changes=settings.lane_changes,
            at_least=0.0 if is_replay(settings, depends) else SUPPLY,
        )
    except DriverProfileError as error:  # found in the movement: who sampled knows the profile by its name alone
        raise DriverProfileError(f"{source}: {error}") from error
    names = [entity.name for entity in enriched.entities if entity.is_enriched]
    plan = writing_plan(played.scenario, settings, depends, names, pulled=played.trailers, sampled=sampled)
    making = _Making(played, lasting, settings, variant, inputs, egos, unforeseeable, depends, output, save)
    if plan.is_replay:
        replayed = _in_replay(played, settings, unforeseeable, sampled)
        provenance, written = making.write(enriched, plan, replayed=replayed, save=save)
        changes, shifts = tuple[str, ...](), tuple[EventShift, ...]()
    else:
        made = making.write_reactive(enriched, plan)
        enriched, plan, provenance, written = made.enriched, made.plan, made.provenance, made.written
        changes, shifts = made.warnings, made.shifts
    warnings = enriched.warnings() + tuple(
        f"{removed.place.element}: left out ({removed.reason})" for removed in written.removed
    )
    warnings += tuple(f"'{name}' follows a trajectory, too: {why}" for name, why in sampled.items()) + written.notes
    warnings += plan.frozen + changes + stay_as_written(enriched, settings, through) + validity_warnings(enriched)
    if played.motion.cut_off is not None:
        warnings = (str(played.motion.cut_off), *warnings)
    data = b"" if save else written.data
    return ConvertedScenario(
        source, output, written.sha256, enriched, provenance, warnings, data, plan.is_replay, shifts, controllers
    )


_Trial = tuple[tuple[OffsetChain, ...], WritingPlan, ConversionProvenance, WrittenScenario, Scenario, NominalMotion]
"""Chains, how they were written, and what was played."""


@dataclass(frozen=True, slots=True)
class _Making:
    """All that one output is made from, but for the offsets; `lasting` is the run that they are for."""

    played: Played
    lasting: Played
    settings: ConvertSettings
    variant: int
    inputs: Mapping[Path, str]
    egos: Mapping[str, str]
    unforeseeable: tuple[str, ...]
    depends: Dependence
    output: Path
    save: bool

    def write(
        self,
        enriched: Enriched,
        plan: WritingPlan,
        *,
        replayed: frozenset[str] | None = None,
        chains: Sequence[OffsetChain] = (),
        save: bool,
    ) -> tuple[ConversionProvenance, WrittenScenario]:
        """Write it with these offsets."""
        provenance = _provenance(
            self.played, enriched, self.settings, self.variant, self.inputs, self.egos, plan, self.output
        )
        written = _write(
            self.lasting, enriched, self.output, provenance, self.settings, plan, replayed, chains, save=save
        )
        return replace(provenance, content_sha256=written.content_sha256), written

    def write_reactive(self, enriched: Enriched, plan: WritingPlan) -> _Reactive:
        """Write it with offsets that leave what happens as it was; all trials are made in memory."""
        settings, source = self.settings, self.played.scenario
        meaning = meaning_of(self.played, tuple(self.egos), step=settings.step, time_limit=settings.time_limit)
        lateral, changing = lateral_actions(source), changing_speed(source)
        chains = [
            chain
            for entity in enriched.entities
            if entity.name in plan.lane_offsets
            for chain in chains_of(
                entity,
                self.played.motion,
                self.played.network,
                lateral.get(entity.name, ()),
                tows=entity.name in self.played.trailers.values(),
                changes_speed=entity.name in changing,
            )
        ]
        last: list[_Trial] = []

        def attempt(some: Sequence[OffsetChain]) -> list[Comparison]:
            written_for = replace(plan, lane_offsets=frozenset(chain.entity for chain in some))
            provenance, written = self.write(enriched, written_for, chains=some, save=False)
            again = read_written(written.data, self.output, source, settings)
            comparisons, run = meaning.compare(again, plan.trajectories)
            last[:] = [(tuple(some), written_for, provenance, written, again, run)]
            return comparisons

        kept = keep_meaning(chains, self.played.motion, attempt)
        if last[0][0] != kept.chains:
            attempt(kept.chains)
        _, written_for, provenance, written, again, run = last[0]
        left = plan.lane_offsets - written_for.lane_offsets
        measured = as_written(enriched, self.lasting, again, run, written_for.lane_offsets, left)
        if self.save:
            write_atomically(self.output, written.data)
        shifts = largest_of(kept.comparisons)
        return _Reactive(measured, written_for, provenance, written, shifts, tuple(_words(kept, left, shifts)))


@dataclass(frozen=True, slots=True)
class _Reactive:
    """A reactive output, and what there is to say of it."""

    enriched: Enriched
    plan: WritingPlan
    provenance: ConversionProvenance
    written: WrittenScenario
    shifts: tuple[EventShift, ...]
    warnings: tuple[str, ...]


def _words(kept: KeptChains, left: Collection[str], shifts: Sequence[EventShift]) -> Iterator[str]:
    """A line each: who stays as it is, whose moves are smaller, what comes much later, what is left."""
    for name in sorted(left):
        yield f"'{name}' stays as it is: {CHANGES}"
    for name, (factor, everywhere) in sorted(kept.smaller.items()):
        if name not in left:
            size = "none" if factor == 0.0 else f"{factor:g} times what was sampled"
            where = "" if everywhere else " before a maneuver"
            yield f"lane offsets of '{name}' are {size}{where}: {CHANGES}"
    for shift in shifts:
        longer = shift.end - shift.start
        if shift.duration > 0.0 and abs(longer) > LARGE_SHIFT * shift.duration:
            yield (
                f"event '{shift.event}' of '{shift.entity}' at {shift.time:.2f} s lasts {shift.duration + longer:.2f} "
                f"instead of {shift.duration:.2f} s: its way from beside the middle is another one"
            )
    yield from map(str, kept.changes)


def _refuse_lane_offsets_for_carla(scenario: Scenario, settings: ConvertSettings) -> None:
    if settings.mode is OutputMode.LANE_OFFSET and settings.target.player is Player.CARLA:
        raise FormatError(
            "lane offset actions have no shape in CARLA's ScenarioRunner; use --mode trajectory", path=scenario.path
        )
    if settings.mode is OutputMode.LANE_OFFSET and scenario.header.is_left_handed:
        raise FormatError(
            "is written for CARLA, whose lane offsets differ from the standard's; use --mode trajectory",
            path=scenario.path,
            element="FileHeader",
        )


def _entropy(played: Played) -> dict[str, tuple[int, ...]]:
    """Seed words of each entity from where it starts and how fast: nothing that anybody else does changes them."""
    found = {}
    for entity in played.motion.entities:
        there = ((entity.activity[rows] & Activity.ACTIVE) != 0 for rows in blocks(len(entity.activity)))
        row = next((BLOCK * k + int(np.argmax(mask)) for k, mask in enumerate(there) if mask.any()), 0)
        on_road = int(entity.road[row])
        where = (entity.x[row], entity.y[row]) if on_road < 0 else (entity.s[row], entity.offset[row])
        road = "" if on_road < 0 else played.network.road_ids[on_road]
        told = [road, str(entity.lane[row]), *(f"{value:.3f}" for value in (*where, entity.speed[row]))]
        digest = hashlib.sha256("\0".join(told).encode()).digest()
        found[entity.name] = tuple(int.from_bytes(digest[k : k + 4], "little") for k in range(0, 16, 4))
    return found


def _provenance(
    played: Played,
    enriched: Enriched,
    settings: ConvertSettings,
    variant: int,
    inputs: Mapping[Path, str],
    egos: Collection[str],
    plan: WritingPlan,
    output: Path,
) -> ConversionProvenance:
    scenario = played.scenario
    return ConversionProvenance(
        package_version=__version__,
        behaviour=BEHAVIOUR,
        scenario=f"{relative(scenario.path.parent, output.parent)}/{scenario.path.name}",
        inputs={relative(path, scenario.path.parent): sha256 for path, sha256 in inputs.items()},
        profiles={
            entity.name: (entity.profile.name, profile_hash(entity.profile))
            for entity in enriched.entities
            if entity.profile is not None
        },
        options=settings.record(scenario.path.parent),
        variant=variant + 1,
        version=named(settings.target.version_for(scenario)),
        ego=tuple(egos),
        modes={name: mode for name, mode in plan.modes().items() if enriched.entity(name).is_enriched},
        content_sha256=PENDING,
    )


def _write(
    played: Played,
    enriched: Enriched,
    output: Path,
    provenance: ConversionProvenance,
    settings: ConvertSettings,
    plan: WritingPlan,
    replayed: frozenset[str] | None,
    chains: Sequence[OffsetChain],
    *,
    save: bool,
) -> WrittenScenario:
    profiles = sorted({name for name, _ in provenance.profiles.values()})
    summary = f"seed {settings.seed}, variant {provenance.variant}, {', '.join(profiles) or 'no profile'}"
    summary += ", with sensor" if settings.with_sensor else ""
    facts = {field.name: getattr(provenance, field.name) for field in fields(provenance)}
    if not plan.is_replay:
        from xosc_lateral.files.openscenario.write.lane_offset_scenario import write_lane_offset_scenario

        return write_lane_offset_scenario(
            played.scenario,
            played.motion,
            chains,
            output,
            provenance=facts,
            summary=summary,
            save=save,
            target=settings.target,
            trajectories={name: enriched.entity(name).trajectory for name in sorted(plan.trajectories)},
        )
    trajectories = {
        entity.name: entity.trajectory for entity in enriched.entities if replayed is None or entity.name in replayed
    }
    return write_trajectory_scenario(
        played.scenario,
        played.motion,
        trajectories,
        output,
        provenance=facts,
        summary=summary,
        save=save,
        target=settings.target,
    )


def _in_replay(
    played: Played, settings: ConvertSettings, left: Collection[str], sampled: Collection[str]
) -> frozenset[str] | None:
    """Who follows a trajectory where everything happens by the clock; None: everybody."""
    if settings.only is None and not left:
        return None
    everybody = frozenset(entity.name for entity in played.motion.entities)
    only = everybody if settings.only is None else settings.only
    return (only | _pulled_by(played, only) | frozenset(sampled)) - frozenset(left)


def _sampled_too(played: Played, settings: ConvertSettings, unforeseeable: Collection[str]) -> dict[str, str]:
    """Entities that `only` leaves out, but whose maneuvers the target does not know, and why."""
    if settings.only is None or settings.mode is OutputMode.LANE_OFFSET:
        return {}
    left = {*settings.only, *unforeseeable}
    others = [entity.name for entity in played.motion.entities if entity.name not in left]
    if settings.target.player is Player.CARLA:
        return dict.fromkeys(others, "CARLA's ScenarioRunner plays maneuvers in ways of its own")
    return motion_unknown_to(settings.target.version_for(played.scenario), played.scenario, played.motion, others)


def _pulled_by(played: Played, tractors: frozenset[str]) -> frozenset[str]:
    return frozenset(trailer for trailer, tractor in played.trailers.items() if tractor in tractors)


def numbered(path: Path, variant: int, variants: int) -> Path:
    """Path of one variant: as it is when there is one alone, else with its number from 1 before the suffix."""
    if variants == 1:
        return path
    digits = max(2, len(str(variants)))
    return path.with_name(f"{path.stem}_{variant + 1:0{digits}d}{path.suffix}")
