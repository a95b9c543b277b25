"""What an import gives: a drive table and the record of where it came from, in one file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from xosc_lateral import __version__
from xosc_lateral.errors import FormatError

if TYPE_CHECKING:
    import pandas as pd

METADATA_KEY = b"xosc_lateral.provenance"


@dataclass(frozen=True)
class Provenance:
    """Where a table came from and what was done to it. Lengths in m, times in s."""

    format: str
    source: str
    sha256: str
    version: str
    licence: str
    settings: Mapping[str, object]
    rows: Mapping[str, int]
    vehicles: int
    hours: float
    lanes: Sequence[Mapping[str, object]] = ()
    package_version: str = field(default=__version__)

    def line(self) -> str:
        """The record as one line of JSON."""
        return json.dumps(asdict(self), sort_keys=True, ensure_ascii=False)


@dataclass(frozen=True, eq=False)
class Imported:
    """A drive table and its provenance."""

    table: pd.DataFrame
    provenance: Provenance


def write_imported(imported: Imported, path: Path) -> None:
    """Write Parquet (provenance in its metadata) or CSV (provenance in a file beside it), whole or not at all."""
    temporary = path.with_name(f".{path.name}.partial")
    try:
        if path.suffix == ".parquet":
            _write_parquet(imported, temporary)
        elif path.name.endswith((".csv", ".csv.gz")):
            packing = {"method": "gzip", "mtime": 0} if path.suffix == ".gz" else None
            imported.table.to_csv(temporary, index=False, compression=packing)
            beside = path.with_name(path.name + ".provenance.json")
            beside.write_text(imported.provenance.line() + "\n", encoding="utf-8")
        else:
            raise FormatError("a drive table is written as .parquet, .csv or .csv.gz", path=path)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _write_parquet(imported: Imported, path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pandas(imported.table, preserve_index=False)
    metadata = {**(table.schema.metadata or {}), METADATA_KEY: imported.provenance.line().encode()}
    pq.write_table(table.replace_schema_metadata(metadata), path, compression="zstd")


def hash_file(path: Path) -> str:
    """SHA-256 of a file's bytes."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def describe(provenance: Provenance, *, as_json: bool) -> str:
    """What was imported, for a person or a machine."""
    if as_json:
        return provenance.line()
    rows = ", ".join(f"{count} {state}" for state, count in provenance.rows.items())
    lines = [f"{provenance.source}: {provenance.vehicles} vehicles, {provenance.hours:g} h kept (rows: {rows})"]
    for lane in provenance.lanes:
        lines.append("  " + ", ".join(f"{name} {value}" for name, value in lane.items()))
    return "\n".join([*lines, f"licence: {provenance.licence}"])
