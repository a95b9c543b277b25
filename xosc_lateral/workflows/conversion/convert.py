"""`convert`: a maneuver-based scenario in, a lifelike one out, in six steps over one plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Unpack

from xosc_lateral.base.errors import DriverProfileError, FormatError
from xosc_lateral.base.rows import beside
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.files.source import guarding_inputs
from xosc_lateral.workflows.conversion.consequences import stay_as_written, validity_warnings
from xosc_lateral.workflows.conversion.conversion import Conversion
from xosc_lateral.workflows.conversion.enrich import enrich, seed_words
from xosc_lateral.workflows.conversion.load import load_scenario, play_loaded, read_output
from xosc_lateral.workflows.conversion.meaning import as_played, keep_meaning, meaning_of
from xosc_lateral.workflows.conversion.options import spelled_out
from xosc_lateral.workflows.conversion.plan import Plan, decide, heeds_controllers
from xosc_lateral.workflows.conversion.result import Enriched, EventShift, LaneChanges
from xosc_lateral.workflows.conversion.settings import ConvertKeywords, ConvertSettings
from xosc_lateral.workflows.conversion.shifts import Comparison
from xosc_lateral.workflows.conversion.write import Written, write, write_with
from xosc_lateral.workflows.result import PAGE_SUFFIXES, PathLike
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.motion.offset_chain import OffsetChain
from xosc_lateral.world.scenario.scenario import Scenario

SCENARIO_SUFFIXES = (".xosc",)
SUPPLY = 60.0
"""For so long at least, where it may last longer in another run, a stretch has movement of its own. What comes after it
is the same again; some of the slow movement of a driver is seen in that time. [s]"""


@spelled_out(ConvertSettings)
def convert(
    scenario: PathLike,
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
    scenario : str or Path
        Maneuver-based OpenSCENARIO file.
    output : str or Path, optional
        File, or folder, to write to. Without it nothing is written; `Conversion.data` holds what would be, with file
        references as seen from the scenario's folder.
    variant : int
        From 1: another one, other offsets.
    report : str or Path, optional
        HTML page to write about what was changed.
    force : bool
        Replace an output that this package did not write.
    options
        `ConvertSettings`.

    Raises
    ------
    FormatError, PlaybackError, DriverProfileError
        With file, line and element; nothing is written then.
    """
    if variant < 1:
        raise ValueError(f"variant {variant}, they count from 1")
    settings = ConvertSettings.of(**options)
    source = Path(scenario)
    written = source if output is None else output_scenario(output, source)
    page = None if report is None else output_file(report, f"{written.stem}.html", PAGE_SUFFIXES)
    claim([None if output is None else written, page], [source], force=force)
    conversion = convert_scenario(source, written, settings, variant=variant - 1, report=page, saves=output is not None)
    if page is not None:
        conversion.write_report(page, force=force)
    return conversion


def convert_scenario(
    source: Path,
    output: Path,
    settings: ConvertSettings,
    *,
    variant: int = 0,
    report: Path | None = None,
    saves: bool = True,
) -> Conversion:
    """Convert one scenario.

    - `output`: where the converted one goes; its folder has to exist
    - `variant`: number of the variant: another one, other offsets
    - `report`: where the caller will write a report: refused like the output if it can't be meant, before anything is
      written
    - `saves`: write the output; else the result holds its bytes, with file references as seen from `output`'s folder

    Raises `XoscLateralError`: when the input is at fault; nothing is written then; `OSError`: when the output can't be
    written; nothing is left half-written.
    """
    with guarding_inputs(), beside(output.parent if saves else None):
        loaded = load_scenario(
            source,
            parameters=settings.parameters,
            allowed=settings.allow,
            roads=settings.roads,
            strict=settings.strict,
        )
        played = play_loaded(loaded, settings.step, settings.time_limit)
        plan = decide(loaded, played, settings, output=output, variant=variant, report=report, saves=saves)
        sampled = sample(plan)
        written = write(plan, sampled)
        checked = check(plan, sampled, written)
        return _conversion(plan, checked)


