"""Convert one scenario: read, play, enrich, write."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from xosc_lateral import __version__
from xosc_lateral.enrich.enrich import enrich
from xosc_lateral.enrich.result import Enriched
from xosc_lateral.errors import FormatError
from xosc_lateral.formats.atomic import refuse_targets
from xosc_lateral.formats.context_table import read_context
from xosc_lateral.formats.hashes import file_hash
from xosc_lateral.formats.openscenario.write import (
    WrittenScenario,
    offset_chain,
    write_lane_offset_scenario,
    write_trajectory_scenario,
)
from xosc_lateral.formats.profiles import profile_hash
from xosc_lateral.pipeline.drivers import choose_drivers
from xosc_lateral.pipeline.load import Played, play_scenario
from xosc_lateral.pipeline.settings import ConvertSettings, Mode
from xosc_lateral.scenario import Scenario

NO_WIDTH = 0.01
"""A lane narrower than this is none. [m]"""


@dataclass(frozen=True, slots=True)
class Provenance:
    """What went into an output: enough to make the same bytes again.

    Parameters
    ----------
    package_version : str
    inputs : mapping of str to str
        File name -> SHA-256 of every file that was read (scenario, road, catalogs, context table).
    profiles : mapping of str to (str, str)
        Enriched entity -> name and SHA-256 of its profile.
    seed, variant : int
    parameters : mapping of str to str
        Scenario parameters that were replaced.
    """

    package_version: str
    inputs: Mapping[str, str]
    profiles: Mapping[str, tuple[str, str]]
    seed: int
    variant: int
    parameters: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, slots=True)
class Conversion:
    """One converted scenario.

    Parameters
    ----------
    source, output : Path
    output_hash : str
        SHA-256 of the output's bytes.
    enriched : Enriched
        Nominal and enriched motion, segments, gaps.
    provenance : Provenance
    warnings : tuple of str
        What a user has to know, a line each.
    """

    source: Path
    output: Path
    output_hash: str
    enriched: Enriched
    provenance: Provenance
    warnings: tuple[str, ...]


def convert_scenario(
    source: Path, output: Path, settings: ConvertSettings, *, variant: int = 0, report: Path | None = None
) -> Conversion:
    """Convert one scenario and write it.

    Parameters
    ----------
    source : Path
        Maneuver-based scenario.
    output : Path
        Where the converted one goes; its folder has to exist.
    settings : ConvertSettings
    variant : int
        Number of the variant: another one, other offsets.
    report : Path or None
        Where the caller will write a report: refused like the output if it can't be meant, before anything is written.

    Raises
    ------
    XoscLateralError
        When the input is at fault; nothing is written then.
    OSError
        When the output can't be written; nothing is left half-written.
    """
    played = play_scenario(
        source,
        parameters=settings.parameters,
        step=settings.step,
        time_limit=settings.time_limit,
        allowed=settings.allowed,
    )
    refuse_targets([output, report], _read_files(played.scenario, settings))
    drivers = choose_drivers(played.scenario, settings)
    enriched = enrich(
        played.motion,
        played.network,
        drivers,
        seed=settings.seed,
        variant=variant,
        entropy=_entropy(played.scenario),
        context=read_context(settings.context) if settings.context is not None else None,
        trailers=played.trailers,
        attempts=settings.attempts,
    )
    _refuse_lanes_without_width(played, enriched)
    provenance = _provenance(played, enriched, settings, variant)
    written = _write(played, enriched, output, provenance, settings.mode)
    warnings = enriched.warnings() + tuple(
        f"{removed.place.element}: left out ({removed.reason})" for removed in written.removed
    )
    return Conversion(source, output, written.sha256, enriched, provenance, warnings)


def _entropy(scenario: Scenario) -> tuple[int, ...]:
    """Seed words from what is played, not from where it lies: the scenario's bytes and its parameter values."""
    digest = hashlib.sha256(scenario.source)
    for name, parameter in sorted(scenario.parameters.items()):
        digest.update(f"\0{name}={parameter.value}".encode())
    return tuple(int.from_bytes(digest.digest()[k : k + 4], "little") for k in range(0, 16, 4))


