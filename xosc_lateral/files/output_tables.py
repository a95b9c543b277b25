"""Tables that this package writes: Parquet with the provenance inside, others with a provenance file beside them."""

from __future__ import annotations

import gzip
import hashlib
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from xosc_lateral.base.lazy import pd
from xosc_lateral.base.version import __version__
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.json_text import canonical_json
from xosc_lateral.files.output_paths import SIDECAR_SUFFIX

_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def harmless(text: str) -> str:
    """Text that no spreadsheet takes for a formula: what begins like one gets an apostrophe before it.

    Reference: OWASP, "CSV Injection".
    """
    return f"'{text}" if text.startswith(_FORMULA) else text


METADATA_KEY = b"xosc-lateral"  # key of the provenance in a Parquet file's schema metadata

Encoder: TypeAlias = "Callable[[Callable[[], pd.DataFrame], Callable[[], str]], bytes]"
"""A table's bytes, from what gives it as a frame and what gives it as CSV; only one of both is asked for."""

PARQUET = ".parquet"

ENCODERS: dict[str, Encoder] = {
    ".csv": lambda frame, text: text().encode(),
    ".csv.gz": lambda frame, text: gzip.compress(text().encode(), mtime=0),
}
"""Suffix -> the bytes of a table, whose provenance goes into a file beside it. Parquet holds its own."""


def output_suffixes() -> tuple[str, ...]:
    """Of all formats that a table can be written in."""
    return (*ENCODERS, PARQUET)


def write_frame(frame: pd.DataFrame, path: Path, provenance: Mapping[str, Any]) -> None:
    """Write a table; the same frame and provenance give the same bytes.

    `path`: its suffix, one of `output_suffixes`, decides the format. `provenance`: JSON values; the package's version
    is added. A CSV has six decimals, Parquet every bit.
    """
    write_table(path, provenance, frame=lambda: frame, text=lambda: csv_text(frame))


def write_table(
    path: Path, provenance: Mapping[str, Any], *, frame: Callable[[], pd.DataFrame], text: Callable[[], str]
) -> None:
    """As `write_frame`, for tables that have a CSV of their own; whole or not at all.

    `frame`, `text`: give the table, and its CSV, when they are wanted.
    """
    name = path.name.lower()
    if name.endswith(PARQUET):
        write_atomically(path, _parquet(frame(), stamped(provenance)))
        return
    data = next(encode for suffix, encode in ENCODERS.items() if name.endswith(suffix))(frame, text)
    record = stamped(provenance) | {"sha256": hashlib.sha256(data).hexdigest()}
    write_atomically(path.with_name(path.name + SIDECAR_SUFFIX), canonical_json(record) + "\n")
    write_atomically(path, data)


def csv_text(frame: pd.DataFrame) -> str:
    """The table as CSV with six decimals; words that look like a formula are made harmless."""
    return str(harmless_frame(frame).to_csv(index=False, float_format="%.6f", lineterminator="\n"))


def harmless_frame(frame: pd.DataFrame) -> pd.DataFrame:
    """The table with words that no spreadsheet takes for a formula."""
    words = {
        name: frame[name].map(lambda value: harmless(value) if isinstance(value, str) else value)
        for name in frame.columns
        if frame[name].dtype.kind not in "fiubM"
    }
    frame = frame.assign(**words) if words else frame
    return frame.rename(columns=lambda name: harmless(name) if isinstance(name, str) else name)


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
