"""Mutants of tables that stay tables: columns, types and rows changed, in text and in Parquet."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tests.faults.mutants import HOSTILE_NUMBERS, HOSTILE_WORDS, Rng

Rows = list[list[str]]


def _pick(rng: Rng, choices: Any) -> Any:
    return choices[int(rng.integers(len(choices)))]


# ---- text ------------------------------------------------------------------------------------------------------------
def mutate_rows(rows: Rows, rng: Rng) -> bytes:
    """One to three changes of a table of text; written with another separator now and then."""
    rows = [list(row) for row in rows if row]
    for _ in range(int(rng.integers(1, 4))):
        if len(rows) < 2 or not rows[0]:
            break
        _pick(rng, _ROW_CHANGES)(rows, int(rng.integers(len(rows[0]))), rng)
    comma, end = _pick(rng, (*[(",", "\n")] * 6, (",", "\r\n"), (";", "\n"), ("\t", "\n"), (" ", "\n")))
    quote = rng.random() < 0.1
    text = end.join(comma.join(_cell(cell, comma, quote) for cell in row) for row in rows)
    return text.encode("utf-8-sig" if rng.random() < 0.1 else "utf-8") + end.encode()


def _cell(cell: str, comma: str, quote: bool) -> str:
    needs = quote or any(letter in cell for letter in (comma, '"', "\n"))
    return '"' + cell.replace('"', '""') + '"' if needs else cell


def _cells(rows: Rows, column: int, rng: Rng) -> Iterator[list[str]]:
    """Rows of one stretch, or of all."""
    begin, length = int(rng.integers(1, len(rows))), int(_pick(rng, (1, 5, 100, len(rows))))
    first = 1 if length == len(rows) else begin
    for row in rows[first : first + length]:
        if column < len(row):
            yield row


def _numbers(change: Callable[[float], float]) -> Callable[[Rows, int, Rng], None]:
    def apply(rows: Rows, column: int, rng: Rng) -> None:
        for row in _cells(rows, column, rng):
            try:
                row[column] = repr(change(float(row[column])))
            except (ValueError, OverflowError):
                row[column] = row[column] + "x"

    return apply


def _words(rows: Rows, column: int, rng: Rng) -> None:
    word = _pick(rng, (*HOSTILE_NUMBERS, *HOSTILE_WORDS, "", "", "NA", "1.0", "2.5"))
    for row in _cells(rows, column, rng):
        row[column] = word


def _header(rows: Rows, column: int, rng: Rng) -> None:
    rows[0][column] = _pick(rng, (*rows[0], *HOSTILE_WORDS, rows[0][column].upper(), f" {rows[0][column]} "))


def _lost(rows: Rows, column: int, rng: Rng) -> None:
    for row in rows:
        del row[column : column + 1]


def _twice(rows: Rows, column: int, rng: Rng) -> None:
    for row in rows:
        row.extend(row[column : column + 1])


def _swapped(rows: Rows, column: int, rng: Rng) -> None:
    other = int(rng.integers(len(rows[0])))
    for row in rows[1:]:
        if max(column, other) < len(row):
            row[column], row[other] = row[other], row[column]


def _ragged(rows: Rows, column: int, rng: Rng) -> None:
    row = rows[int(rng.integers(1, len(rows)))]
    row[:] = _pick(rng, ([], row[:-1], [*row, "1"], [*row, *row]))


def _ordered(rows: Rows, column: int, rng: Rng) -> None:
    body = rows[1:]
    match int(rng.integers(5)):
        case 0:
            body.reverse()
        case 1:
            rng.shuffle(body)  # type: ignore[arg-type]
        case 2:
            body += body
        case 3:
            body = body[: int(rng.integers(4))]
        case 4:
            body = body[:1] * len(body)
    rows[1:] = body


_ROW_CHANGES: tuple[Callable[[Rows, int, Rng], None], ...] = (
    _numbers(lambda value: -value),
    _numbers(lambda value: value * 1000.0),
    _numbers(lambda value: value * 1e12),
    _numbers(lambda value: value * 1e-12),
    _numbers(lambda value: value + 1e9),
    _numbers(lambda value: round(value)),
    _numbers(lambda value: value * 0.0),
    *(_words, _words, _header, _header, _lost, _twice, _swapped, _ragged, _ordered),
)


# ---- Parquet ---------------------------------------------------------------------------------------------------------
def mutate_parquet(data: bytes, rng: Rng) -> bytes:
    """Columns of other types, with gaps, twice, without rows, in many row groups."""
    table = pq.read_table(io.BytesIO(data))
    columns = [table.column(name).combine_chunks() for name in table.column_names]
    names = list(table.column_names)
    for _ in range(int(rng.integers(1, 4))):
        k = int(rng.integers(len(names)))
        match int(rng.integers(5)):
            case 0:
                names[k] = _pick(rng, (*names, *HOSTILE_WORDS))
            case 1:
                del names[k], columns[k]
            case 2:
                names.append(_pick(rng, (names[k], f"{names[k]}2")))
                columns.append(columns[k])
            case _:
                columns[k] = _other_type(columns[k], rng)
        if not names:
            break
    changed = pa.Table.from_arrays(columns, names=names)
    if rng.random() < 0.1:
        changed = changed.slice(0, int(rng.integers(3)))
    sink = io.BytesIO()
    keep = {} if rng.random() < 0.5 else {"pandas": _pick(rng, ("{}", "[", '{"index_columns": ["nothing"]}'))}
    pq.write_table(changed.replace_schema_metadata(keep), sink, row_group_size=int(_pick(rng, (7, 100, 100_000))))
    return sink.getvalue()


def _other_type(column: Any, rng: Rng) -> Any:
    n = len(column)
    try:
        values = np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)
    except (TypeError, ValueError):
        values = np.arange(n, dtype=np.float64)
    whole = np.nan_to_num(np.clip(values, -1e9, 1e9)).astype(np.int64)
    gap = rng.random(n) < 0.2
    made: tuple[Callable[[], Any], ...] = (
        lambda: pa.array([str(value) for value in values]),
        lambda: pa.array([_pick(rng, HOSTILE_WORDS) for _ in range(n)]),
        lambda: pa.array([[value] for value in values]),
        lambda: pa.array([{"a": value} for value in values]),
        lambda: pa.array(values, mask=gap),
        lambda: pa.nulls(n),
        lambda: pa.array(whole % 2 == 0),
        lambda: pa.array(whole).cast(pa.timestamp("ns")),
        lambda: pa.array(whole).cast(pa.duration("ms")),
        lambda: pa.array([b"\xff\x00"] * n),
        lambda: pa.array([str(value) for value in whole % 3]).dictionary_encode(),
        lambda: pa.array(whole % 1000).cast(pa.decimal128(22, 3)),
        lambda: pa.array(np.clip(values, -1.0, 1.0).astype(np.float32) * np.float32(1e30)),
        lambda: pa.array(np.where(gap, np.inf, values)),
        lambda: pa.array(np.where(gap, 1e300, values)),
        lambda: pa.array(values[::-1]),
        lambda: pa.array(np.full(n, values[0] if n else 0.0)),
        lambda: pa.array(whole.astype(np.uint64) + np.uint64(2**63)),
    )
    return _pick(rng, made)()


# ---- bus logs --------------------------------------------------------------------------------------------------------
def mutate_mf4(data: bytes, rng: Rng) -> bytes:
    """Channels with other types, units and clocks in a log that is whole."""
    import asammdf

    with asammdf.MDF(io.BytesIO(data)) as old, asammdf.MDF(version=_pick(rng, ("4.00", "4.10", "4.11"))) as new:
        signals = [old.get(name) for name in ("LnLeft", "LnRight", "VehSpd")]
        for signal in (_pick(rng, signals) for _ in range(int(rng.integers(1, 3)))):
            _change_signal(signal, rng)
        groups = [[signal] for signal in signals]
        if rng.random() < 0.2:
            groups.append(groups[0])
        for group in groups[int(rng.integers(8)) == 0 :]:
            new.append(group)
        sink = io.BytesIO()
        new.save(sink, compression=int(rng.integers(3)))
        return sink.getvalue()


def _change_signal(signal: Any, rng: Rng) -> None:
    n = len(signal.samples)
    match int(rng.integers(8)):
        case 0:
            text = np.array([f"{k}" for k in range(n)], dtype="S8")
            odd = (text, np.zeros((n, 3)), np.zeros(n, np.uint8), np.full(n, np.nan), np.full(n, 1e300))
            signal.samples = _pick(rng, odd)
            signal.encoding = "utf-8"
        case 1:
            signal.timestamps = signal.timestamps[::-1].copy()
        case 2:
            signal.timestamps = signal.timestamps * _pick(rng, (-1.0, 0.0, 1e-9, 1e9, 1e15))
        case 3:
            signal.timestamps = signal.timestamps + _pick(rng, (-1e3, 1e4, 1.7e9, 1e15))
        case 4:
            signal.samples, signal.timestamps = (
                values[: int(rng.integers(3))] for values in (signal.samples, signal.timestamps)
            )
        case 5:
            signal.name = _pick(rng, ("LnLeft", "", "漢字", "a" * 300, "VehSpd"))
        case 6:
            signal.unit = _pick(rng, ("", "furlong", "m", "°", "a\x00b"))
        case 7:
            signal.samples = signal.samples * _pick(rng, (-1.0, 1e3, 1e-6, 1e12))
