"""Other people's recordings into the standard drive table: one reader per format.

Every reader returns an `Imported`: the table, and a record of where it came from, what was cut out and how sure the
lane centres are. `write_imported` puts both into one Parquet or CSV file.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias, cast

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.plugins import plugins
from xosc_lateral.files.drives import file_label
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.workflows.recordings.importers.table import Imported, as_imported
from xosc_lateral.workflows.result import PathLike, Paths, Result, as_paths

Importer: TypeAlias = "Callable[..., Imported | pd.DataFrame]"
"""A source's path, and options by name, into a drive table, or into an `Imported` with a record of its own."""

IMPORTERS = {
    "dlr-ht": ".dlr_ht:import_dlr_ht",
    "levelx": ".levelx:import_levelx",
    "openacc": ".openacc:import_openacc",
    "mf4": ".mf4:import_mf4",
    "tracks": ".tracks:import_tracks",
    "table": ".foreign_table:import_table",
    "osi": ".osi:import_osi",
    "fcd": ".fcd:import_fcd",
    "commonroad": ".commonroad:import_commonroad",
}
"""Format -> module here and function that read it, loaded when they are wanted."""

GROUP = "xosc_lateral.importers"  # entry points of further readers


def find_importer(name: str) -> Importer:
    """The reader of a format. Raises `FormatError` if there is none."""
    if name in IMPORTERS:
        module, _, function = IMPORTERS[name].partition(":")
        return cast("Importer", getattr(import_module(module, __name__), function))
    offered: dict[str, Any] = plugins(GROUP)
    if name not in offered:
        raise FormatError(f"no importer {name!r}; there are {', '.join([*IMPORTERS, *offered])}")
    return cast("Importer", offered[name])


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
