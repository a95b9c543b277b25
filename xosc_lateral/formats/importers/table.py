"""What an import gives: a drive table and the record of where it came from, in one file."""

from __future__ import annotations

import gzip
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from xosc_lateral import __version__
from xosc_lateral.errors import FormatError
from xosc_lateral.formats.atomic import replace_atomically, write_atomically
from xosc_lateral.formats.hashes import file_hash
from xosc_lateral.formats.importers.cuts import KEPT

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


def make_provenance(
    table: pd.DataFrame,
    *,
    format: str,  # noqa: A002 (the record's own word)
    sources: Sequence[Path],
    version: str,
    licence: str,
    settings: Mapping[str, object],
    step: float,
    lanes: Sequence[Mapping[str, object]] = (),
) -> Provenance:
    """Record of an import, from the table with its column `state` and rows `step` seconds apart."""
    return Provenance(
        format=format,
        source=", ".join(source.name for source in sources),
        sha256=hash_files(sources),
        version=version,
        licence=licence,
        settings=settings,
        rows={str(state): int(count) for state, count in table["state"].value_counts().sort_index().items()},
        vehicles=int(table["drive"].nunique()),
        hours=round(float((table["state"] == KEPT).sum()) * step / 3600.0, 3),
        lanes=lanes,
    )


def drop_cut(table: pd.DataFrame, keep_cut: bool) -> pd.DataFrame:
    """Without the rows that are cut and without `state`, unless they are wanted."""
    if keep_cut:
        return table.reset_index(drop=True)
    return table[table["state"] == KEPT].drop(columns="state").reset_index(drop=True)


def write_imported(imported: Imported, path: Path) -> None:
    """Write Parquet (provenance in its metadata) or CSV (provenance in a file beside it), whole or not at all."""
    if path.suffix == ".parquet":
        replace_atomically(path, lambda temporary: _write_parquet(imported, temporary))
    elif path.name.endswith((".csv", ".csv.gz")):
        text = imported.table.to_csv(index=False, lineterminator="\n").encode()
        write_atomically(path, gzip.compress(text, mtime=0) if path.suffix == ".gz" else text)
        write_atomically(path.with_name(path.name + ".provenance.json"), imported.provenance.line() + "\n")
    else:
        raise FormatError("a drive table is written as .parquet, .csv or .csv.gz", path=path)


def _write_parquet(imported: Imported, path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pandas(imported.table, preserve_index=False)
    metadata = {**(table.schema.metadata or {}), METADATA_KEY: imported.provenance.line().encode()}
    pq.write_table(table.replace_schema_metadata(metadata), path, compression="zstd")


def hash_files(paths: Sequence[Path]) -> str:
    """SHA-256 of one file's bytes; of several, that of their hashes one after the other."""
    if len(paths) == 1:
        return file_hash(paths[0])
    return hashlib.sha256("".join(map(file_hash, paths)).encode()).hexdigest()


def describe(provenance: Provenance, *, as_json: bool) -> str:
    """What was imported, for a person or a machine."""
    if as_json:
        return provenance.line()
    rows = ", ".join(f"{count} {state}" for state, count in provenance.rows.items())
    head = f"{provenance.source}: {provenance.vehicles} vehicles, {provenance.hours:g} h kept (rows: {rows})"
    lanes = ["  " + ", ".join(f"{name} {value}" for name, value in lane.items()) for lane in provenance.lanes]
    return "\n".join([head, *lanes, f"licence: {provenance.licence}"])
