"""Tables of sampled offsets: CSV with a provenance file beside it, or Parquet with it inside."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral import __version__
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.snippets import Sampled
from xosc_lateral.errors import FormatError
from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.hashes import file_hash
from xosc_lateral.formats.profiles import canonical_json, profile_hash

METADATA_KEY = b"xosc-lateral"
"""Key of the provenance in a Parquet file's schema metadata."""

SIDECAR_SUFFIX = ".json"
"""Beside ``out.csv`` lies ``out.csv.json``: a comment inside a CSV would stop most readers."""

DECIMALS = 6
"""Of times and offsets in a CSV: micrometres."""


def sampling_provenance(
    profile: DriverProfile, seed: int, inputs: Iterable[Path] = (), **settings: Any
) -> dict[str, Any]:
    """What a table of sampled offsets is made of: seed, profile and its hash, package version, input hashes."""
    return {
        "seed": seed,
        "profile": profile.name,
        "profile_sha256": profile_hash(profile),
        "package": f"xosc-lateral {__version__}",
        "inputs": {path.name: file_hash(path) for path in inputs},
        **settings,
    }


def write_offsets(sampled: Iterable[Sampled], path: Path, provenance: Mapping[str, Any], *, snippets: bool) -> int:
    """Write sampled offsets; the same samples give the same bytes.

    Parameters
    ----------
    sampled : iterable of Sampled
    path : Path
        ``.csv`` or ``.parquet``.
    provenance : mapping
        See `sampling_provenance`.
    snippets : bool
        Columns ``drive, snippet, time, offset, offset_real``; else ``drive, time, offset``.

    Returns
    -------
    int
        Rows written.

    Raises
    ------
    FormatError
        For another suffix.
    """
    columns = _columns(list(sampled), snippets=snippets)
    suffix = path.suffix.lower()
    if suffix == ".parquet":
        write_atomically(path, _parquet(columns, provenance))
    elif suffix == ".csv":
        write_atomically(path.with_name(path.name + SIDECAR_SUFFIX), canonical_json(provenance) + "\n")
        write_atomically(path, _csv(columns))
    else:
        raise FormatError(f"can't write {suffix or 'a file without suffix'}: expected .csv or .parquet", path=path)
    return len(columns["time"])


def _columns(sampled: list[Sampled], *, snippets: bool) -> dict[str, Any]:
    lengths = [len(item.time) for item in sampled]
    columns: dict[str, Any] = {"drive": [item.drive for item in sampled for _ in range(len(item.time))]}
    if snippets:
        columns["snippet"] = np.repeat(np.array([item.snippet for item in sampled], dtype=np.int64), lengths)
    columns["time"] = np.concatenate([item.time for item in sampled])
    columns["offset"] = np.concatenate([item.offset for item in sampled])
    if snippets:
        columns["offset_real"] = np.concatenate([item.offset_real for item in sampled if item.offset_real is not None])
    return columns


def _parquet(columns: Mapping[str, Any], provenance: Mapping[str, Any]) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table(dict(columns)).replace_schema_metadata({METADATA_KEY: canonical_json(provenance).encode()})
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    return buffer.getvalue()


def _csv(columns: Mapping[str, Any]) -> bytes:
    import pandas as pd

    text = pd.DataFrame(dict(columns)).to_csv(index=False, float_format=f"%.{DECIMALS}f", lineterminator="\n")
    return text.encode("utf-8")
