"""The promised calls: `import_drives` with its result, and `reconstruct`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from xosc_lateral.base.lazy import pd
from xosc_lateral.files.drives import file_label
from xosc_lateral.files.mapping import MappingLike
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.workflows.conversion.options import spelled_out, values_of
from xosc_lateral.workflows.recordings.importers import find_importer
from xosc_lateral.workflows.recordings.importers.table import Imported, as_imported
from xosc_lateral.workflows.recordings.settings import ReconstructKeywords, ReconstructSettings
from xosc_lateral.workflows.result import PathLike, Paths, Result, as_paths

if TYPE_CHECKING:
    from xosc_lateral.workflows.recordings.reconstruction import Reconstruction


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
        `recordings.settings.ReconstructSettings`: which part and which vehicles, and what is written of them.

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
