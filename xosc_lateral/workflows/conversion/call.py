"""`convert`: a maneuver-based scenario in, a lifelike one out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.workflows.conversion.convert import convert_scenario
from xosc_lateral.workflows.conversion.options import spelled_out
from xosc_lateral.workflows.conversion.settings import ConvertKeywords, ConvertSettings
from xosc_lateral.workflows.result import PAGE_SUFFIXES, PathLike, Result, write_page

if TYPE_CHECKING:
    import pandas as pd

    from xosc_lateral.files.pages.figure import Figure
    from xosc_lateral.workflows.conversion.result import ConvertedScenario, EventShift

SCENARIO_SUFFIXES = (".xosc",)


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
    made = convert_scenario(source, written, settings, variant=variant - 1, report=page, save=output is not None)
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


def osi_files(output: PathLike, source: Path) -> tuple[Path, Path]:
    """Files of the enriched and of the nominal trace; an output that is a folder gets a usual name."""
    from xosc_lateral.files.osi import SUFFIXES

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
    def shifts(self) -> tuple[EventShift, ...]:
        """How much earlier or later events of a reactive output come, the largest under several egos. [s]"""
        return self._made.shifts

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
        from xosc_lateral.workflows.conversion.text import as_text

        return as_text(self._made, self.report)

    def to_frame(self) -> pd.DataFrame:
        """One row per entity and step (of those that exist then): where it is, and how far from where it nominally was.

        Columns: `time` [s], `name`, `x`, `y`, `z` [m], `h` [rad], `speed` [m/s], `road`, `lane` (nominal), `offset`
        (from the middle of that lane, positive left) [m], `deviation` (what enriching added) [m], `x_nominal`,
        `y_nominal` [m].
        """
        from xosc_lateral.workflows.conversion.frames import conversion_frame

        return conversion_frame(self._made.enriched)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        from xosc_lateral.workflows.conversion.text import facts

        return facts(self._made, self.report)

    def plot(self) -> Figure | None:
        """Nominal beside enriched paths, across the road over along it; None when no entity is on a road."""
        from xosc_lateral.workflows.playing.figures import paths_stretched

        return paths_stretched(self._made.enriched)

    def write_osi(self, path: PathLike, *, force: bool = False) -> tuple[Path, Path]:
        """Write two ASAM OSI traces (extra `osi`), enriched and, as ``NAME_nominal``, what the maneuvers alone give.

        Returns
        -------
        tuple of Path
            The two files: ``.mcap`` or ``.osi``, one `GroundTruth` per step.
        """
        from xosc_lateral.files.osi.write import host_of, write_osi

        enriched, nominal = outputs = osi_files(path, self.source)
        claim(outputs, [self.source], force=force)
        made = self._made.enriched
        host = host_of(made.motion, self.ego)
        said = f"{self.source.name}, enriched by xosc-lateral, seed {made.seed}, variant {made.variant + 1}"
        paths = [entity.trajectory for entity in made.entities]
        write_osi(enriched, made.motion, made.network, paths, host=host, description=said)
        said = f"{self.source.name}, as its maneuvers say"
        write_osi(nominal, made.motion, made.network, host=host, description=said)
        return outputs

    def write_report(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the HTML page about what was changed."""
        from xosc_lateral.workflows.conversion.page import conversion_page

        name, inputs = f"{self._made.output.stem}.html", [self.source]
        self.report = write_page(path, name, lambda: conversion_page(self._made), inputs=inputs, force=force)
        return self.report
