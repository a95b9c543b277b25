"""`manifest.parquet`: one row per output, with all that went into it and what came out.

The manifest holds nothing that changes from run to run: same inputs, settings and seed, same bytes, whether the run
was disturbed or not and on however many workers. What each conversion took is in `timings.parquet` beside it,
therefore the only file of an output tree that is never twice the same.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pa, parquet
from xosc_lateral.base.limits import BATCH_JOBS, SMALL_PARSER_MEMORY
from xosc_lateral.base.process import address_space
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.source import check_regular
from xosc_lateral.files.tables import foreign_errors

MANIFEST, TIMINGS = "manifest.parquet", "timings.parquet"

ROW_GROUP = 1000
"""Rows held in memory while writing."""

SCHEMA = 2
"""Version of a manifest's columns."""

_MAXIMUM_INTEGER = 2**63 - 1

_OLD_NAMES = {
    "scenario_hash": "scenario_sha256",
    "output_hash": "output_sha256",
    "road_hash": "road_sha256",
    "profile_hashes": "profile_sha256",
}
"""What columns were called in manifests of version 0.1."""


@dataclass(frozen=True, slots=True)
class ManifestRow:
    """One output, or why there is none; `output` names it. The page of pipelines describes the columns.

    Paths are with forward slashes, below the folder of outputs or the common one of inputs; distances in [m], times in
    [s]. Rows without a `schema` are of version 1, whose variants count from 0.
    """

    output: str
    scenario: str
    scenario_sha256: str
    variant: int
    seed: int
    profile: str
    parameters: Mapping[str, str]
    settings: str
    package_version: str
    with_sensor: bool = False
    output_sha256: str = ""
    road: str = ""
    road_sha256: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)
    profiles: Mapping[str, str] = field(default_factory=dict)
    profile_sha256: Mapping[str, str] = field(default_factory=dict)
    entities: int = 0
    enriched: tuple[str, ...] = ()
    why_not: Mapping[str, str] = field(default_factory=dict)
    segment_seconds: float = 0.0
    offset_spread: float = 0.0
    gap_before: float | None = None
    gap_after: float | None = None
    trial_contacts: int = 0
    warnings: tuple[str, ...] = ()
    player: str = "standard"
    version: str = ""
    mode: str = ""
    modes: Mapping[str, str] = field(default_factory=dict)
    only: tuple[str, ...] | None = None
    ego: tuple[str, ...] = ()
    behaviour: int = 1
    options: Mapping[str, Any] = field(default_factory=dict)
    content_sha256: str = ""
    cut_off: bool = False
    error: str = ""
    stale: bool = False
    schema: int = SCHEMA

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        values: dict[str, Any] = msgspec.to_builtins(self)
        return values

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> ManifestRow:
        """What `to_dict` gave; `ValueError` for another name, or a value that is missing or of the wrong kind."""
        if not isinstance(values, Mapping):
            raise ValueError(f"a row is a {type(values).__name__}")
        named = {_OLD_NAMES.get(name, name): value for name, value in values.items()}
        if (version := named.setdefault("schema", 1)) not in range(1, SCHEMA + 1):
            raise ValueError(f"its columns are of version {version}, this program reads up to {SCHEMA}")
        if foreign := sorted(map(str, named.keys() - {item.name for item in fields(cls)})):
            raise ValueError(f"{foreign[0][:60]!r} is in no row of this program")
        row = msgspec.convert(named, cls)
        if any(isinstance(value, int) and abs(value) > _MAXIMUM_INTEGER for value in named.values()):
            raise ValueError("a number has more than 64 bits")
        # no text or number that can't be written
        json.dumps(row.to_dict(), ensure_ascii=False, allow_nan=False).encode()
        return row if row.schema == SCHEMA else replace(row, variant=row.variant + 1, schema=SCHEMA)


