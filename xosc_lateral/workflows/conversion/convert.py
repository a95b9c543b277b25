"""`convert`: a maneuver-based scenario in, a lifelike one out. Load, play, decide, sample, write, check.

A replay moves vehicles along trajectories by the clock. Where a vehicle is under test the output is reactive: it keeps
triggers and maneuvers, and lane offsets are added.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Unpack

from msgspec import structs

from xosc_lateral.base.errors import DriverProfileError, FormatError, absent
from xosc_lateral.base.note import notes, remarked_before, warnings
from xosc_lateral.base.plugins import service
from xosc_lateral.drivers.model.effects.jam_corridor import JamCorridor
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.atomic import together, write_atomically
from xosc_lateral.files.held import exists
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.files.remote import leads_from, sent_back
from xosc_lateral.files.source import guard_input, guarding_inputs
from xosc_lateral.workflows.conversion.across import Way, in_words
from xosc_lateral.workflows.conversion.consequences import stay_as_written, validity_warnings
from xosc_lateral.workflows.conversion.conversion import Conversion
from xosc_lateral.workflows.conversion.enrich import enrich, seed_words_of
from xosc_lateral.workflows.conversion.equivalent_paths import Runs, largest_equivalent
from xosc_lateral.workflows.conversion.event_equivalence import as_played
from xosc_lateral.workflows.conversion.plan import Plan, WrittenAs, decide, other_egos, respects_controllers
from xosc_lateral.workflows.conversion.prepared import prepare
from xosc_lateral.workflows.conversion.result import NOMINAL_RUN, Drivers, Enriched, LaneChanges
from xosc_lateral.workflows.conversion.settings import ConvertKeywords, ConvertSettings
from xosc_lateral.workflows.conversion.write import Written, phases_of, provenance_of, write
from xosc_lateral.workflows.opened import DocumentLike, scenario_input
from xosc_lateral.workflows.options import spelled_out
from xosc_lateral.workflows.result import PAGE_SUFFIXES, PathLike
from xosc_lateral.world.motion.look import compare_parts, worst_of
from xosc_lateral.world.motion.offset_path import OffsetPath
from xosc_lateral.world.scenario.scenario import Scenario

SCENARIO_SUFFIXES = (".xosc",)


@spelled_out(ConvertSettings)
def convert(
    scenario: DocumentLike,
    output: PathLike | None = None,
    *,
    variant: int = 1,
    report: PathLike | None = None,
    force: bool = False,
    **options: Unpack[ConvertKeywords],
) -> Conversion:
    """Give every car in a scenario the lateral movement of a real driver.

    Parameters
    ----------
    scenario : str, Path, bytes, file-like, lxml tree or scenariogeneration's `Scenario`
        Maneuver-based OpenSCENARIO file, or what one holds; a text that begins with ``<`` is one.
    road : the same, or a mapping
        OpenDRIVE file, whatever the scenario says; roads and catalogs by their names, as the scenario writes them or
        without folders. What is in memory, or has such a mapping, reads nothing else from a disk.
    output : str or Path, optional
        File, or folder, to write to, or a URL (``s3://...``, through fsspec). Without it nothing is written;
        `Conversion.data` holds what would be, with file references as seen from the scenario's folder. Those of a
        scenario in memory stay as they are written.
    variant : int
        From 1; each has other offsets.
    report : str or Path, optional
        HTML page to write about what was changed.
    force : bool
        Replace an output that this package did not write.
    options
        `ConvertSettings`.

    Raises
    ------
    FormatError, PlaybackError, DriverProfileError
        With file, line and element; no output is written then.
    """
    if variant < 1:
        raise ValueError(f"variant {variant}, they count from 1")
    inputs = scenario_input(scenario, options.pop("road", None))
    settings, source = ConvertSettings.of(**options, road=inputs.road), inputs.path
    with sent_back(output, report) as (written, shown):
        # without an output, file references in the bytes are as from the source's folder
        target = source if written is None else output_scenario(written, source)
        page = None if shown is None else output_file(shown, f"{target.stem}.html", PAGE_SUFFIXES)
        claim([None if written is None else target, page], [source], force=force)
        with together():
            conversion = convert_scenario(
                source,
                target,
                settings,
                variant_index=variant - 1,
                report=page,
                saves=written is not None,
            )
            conversion.held = inputs.held
            if page is not None:
                conversion.write_report(page, force=force)
    return conversion


def convert_scenario(
    source: Path,
    output: Path,
    settings: ConvertSettings,
    *,
    variant_index: int = 0,
    report: Path | None = None,
    saves: bool = True,
) -> Conversion:
    """Convert one scenario.

    - `output`: where the converted one goes; its folder has to exist
    - `variant_index`: from 0; each has other offsets
    - `report`: where the caller will write a report; like `output`, it must be none of the files read here
    - `saves`: write the output; else the result holds its bytes, with file references as seen from `output`'s folder

    Raises `XoscLateralError`: when the input is at fault; nothing is written then; `OSError`: when the output can't be
    written; nothing is left half-written.
    """
    with guarding_inputs():
        for named in (settings.profile, *settings.entity.values(), settings.context, settings.road):
            if isinstance(named, str | Path):  # though nobody may be driven by it
                guard_input(Path(named))
        prepared = prepare(source, settings)
        with remarked_before(lambda: prepared.played.motion.messages):
            plan = decide(prepared, settings, output=output, variant_index=variant_index, report=report, saves=saves)
            return conversion_of(plan, carried_out(plan))


def carried_out(plan: Plan) -> Written:
    """Sample, write, check."""
    sampled = sample(plan)
    vehicles = plan.written_as(frozenset(entity.name for entity in sampled.entities if entity.is_enriched))
    if plan.is_replay:
        checked = _look_at_replay(write((), plan, sampled, vehicles, provenance_of(plan, sampled)))
    else:
        checked = _as_far_as_equivalent(plan, sampled, vehicles)
    if plan.saves and not plan.is_replay:  # a replay can be larger than memory: `write` put it in its place
        write_atomically(plan.output, checked.file.data)
    return checked


CORRIDOR_NOTE = "jam corridor: assumed; no recording that we have shows how far drivers keep aside"


def with_corridor(drivers: Drivers) -> dict[str, DriverProfile | str]:
    """The same drivers, who leave a corridor in a jam on a motorway."""
    return {
        name: one if isinstance(one, str) else structs.replace(one, effects=(*one.effects, JamCorridor()))
        for name, one in drivers.items()
    }


def sample(plan: Plan) -> Enriched:
    """Offsets of every vehicle that has a driver, for as long as the output may run."""
    settings, played = plan.settings, plan.played
    try:
        run = plan.prepared.segmented(
            plan.extended,  # played on beyond the end where the output is reactive, and the same up to there
            ego_dependent=frozenset(plan.depends.entities),
            continuous=plan.continuous,
            unforeseen=frozenset(plan.depends.begins),
            neighbours=settings.neighbours,
            respects_controllers=respects_controllers(settings),
        )
        return enrich(
            run,
            with_corridor(plan.drivers) if settings.jam_corridor else plan.drivers,
            seed=settings.seed,
            variant=plan.variant_index,
            seed_words=seed_words_of(played.motion, played.network),
            context=plan.context,
            attempts=settings.attempts,
            with_sensor=settings.with_sensor,
            lane_changes=settings.lane_changes,
            least_time=0.0 if plan.is_replay else plan.prepared.equivalence(tuple(plan.egos)).longest_time,
        )
    except DriverProfileError as error:  # sampling does not know the file
        raise DriverProfileError(f"{plan.source}: {error}") from error


def _look_at_replay(written: Written) -> Written:
    """A replay follows the clock: nothing can happen otherwise, and its paths are looked at as they were made."""
    findings = (
        worst_of(compare_parts(one.motion, one.trajectory)) for one in written.movement.entities if one.is_enriched
    )
    return replace(written, warnings=tuple(one.note(NOMINAL_RUN) for some in findings for one in some))


def _looked_at(plan: Plan, written: Written, first: Collection[str]) -> tuple[tuple[Written, Scenario], Runs]:
    """A reactive output, read, and its runs in `EventEquivalence`'s ways of driving as they are asked for."""
    source = plan.played.scenario
    read_files = (path for path in (*source.input_files, source.road_file) if path is not None)
    allowed = (*plan.settings.allow, *(path.parent for path in read_files))
    # Parsed as if it lay at its place already; references of one in memory lead from there wherever it goes.
    output = read_scenario(
        leads_from(plan.source, plan.output), allowed=allowed, roads=plan.settings.roads, data=written.file.data
    )
    runs = plan.prepared.equivalence(tuple(plan.egos)).compare(
        output, written.vehicles.trajectories, written.with_lane_offsets, first=first
    )
    return (written, output), runs


def _as_far_as_equivalent(plan: Plan, sampled: Enriched, vehicles: WrittenAs) -> Written:
    """A reactive output whose vehicles move as far as that leaves what happens as it was, and what is said of it."""
    settings, provenance, phases = plan.settings, provenance_of(plan, sampled), phases_of(plan, sampled)
    names = [entity.name for entity in sampled.entities if entity.name in vehicles.lane_offsets]

    def made(ways: Mapping[str, Way]) -> list[OffsetPath]:
        return [path for name in names for path in phases(name, ways.get(name))[0]]

    def attempt(paths: Sequence[OffsetPath], first: Collection[str]) -> tuple[tuple[Written, Scenario], Runs]:
        return _looked_at(plan, write(paths, plan, sampled, vehicles, provenance), first)

    (best, output), run, kept = largest_equivalent(made, plan.played.motion, attempt)
    unmoved = vehicles.lane_offsets - best.with_lane_offsets
    assert run is not None  # what is taken was played in all runs
    movement = as_played(sampled, output, run, best.with_lane_offsets, unmoved)
    known = {gap.names for gap in (*movement.new_contacts, *movement.lost_contacts)}
    warned = list(kept.warnings(unmoved, known))
    if settings.player_library is not None:
        warned += service("told_by_player")(
            settings.player_library, plan.played.scenario, (plan.output, best.file.data or b""),
            plan.prepared.equivalence(tuple(plan.egos)).runs, plan.played.network,
            egos=plan.egos, moved=best.with_lane_offsets, replayed=vehicles.trajectories,
        )  # fmt: skip
    stays = (line for name in names for line in phases(name, kept.ways.get(name))[1])
    return replace(
        best, movement=movement, played=replace(plan.played, scenario=output, motion=run),
        shifts=kept.shifts, warnings=tuple(warned), trial_contacts=kept.trial_contacts,
        stays=(*in_words(best.paths, plan.played.motion), *stays),
    )  # fmt: skip


def conversion_of(plan: Plan, written: Written) -> Conversion:
    """What came of it, with all that a user has to know of it."""
    movement, file = written.movement, written.file
    wants_lifelike = plan.settings.lane_changes is LaneChanges.LIFELIKE
    messages = (
        *plan.played.motion.messages,
        *warnings(other_egos(plan.played.scenario, plan.settings, plan.egos)),
        *movement.warnings(),
        *warnings(f"'{name}' is written as a trajectory: {why}" for name, why in plan.unwritable.items()),
        *file.notes,
        *warnings(written.vehicles.frozen),
        *written.warnings,
        *notes(stay_as_written(movement, written.vehicles.trajectories) if wants_lifelike else ()),
        *notes(written.stays),
        *warnings(validity_warnings(movement)),
        *warnings((CORRIDOR_NOTE,) if plan.settings.jam_corridor else ()),
    )
    return Conversion(
        source=plan.source,
        output=plan.output if plan.saves else None,
        sha256=file.sha256,
        movement=movement,
        provenance=written.provenance,
        messages=messages,
        content=file.data,
        is_replay=plan.is_replay,
        shifts=written.shifts,
        trial_contacts=written.trial_contacts,
        controllers=plan.controllers,
        egos=plan.egos,
        road_file=plan.played.scenario.road_file,
    )


def output_scenario(output: PathLike, source: Path) -> Path:
    """A file: as it is. A folder: the source's name in it, or `default_output`'s where that is the source itself."""
    if not exists(source):
        raise FormatError(absent(source), path=source)
    path = output_file(output, source.name, SCENARIO_SUFFIXES)
    is_source = path.parent.resolve() == source.parent.resolve() and path.name == source.name
    return default_output(source) if is_source and path != Path(output) else path


def default_output(source: Path) -> Path:
    """Where a converted scenario goes unless told otherwise: beside its source."""
    return source.with_name(f"{source.stem}_lifelike{source.suffix or '.xosc'}")
