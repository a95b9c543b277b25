"""Tables that this package writes: CSV with a provenance file beside it, or Parquet with it inside."""

from __future__ import annotations

import gzip
import hashlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.cells import harmless
from xosc_lateral.formats.profiles import canonical_json
from xosc_lateral.formats.targets import SIDECAR_SUFFIX
from xosc_lateral.version import __version__

if TYPE_CHECKING:
    import pandas as pd

METADATA_KEY = b"xosc-lateral"
"""Key of the provenance in a Parquet file's schema metadata."""


def write_frame(
    frame: pd.DataFrame, path: Path, provenance: Mapping[str, Any], *, decimals: Mapping[str, int] | int = 6
) -> None:
    """Write a table; the same frame and provenance give the same bytes.

    Parameters
    ----------
    path : Path
        Its suffix, one of `tables.TABLE_SUFFIXES`, decides the format.
    provenance : mapping
        JSON values; the package's version is added.
    decimals : int or mapping of str to int
        Of the numbers in a CSV, per column or of all; Parquet keeps every bit.
    """
    if path.name.lower().endswith(".parquet"):
        write_atomically(path, _parquet(frame, stamped(provenance)))
    else:
        write_csv(csv_text(frame, decimals), path, provenance)


def write_csv(text: str, path: Path, provenance: Mapping[str, Any]) -> None:
    """Write a CSV (packed if its name ends in ``.gz``) and its provenance beside it, with the hash of its bytes."""
    data = gzip.compress(text.encode(), mtime=0) if path.name.lower().endswith(".gz") else text.encode()
    record = stamped(provenance) | {"sha256": hashlib.sha256(data).hexdigest()}
    write_atomically(path.with_name(path.name + SIDECAR_SUFFIX), canonical_json(record) + "\n")
    write_atomically(path, data)


def csv_text(frame: pd.DataFrame, decimals: Mapping[str, int] | int = 6) -> str:
    """The table as CSV; words that look like a formula are made harmless."""
    words = {
        name: frame[name].map(lambda value: harmless(value) if isinstance(value, str) else value)
        for name in frame.columns
        if frame[name].dtype.kind not in "fiubM"
    }
    frame = frame.assign(**words) if words else frame
    if isinstance(decimals, Mapping):
        frame = frame.assign(**{name: frame[name].map(f"{{:.{places}f}}".format) for name, places in decimals.items()})
        return str(frame.to_csv(index=False, lineterminator="\n"))
    return str(frame.to_csv(index=False, float_format=f"%.{decimals}f", lineterminator="\n"))


def stamped(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Provenance with the package that wrote it."""
    return {"package": f"xosc-lateral {__version__}", **provenance}


def _parquet(frame: pd.DataFrame, provenance: Mapping[str, Any]) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pandas(frame, preserve_index=False)
    metadata = {**(table.schema.metadata or {}), METADATA_KEY: canonical_json(provenance).encode()}
    buffer = io.BytesIO()
    pq.write_table(table.replace_schema_metadata(metadata), buffer, compression="zstd")
    return buffer.getvalue()