def printable(text: str) -> str:
    """Text that can be written as UTF-8: bytes of a file name that are none appear as ``\\udcff``."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


_MAPPINGS = ("parameters", "inputs", "profiles", "profile_sha256", "why_not", "modes", "options")
"""JSON text in the file: every reader takes it."""


def manifest_schema() -> pa.Schema:
    """Columns of `manifest.parquet`."""
    types: dict[str, pa.DataType] = dict.fromkeys(("stale", "with_sensor", "cut_off"), pa.bool_())
    types |= dict.fromkeys(("variant", "seed", "entities", "trial_contacts", "behaviour", "schema"), pa.int64())
    types |= dict.fromkeys(("segment_seconds", "offset_spread", "gap_before", "gap_after"), pa.float64())
    types |= dict.fromkeys(("enriched", "warnings", "only", "ego"), pa.list_(pa.string()))
    return pa.schema([(item.name, types.get(item.name, pa.string())) for item in fields(ManifestRow)])


def write_manifest(rows: Iterable[ManifestRow], path: Path) -> None:
    """Write rows in the order given, `ROW_GROUP` at a time; a file that would not change is left alone."""
    _write_table(path, manifest_schema(), map(_packed, rows))


def read_manifest(path: Path) -> Iterator[ManifestRow]:
    """Rows of a manifest; none if there is no file. Raises `FormatError`: it is no manifest."""
    for values in _read_table(path):
        try:
            unpacked = {name: json.loads(values[name]) for name in _MAPPINGS if values.get(name) is not None}
            yield ManifestRow.from_dict(values | unpacked)
        except (TypeError, ValueError, RecursionError) as error:
            raise FormatError(f"not a manifest of this package: {error}", path=path) from error


class Timing(NamedTuple):
    """What an output took [s], and its `file_state` as it was written; empty: not known."""

    seconds: float = 0.0
    state: str = ""

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Timing:
        """Of a row or a journal's line. Raises `ValueError`, `KeyError`, `TypeError`: it is none."""
        seconds = float(values["seconds"])
        if not math.isfinite(seconds):
            raise ValueError(f"{seconds} s")
        return cls(seconds, str(values.get("state", "")))


def is_of_now(path: Path) -> bool:
    """Whether a manifest has the columns that would be written now."""
    return bool(parquet.read_schema(path).equals(manifest_schema()))


def write_timings(timings: Iterable[tuple[str, Timing]], path: Path) -> None:
    """Write columns `output`, `seconds`, `state`."""
    schema = pa.schema([("output", pa.string()), ("seconds", pa.float64()), ("state", pa.string())])
    _write_table(path, schema, ({"output": output, **own._asdict()} for output, own in timings))


def read_timings(path: Path) -> dict[str, Timing]:
    """Timing of each output; empty if there is no file. Raises `FormatError`: it is no such file."""
    try:
        return {str(values["output"]): Timing.of(values) for values in _read_table(path)}
    except (TypeError, ValueError, KeyError) as error:
        raise FormatError(f"not a timings file of this package: {error}", path=path) from error


def _packed(row: ManifestRow) -> dict[str, Any]:
    values = {name: printable(value) if isinstance(value, str) else value for name, value in row.to_dict().items()}
    return values | {name: json.dumps(values[name], sort_keys=True, ensure_ascii=False) for name in _MAPPINGS}


def _write_table(path: Path, schema: pa.Schema, rows: Iterator[dict[str, Any]]) -> None:
    buffer = BytesIO()
    with parquet.ParquetWriter(buffer, schema, compression="zstd") as writer:
        while group := list(islice(rows, ROW_GROUP)):
            writer.write_table(pa.Table.from_pylist(group, schema=schema))
    data = buffer.getvalue()
    if not path.exists() or path.read_bytes() != data:
        write_atomically(path, data, durable=True)


def _read_table(path: Path) -> Iterator[dict[str, Any]]:
    if not path.exists():
        return
    check_regular(path)
    with foreign_errors(path, "can't be read as Parquet"), parquet.ParquetFile(path) as file:
        if file.metadata.num_rows > BATCH_JOBS.value:
            raise FormatError(BATCH_JOBS.refusal(file.metadata.num_rows), path=path)
        batches = (batch.to_pylist() for batch in file.iter_batches(ROW_GROUP))
        following = address_space(SMALL_PARSER_MEMORY.value)(next)
        while (rows := following(batches, None)) is not None:
            yield from rows