def _provenance(played: Played, enriched: Enriched, settings: ConvertSettings, variant: int) -> Provenance:
    scenario = played.scenario
    return Provenance(
        package_version=__version__,
        inputs={_relative(path, scenario.path): file_hash(path) for path in _read_files(scenario, settings)},
        profiles={
            entity.name: (entity.profile.name, profile_hash(entity.profile))
            for entity in enriched.entities
            if entity.profile is not None
        },
        seed=settings.seed,
        variant=variant,
        parameters=dict(sorted(settings.parameters.items())),
    )


def _read_files(scenario: Scenario, settings: ConvertSettings) -> list[Path]:
    """Every file that went in: scenario, catalogs, road, context table."""
    return [*scenario.input_files, *(path for path in (scenario.road_file, settings.context) if path is not None)]


def _refuse_lanes_without_width(played: Played, enriched: Enriched) -> None:
    """A lane may begin or end with no width, but nobody follows one that has none all along."""
    for entity in enriched.entities:
        motion = entity.motion
        for segment in entity.segments:
            rows = slice(segment.stretch.first, segment.stretch.last + 1)
            width = played.network.lane_width(motion.road[rows], motion.lane[rows], motion.s[rows])
            if width.max() < NO_WIDTH:
                first = segment.stretch.first
                raise FormatError(
                    f"lane {motion.lane[first]} has no width where {entity.name!r} follows it",
                    path=played.scenario.road_file,
                    element=f"road {played.network.road_ids[motion.road[first]]!r}",
                )


def _relative(path: Path, scenario: Path) -> str:
    """Path as seen from the scenario: the same on every machine."""
    return Path(os.path.relpath(path.resolve(), scenario.resolve().parent)).as_posix()


def _write(played: Played, enriched: Enriched, output: Path, provenance: Provenance, mode: Mode) -> WrittenScenario:
    profiles = sorted({name for name, _ in provenance.profiles.values()})
    summary = f"seed {provenance.seed}, variant {provenance.variant}, {', '.join(profiles) or 'no profile'}"
    facts = asdict(provenance)
    if mode is Mode.LANE_OFFSET:
        chains = [
            offset_chain(entity.motion, played.network, entity.deviation, segment.stretch.first, segment.stretch.last)
            for entity in enriched.entities
            for segment in entity.segments
        ]
        return write_lane_offset_scenario(
            played.scenario, played.motion, chains, output, provenance=facts, summary=summary
        )
    trajectories = {entity.name: entity.trajectory for entity in enriched.entities}
    return write_trajectory_scenario(
        played.scenario, played.motion, trajectories, output, provenance=facts, summary=summary
    )


def convert_variants(
    source: Path, output: Path | None, settings: ConvertSettings, *, variants: int = 1, report: Path | None = None
) -> Iterator[Conversion]:
    """Convert one scenario into as many variants as wanted, one after another.

    Parameters
    ----------
    source : Path
    output : Path or None
        None: ``NAME_lifelike.xosc`` beside the source. Several variants get their number before the suffix.
    settings : ConvertSettings
    variants : int
    report : Path or None
        Where the caller will write reports, numbered like the outputs.

    Raises
    ------
    FormatError
        An output or report that can't be meant: before the first variant is written.
    """
    target = output if output is not None else source.with_name(f"{source.stem}_lifelike{source.suffix or '.xosc'}")
    outputs = [numbered(target, variant, variants) for variant in range(variants)]
    reports = [None if report is None else numbered(report, variant, variants) for variant in range(variants)]
    refuse_targets([*outputs, *reports], [source])
    for variant, (path, page) in enumerate(zip(outputs, reports, strict=True)):
        yield convert_scenario(source, path, settings, variant=variant, report=page)


def numbered(path: Path, variant: int, variants: int) -> Path:
    """Path of one variant: as it is when there is one alone, else with its number from 1 before the suffix."""
    if variants == 1:
        return path
    digits = max(2, len(str(variants)))
    return path.with_name(f"{path.stem}_{variant + 1:0{digits}d}{path.suffix}")
