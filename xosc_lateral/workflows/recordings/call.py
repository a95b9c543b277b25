"""The promised calls: `import_drives`, and `reconstruct` with its settings."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from xosc_lateral.base.lazy import pd
from xosc_lateral.files.drives import file_label
from xosc_lateral.files.mapping import MappingLike
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.workflows.conversion import options as say
from xosc_lateral.workflows.conversion.options import option, spelled_out, values_of
from xosc_lateral.workflows.recordings.importers import find_importer
from xosc_lateral.workflows.recordings.importers.table import Imported, as_imported
from xosc_lateral.workflows.result import PathLike, Paths, Result, as_paths

if TYPE_CHECKING:
    from xosc_lateral.workflows.recordings.reconstruct import Reconstruction

VERSIONS = ("1.0", "1.1", "1.2", "1.3")
"""Of the standard that can be written."""


def import_drives(
    format: str,  # noqa: A002 (the command line's word)
    source: Paths,
    **options: Any,
) -> ImportedDrives:
    """Read another format.

    Parameters
    ----------
    format : str
        "dlr-ht" (DLR Highway Traffic), "levelx" (highD, exiD), "mf4" (ASAM MDF; extra `mdf`),
        "tracks" (x, y on an OpenDRIVE road), "fcd" (SUMO), "commonroad" (extra `commonroad`),
        "osi" (ASAM OSI traces; extra `osi`), or a plug-in's.
    source : path or paths
        File or folder; "mf4" and some plug-ins take several files.
    options
        Of the format; the command line's ``import FORMAT --help`` lists them.

    Raises
    ------
    FormatError
        An unknown format, or a source that can't be read.
    """
    sources = as_paths(source)
    if not sources:
        raise ValueError("no source to import")
    made = find_importer(format)(sources[0] if len(sources) == 1 else sources, **options)
    return ImportedDrives(as_imported(made, format, sources, options), sources)


class ImportedDrives(Result):
    """A drive table and where it came from."""

    __slots__ = ("_imported", "sources")

    def __init__(self, imported: Imported, sources: tuple[Path, ...]) -> None:
        self._imported = imported
        self.sources = sources

    def headline(self) -> str:
        """One line."""
        known = self._imported.provenance
        return f"{known.source}: {known.vehicles} vehicles, {known.hours:g} h"

    def __str__(self) -> str:
        record = self._imported.provenance
        rows = ", ".join(f"{count} {state}" for state, count in record.rows.items())
        head = f"{record.source}: {record.vehicles} vehicles, {record.hours:g} h kept (rows: {rows})"
        lanes = ["  " + ", ".join(f"{name} {value}" for name, value in lane.items()) for lane in record.lanes]
        notes = [f"  note: {note}" for note in record.notes]
        return "\n".join([head, *lanes, *notes, f"licence: {record.licence}"])

    def to_frame(self) -> pd.DataFrame:
        """The drive table: what `fit` and the other calls take."""
        return self._imported.table

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them: the provenance."""
        from dataclasses import asdict

        return asdict(self._imported.provenance)

    def write(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the table: ``.parquet``, ``.csv`` or ``.csv.gz``, with its provenance."""
        from xosc_lateral.files.output_tables import output_suffixes
        from xosc_lateral.workflows.recordings.importers.table import write_imported

        output = output_file(path, f"{file_label(self.sources[0])}.parquet", output_suffixes())
        claim([output], [source for source in self.sources if source.is_file()], force=force)
        write_imported(self._imported, output)
        return output


def _version(text: str) -> str:
    if text not in VERSIONS:
        raise ValueError(f"version {text!r}, expected {', '.join(VERSIONS)}")
    return text


@dataclass(frozen=True, slots=True)
class ReconstructSettings:
    """What is reconstructed, and how: keywords of `reconstruct`, and options of the command line.

    Parameters
    ----------
    begin, end : float, optional
        Part of the recording. [s]
    vehicles : collection of str, optional
        These alone.
    around, window : str, float
        A vehicle and those who come near it, for so long in the middle of its passage. [s]
    host : str, optional
        The vehicle under test, which `convert` leaves to the system that drives it; by default the recording's own
        host; "none": there is none.
    error : float
        Positions along the road are within this; smaller: more corners in the speeds. [m]
    version : str
        Of OpenSCENARIO, "1.0" to "1.3".
    relative : bool
        Lane changes and braking begin at a distance to another vehicle, where the recording bears it out.
    exact : bool
        Recorded paths as trajectories, instead of maneuvers.
    fit : bool
        A driver profile of its own for every vehicle that drove long enough.
    library : path or paths
        Folders with further profiles to choose from.
    """

    # What is said of one option stays together.
    # fmt: off
    begin: float | None = option(
        None, float, "--from", kind=float | None, show_default=False, help="Begin there [s].",
    )
    end: float | None = option(None, float, "--to", kind=float | None, show_default=False, help="End there [s].")
    vehicles: frozenset[str] | None = option(
        None, say.names, kind=list[str] | None, metavar="ID", help="This vehicle alone; may be repeated.",
    )
    around: str | None = option(
        None, str, kind=str | None, metavar="ID", show_default=False,
        help="This vehicle and those who come near it.",
    )
    window: float = option(
        60.0, float, kind=float, min=1, max=3600, help="Length of the part that --around takes [s].",
    )
    host: str | None = option(
        None, str, kind=str | None, metavar="ID", show_default=False,
        help="The vehicle under test; default: the host of an OSI trace; none: no vehicle.",
    )
    error: float = option(
        0.5, float, kind=float, min=0.01,
        help="Positions along the road are within this [m]: the smaller, the more corners.",
    )
    version: str = option("1.2", _version, kind=str, metavar="1.0..1.3", help="Version of OpenSCENARIO to write.")
    relative: bool = option(
        False, bool, "--relative", kind=bool, help="Cut-ins and braking begin at a distance to another vehicle.",
    )
    exact: bool = option(
        False, bool, "--exact", kind=bool, help="Recorded paths as trajectories, no maneuvers.",
    )
    fit: bool = option(
        False, bool, "--fit", kind=bool, help="Fit a profile to everybody who drove long enough.",
    )
    library: tuple[Path, ...] = option((), say.paths)
    # fmt: on


class ReconstructKeywords(TypedDict, total=False):
    """The same names for type checkers, with what a call may be given."""

    begin: float | None
    end: float | None
    vehicles: Collection[str] | None
    around: str | None
    window: float
    host: str | None
    error: float
    version: str
    relative: bool
    exact: bool
    fit: bool
    library: Paths


@spelled_out(ReconstructSettings)
def reconstruct(
    recording: PathLike,
    output: PathLike | None = None,
    *,
    format: str | None = None,  # noqa: A002 (as in `import_drives`)
    road: PathLike | None = None,
    columns: MappingLike | None = None,
    force: bool = False,
    **options: Unpack[ReconstructKeywords],
) -> Reconstruction:
    """Turn a recording into maneuvers, a road and drivers.

    Parameters
    ----------
    recording : str or Path
        Tracks of several vehicles: DLR Highway Traffic, levelX, OSI traces, CommonRoad, SUMO's FCD output, or a table.
    output : str or Path, optional
        Folder to write to, see `Reconstruction.write`; without it nothing is written.
    format : str, optional
        "dlr-ht", "levelx", "osi", "commonroad", "fcd" or "tracks"; without it, told from the file.
    road : str or Path, optional
        OpenDRIVE file, for recordings that come without their lanes; SUMO's network, for its FCD output.
    columns : dict, path or TableMapping, optional
        Name -> ``COLUMN[:UNIT]`` for tables of tracks, or a saved mapping's file.
    force : bool
        Replace files that this package did not write.
    options
        `recordings.call.ReconstructSettings`: which part and which vehicles, and what is written of them.

    Raises
    ------
    FormatError, NotEnoughDataError
    """
    from xosc_lateral.workflows.recordings.reconstruct import reconstruct_recording
    from xosc_lateral.workflows.recordings.recordings import read_recording

    settings = ReconstructSettings(**values_of(ReconstructSettings, options))
    traffic = read_recording(Path(recording), kind=format, road=None if road is None else Path(road), columns=columns)
    result = reconstruct_recording(traffic, settings)
    if output is not None:
        result.write(output, force=force)
    return result
