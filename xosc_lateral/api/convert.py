"""`convert`: a maneuver-based scenario in, a lifelike one out."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from xosc_lateral.api.inputs import PathLike, Paths, ProfileLike, as_paths, road_search
from xosc_lateral.api.result import Result
from xosc_lateral.enrich.neighbours import Neighbours
from xosc_lateral.errors import FormatError
from xosc_lateral.formats.configuration import configured_egos, configured_neighbours
from xosc_lateral.formats.openscenario.write.target import target
from xosc_lateral.formats.output_paths import claim, output_file
from xosc_lateral.pipeline.convert import convert_scenario
from xosc_lateral.pipeline.settings import AUTO, ConvertSettings, OutputMode, egos_named

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from xosc_lateral.driver.profile import DriverProfile
    from xosc_lateral.enrich.conversion import ConvertedScenario

SCENARIO_SUFFIXES = (".xosc",)
REPORT_SUFFIXES = (".html", ".htm")


def convert(
    scenario: PathLike,
    output: PathLike | None = None,
    *,
    profile: ProfileLike = AUTO,
    entity: Mapping[str, ProfileLike] | None = None,
    only: Collection[str] | None = None,
    seed: int = 0,
    variant: int = 0,
    report: PathLike | None = None,
    context: PathLike | None = None,
    parameters: Mapping[str, object] | None = None,
    mode: Literal["auto", "trajectory", "lane-offset"] = "auto",
    ego: Collection[str] | None = None,
    neighbours: Literal["profile", "borrow", "none"] | None = None,
    player: Literal["standard", "esmini", "carla"] = "standard",
    version: str | None = None,
    library: Paths = (),
    allow: Paths = (),
    road: PathLike | None = None,
    road_path: Paths = (),
    attempts: int = 1,
    time_limit: float | None = None,
    with_sensor: bool = False,
    strict: bool = False,
    force: bool = False,
) -> Conversion:
    """Give every car in a scenario the lateral movement of a real driver.

    Parameters
    ----------
    scenario : str or Path
        Maneuver-based OpenSCENARIO file.
    output : str or Path, optional
        File, or folder, to write to. Without it nothing is written; `Conversion.data` holds what would be, with file
        references as seen from the scenario's folder.
    profile : DriverProfile, path or name
        Of every vehicle; "auto": the shipped population's, `motorway`.
    entity : mapping of str to DriverProfile, path or name, optional
        Entity -> profile, before `profile`.
    only : collection of str, optional
        Enrich these alone; the others stay as they are.
    seed, variant : int
        Same inputs, seed and variant: same bytes.
    report : str or Path, optional
        HTML page to write about what was changed.
    context : str or Path, optional
        Table of context over time that the scenario doesn't state: `time` [s], and a column each.
    parameters : mapping, optional
        Scenario parameters that replace those declared.
    mode : {"auto", "trajectory", "lane-offset"}
        Play maneuvers out, or keep them and add lane offsets between them; "auto" decides by vehicle: lane offsets for
        those whose motion depends on a vehicle under test.
    ego : collection of str, optional
        Vehicles under test, which are left as they are, beside those that the scenario leaves to somebody else (an
        external controller, CARLA's `ego_vehicle`); ("none",): there is none.
    neighbours : {"profile", "borrow", "none"}, optional
        How drivers answer to vehicles beside them: as the profile alone says; by a population's law, too, where the
        profile's answer is not known; not at all. None: as configured, else "borrow".
    player : {"standard", "esmini", "carla"}
        Who is to play it: nobody in particular, or a player with ways of its own.
    version : str, optional
        Of the standard, "1.0" to "1.4"; without it the input's (1.0 for CARLA). What an older version lacks is sampled,
        or left out and named in `Conversion.warnings`.
    library, allow : path or paths
        Folders with further profiles; folders that roads and catalogs may lie in.
    road, road_path : path; path or paths
        The road, whatever the scenario says; folders to look for it by its name ("Town04").
    attempts : int
        Sample anew up to so many times while cars touch or leave their lane.
    time_limit : float, optional
        Where a run is cut off; without it a scenario that never ends after 60 s, one with an end after an hour. [s]
    with_sensor : bool
        Add the sensor error of the drives that profiles were fitted on, for tests of a perception chain; without, the
        driver alone is written.
    strict : bool
        A missing vehicle catalog is an error, instead of a note and a usual car.
    force : bool
        Replace an output that this package did not write.

    Raises
    ------
    FormatError, PlaybackError, DriverProfileError
        With file, line and element; nothing is written then.
    """
    settings = convert_settings(
        profile=profile,
        entity=entity,
        only=only,
        seed=seed,
        context=context,
        parameters=parameters,
        mode=mode,
        ego=ego,
        neighbours=neighbours,
        player=player,
        version=version,
        library=library,
        allow=allow,
        road=road,
        road_path=road_path,
        attempts=attempts,
        time_limit=time_limit,
        with_sensor=with_sensor,
        strict=strict,
    )
    source = Path(scenario)
    written = source if output is None else output_scenario(output, source)
    page = None if report is None else output_file(report, f"{written.stem}.html", REPORT_SUFFIXES)
    claim([None if output is None else written, page], [source], force=force)
    made = convert_scenario(source, written, settings, variant=variant, report=page, save=output is not None)
    result = Conversion(made)
    if page is not None:
        result.write_report(page, force=force)
    return result


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


def convert_settings(
    *,
    profile: ProfileLike = AUTO,
    entity: Mapping[str, ProfileLike] | None = None,
    only: Collection[str] | None = None,
    seed: int = 0,
    context: PathLike | None = None,
    parameters: Mapping[str, object] | None = None,
    mode: str = "auto",
    ego: Collection[str] | None = None,
    neighbours: str | None = None,
    player: str = "standard",
    version: str | None = None,
    library: Paths = (),
    allow: Paths = (),
    road: PathLike | None = None,
    road_path: Paths = (),
    attempts: int = 1,
    time_limit: float | None = None,
    with_sensor: bool = False,
    strict: bool = False,
) -> ConvertSettings:
    """Settings of a conversion from what a user says; see `convert`."""
    if seed < 0:
        raise ValueError(f"seed {seed}, expected 0 or more")
    return ConvertSettings(
        profile=_named(profile),
        entity_profiles={name: _named(value) for name, value in (entity or {}).items()},
        only=None if only is None else frozenset(only),
        seed=seed,
        context=None if context is None else Path(context),
        parameters={name: str(value) for name, value in (parameters or {}).items()},
        attempts=attempts,
        mode=OutputMode(mode),
        ego=_egos(ego),
        neighbours=Neighbours(neighbours or configured_neighbours() or Neighbours.BORROW),
        target=target(player, version),
        libraries=as_paths(library),
        allowed=as_paths(allow),
        roads=road_search(road, road_path),
        time_limit=time_limit,
        with_sensor=with_sensor,
        strict=strict,
    )


def _egos(ego: Collection[str] | None) -> frozenset[str] | None:
    """As said, else as configured."""
    names = configured_egos() if ego is None else (ego,) if isinstance(ego, str) else ego
    return egos_named(names)


def _named(profile: ProfileLike) -> str | DriverProfile:
    return str(profile) if isinstance(profile, Path) else profile


def osi_files(output: PathLike, source: Path) -> tuple[Path, Path]:
    """Files of the enriched and of the nominal trace; an output that is a folder gets a usual name."""
    from xosc_lateral.formats.osi.extra import SUFFIXES

    enriched = output_file(output, f"{source.stem}_gt.mcap", SUFFIXES)
    return enriched, enriched.with_name(f"{enriched.stem}_nominal{enriched.suffix}")


class Conversion(Result):
    """A converted scenario: nominal and enriched motion, what to know about it, and how to get it again."""

    __slots__ = ("_made", "report")

    def __init__(self, made: ConvertedScenario) -> None:
        self._made = made
        self.report: Path | None = None
        """Page that was written, if one was."""

    @property
    def source(self) -> Path:
        """The scenario that was read."""
        return self._made.source

    @property
    def output(self) -> Path | None:
        """The scenario that was written; None if none was."""
        return None if self._made.data else self._made.output

    @property
    def sha256(self) -> str:
        """Of the output's bytes."""
        return self._made.output_sha256

    @property
    def data(self) -> bytes:
        """The converted scenario's bytes."""
        return self._made.data or self._made.output.read_bytes()

    @property
    def entities(self) -> tuple[str, ...]:
        """All entities, in the scenario's order."""
        return tuple(entity.name for entity in self._made.enriched.entities)

    @property
    def enriched(self) -> tuple[str, ...]:
        """Those that got offsets."""
        return tuple(entity.name for entity in self._made.enriched.entities if entity.is_enriched)

    @property
    def ego(self) -> tuple[str, ...]:
        """Vehicles under test: left as they are; empty: there is none, and everything is replayed."""
        return self._made.provenance.ego

    @property
    def is_replay(self) -> bool:
        """Whether everything happens by the clock of the nominal run."""
        return self._made.is_replay

    @property
    def modes(self) -> dict[str, str]:
        """Vehicle that was enriched -> "trajectory" or "lane-offset"."""
        return dict(self._made.provenance.modes)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user has to know, a line each."""
        return self._made.warnings

    @property
    def cut_off(self) -> str | None:
        """The warning of a run that the time limit cut off."""
        note = self._made.enriched.motion.cut_off
        return None if note is None else str(note)

    @property
    def end_time(self) -> float:
        """[s]"""
        return self._made.enriched.motion.end_time

    @property
    def smallest_gap(self) -> tuple[float | None, float | None]:
        """Smallest free space between two vehicles, nominal and enriched; None: none come near each other. [m]"""
        sides = (self._made.enriched.gaps_before, self._made.enriched.gaps_after)
        before, after = (min((gap.distance for gap in gaps), default=None) for gaps in sides)
        return before, after

    def headline(self) -> str:
        """One line."""
        where = self.source.name if self.output is None else f"{self.source.name} -> {self.output}"
        warned = f", {len(self.warnings)} warnings" if self.warnings else ""
        return f"{where}: {len(self.enriched)} of {len(self.entities)} entities enriched{warned}"

    def __str__(self) -> str:
        from xosc_lateral.report.conversion import as_text

        return as_text(self._made, self.report)

    def to_frame(self) -> pd.DataFrame:
        """One row per entity and step (of those that exist then): where it is, and how far from where it nominally was.

        Columns: `time` [s], `name`, `x`, `y`, `z` [m], `h` [rad], `speed` [m/s], `road`, `lane` (nominal), `offset`
        (from the middle of that lane, positive left) [m], `deviation` (what enriching added) [m], `x_nominal`,
        `y_nominal` [m].
        """
        from xosc_lateral.report.frames import conversion_frame

        return conversion_frame(self._made.enriched)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        from xosc_lateral.report.conversion import facts

        return facts(self._made, self.report)

    def plot(self) -> Figure | None:
        """Nominal beside enriched paths, across the road over along it; None when no entity is on a road."""
        from xosc_lateral.report.scenario_figures import paths_stretched

        return paths_stretched(self._made.enriched)

    def write_osi(self, path: PathLike, *, force: bool = False) -> tuple[Path, Path]:
        """Write two ASAM OSI traces (extra `osi`), enriched and, as ``NAME_nominal``, what the maneuvers alone give.

        Returns
        -------
        tuple of Path
            The two files: ``.mcap`` or ``.osi``, one `GroundTruth` per step.
        """
        from xosc_lateral.formats.osi.write import host_of, write_osi

        enriched, nominal = outputs = osi_files(path, self.source)
        claim(outputs, [self.source], force=force)
        made = self._made.enriched
        host = host_of(made.motion, self.ego)
        said = f"{self.source.name}, enriched by xosc-lateral, seed {made.seed}, variant {made.variant}"
        paths = [entity.trajectory for entity in made.entities]
        write_osi(enriched, made.motion, made.network, paths, host=host, description=said)
        said = f"{self.source.name}, as its maneuvers say"
        write_osi(nominal, made.motion, made.network, host=host, description=said)
        return outputs

    def write_report(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the HTML page about what was changed."""
        from xosc_lateral.formats.atomic import write_atomically
        from xosc_lateral.report.scenario import conversion_page

        page = output_file(path, f"{self._made.output.stem}.html", REPORT_SUFFIXES)
        claim([page], [self.source], force=force)
        self.report = write_atomically(page, conversion_page(self._made))
        return page