def sample(plan: Plan) -> Enriched:
    """Offsets of every vehicle that has a driver, for the run that they are for."""
    settings = plan.settings
    try:
        return enrich(
            plan.extended.motion,
            plan.played.network,
            plan.drivers,
            seed=settings.seed,
            variant=plan.variant,
            entropy=seed_words(plan.played.motion, plan.played.network),
            context=plan.context,
            trailers=plan.played.trailers,
            attempts=settings.attempts,
            with_sensor=settings.with_sensor,
            neighbours=settings.neighbours,
            uncertain=plan.depends.entities,
            heeds_controllers=heeds_controllers(settings),
            through=plan.through,
            lane_changes=settings.lane_changes,
            at_least=0.0 if plan.is_replay else SUPPLY,
        )
    except DriverProfileError as error:  # found in the movement: who sampled knows the profile by its name alone
        raise DriverProfileError(f"{plan.source}: {error}") from error


@dataclass(frozen=True, eq=False, slots=True)
class Checked:
    """An output in which what happens is what happened before, as far as can be had; `enriched`: as it is played."""

    enriched: Enriched
    written: Written
    shifts: tuple[EventShift, ...] = ()
    warnings: tuple[str, ...] = ()


def check(plan: Plan, sampled: Enriched, first: Written) -> Checked:
    """Play a reactive output under several egos, make moves smaller that change what happens, and put it in place.

    A replay follows the clock: nothing can happen otherwise.
    """
    if plan.is_replay:
        return Checked(sampled, first)
    settings, source = plan.settings, plan.played.scenario
    meaning = meaning_of(plan.played, tuple(plan.egos), step=settings.step, time_limit=settings.time_limit)

    def attempt(chains: Sequence[OffsetChain]) -> tuple[tuple[Written, Scenario, NominalMotion], list[Comparison]]:
        written = first if chains == first.chains else write_with(chains, plan, sampled, first.vehicles)
        output = read_output(written.file.data, plan.output, source, allowed=settings.allow, roads=settings.roads)
        comparisons, run = meaning.compare(output, first.vehicles.trajectories)
        return (written, output, run), comparisons

    (written, output, run), kept = keep_meaning(first.chains, plan.played.motion, attempt)
    left = first.vehicles.lane_offsets - written.with_lane_offsets
    enriched = as_played(sampled, output, run, written.with_lane_offsets, left)
    if plan.saves:
        write_atomically(plan.output, written.file.data)
    return Checked(enriched, written, kept.shifts, tuple(kept.warnings(left)))


def _conversion(plan: Plan, checked: Checked) -> Conversion:
    """What came of it, with all that a user has to know of it."""
    enriched, written = checked.enriched, checked.written
    cut_off, lifelike = plan.played.motion.cut_off, plan.settings.lane_changes is LaneChanges.LIFELIKE
    warnings = (
        *(() if cut_off is None else (str(cut_off),)),
        *enriched.warnings(),
        *(f"{removed.place.element}: left out ({removed.reason})" for removed in written.file.removed),
        *(f"'{name}' follows a trajectory, too: {why}" for name, why in plan.unwritable.items()),
        *written.file.notes,
        *written.vehicles.frozen,
        *checked.warnings,
        *(stay_as_written(enriched, plan.through) if lifelike else ()),
        *validity_warnings(enriched),
    )
    return Conversion(
        plan.source,
        plan.output if plan.saves else None,
        written.file.sha256,
        enriched,
        written.provenance,
        warnings,
        written.file.data,
        plan.is_replay,
        checked.shifts,
        plan.controllers,
    )


def output_scenario(output: PathLike, source: Path) -> Path:
    """Path of a converted scenario; in a folder its source's name, `_lifelike` where that would be the source."""
    if not source.exists():
        raise FormatError("no such file or folder", path=source)
    path = output_file(output, source.name, SCENARIO_SUFFIXES)
    same = path.parent.resolve() == source.parent.resolve() and path.name == source.name
    return lifelike(source) if same and path != Path(output) else path


def lifelike(source: Path) -> Path:
    """Where a converted scenario goes unless told otherwise: beside its source."""
    return source.with_name(f"{source.stem}_lifelike{source.suffix or '.xosc'}")


def numbered(path: Path, variant: int, variants: int) -> Path:
    """Path of one variant: as it is when there is one alone, else with its number from 1 before the suffix."""
    if variants == 1:
        return path
    digits = max(2, len(str(variants)))
    return path.with_name(f"{path.stem}_{variant + 1:0{digits}d}{path.suffix}")
