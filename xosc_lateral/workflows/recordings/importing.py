"""`import_drives`: other people's recordings into the standard drive table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from xosc_lateral.files.labels import file_label
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.workflows.recordings.importers import find_importer
from xosc_lateral.workflows.recordings.importers.table import as_imported
from xosc_lateral.workflows.result import PathLike, Paths, Result, as_paths

if TYPE_CHECKING:
    import pandas as pd

    from xosc_lateral.workflows.recordings.importers.table import Imported


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
        from xosc_lateral.workflows.recordings.importers.table import describe

        return describe(self._imported.provenance)

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
