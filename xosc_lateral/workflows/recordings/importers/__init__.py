"""Other people's recordings into the standard drive table: one reader per format.

Every reader returns an `Imported`: the table, and a record of where it came from, what was cut out and how sure the
lane centres are. `write_imported` puts both into one Parquet or CSV file.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeAlias, cast

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.plugins import plugins

if TYPE_CHECKING:
    from xosc_lateral.workflows.recordings.importers.table import Imported

Importer: TypeAlias = "Callable[..., Imported | pd.DataFrame]"
"""A source's path, and options by name, into a drive table, or into an `Imported` with a record of its own."""

IMPORTERS = {
    "dlr-ht": "xosc_lateral.workflows.recordings.importers.dlr_ht:import_dlr_ht",
    "levelx": "xosc_lateral.workflows.recordings.importers.levelx:import_levelx",
    "openacc": "xosc_lateral.workflows.recordings.importers.openacc:import_openacc",
    "mf4": "xosc_lateral.workflows.recordings.importers.mf4:import_mf4",
    "tracks": "xosc_lateral.workflows.recordings.importers.tracks:import_tracks",
    "table": "xosc_lateral.workflows.recordings.importers.foreign_table:import_table",
    "osi": "xosc_lateral.workflows.recordings.importers.osi:import_osi",
    "fcd": "xosc_lateral.workflows.recordings.importers.fcd:import_fcd",
    "commonroad": "xosc_lateral.workflows.recordings.importers.commonroad:import_commonroad",
}
"""Format -> its reader, loaded when it is wanted."""

GROUP = "xosc_lateral.importers"  # entry points of further readers


def find_importer(name: str) -> Importer:
    """The reader of a format. Raises `FormatError` if there is none."""
    if name in IMPORTERS:
        module, _, function = IMPORTERS[name].partition(":")
        return cast("Importer", getattr(import_module(module), function))
    offered: dict[str, Any] = plugins(GROUP)
    if name not in offered:
        raise FormatError(f"no importer {name!r}; there are {', '.join([*IMPORTERS, *offered])}")
    return cast("Importer", offered[name])
