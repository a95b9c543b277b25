"""Tables from strangers: CSV, CSV.gz and Parquet as data frames, within `limits`; context over time."""

from __future__ import annotations

import codecs
import gzip
import io
import json
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError, XoscLateralError, meant_for
from xosc_lateral.base.grouping import grouped
from xosc_lateral.base.lazy import pa, parquet, pd
from xosc_lateral.base.limits import TABLE_CELLS, TABLE_COLUMNS, TIME
from xosc_lateral.base.texts import composed
from xosc_lateral.drivers.model.plausibility import first_implausible, implausible
from xosc_lateral.files.apart import apart
from xosc_lateral.files.columns import PLAIN, Stated, plain_cells
from xosc_lateral.files.layout import HEAD_SIZE, Layout, late_comments, layout_of, with_units
from xosc_lateral.files.source import Source, open_source, parsed_hash

if TYPE_CHECKING:
    from xosc_lateral.files.mapping import TableMapping

PARQUET = ".parquet"
FEATHER = (".feather", ".arrow")
ARROW = (PARQUET, *FEATHER)
MOST_LINES = 500  # of a text, that show whether ids begin with 0
ID_HEADER = re.compile("(id|vin|drive|vehicle|trip|track|session|ride|case)$")
TEXT_SUFFIXES = (".csv", ".csv.gz", ".csv.zst")
LONGEST_MESSAGE = 300  # of what a library says about a file; some quote half of it
TABLE_SUFFIXES = (".csv", ".csv.gz", PARQUET, ".csv.zst", *FEATHER)
_CHUNK = 1 << 20
PART_ROWS = 500_000  # of a text are in memory as cells [-]

_DOUBLE = 8


def read_table(path: Path, mapping: TableMapping | None = None) -> pd.DataFrame:
    """Read a CSV (packed or not), Parquet or Feather file, or a folder of Parquet, as it is; a mapping may say how text
    is written. Raises `FormatError`.
    """
    if path.is_dir():
        return _parts(path)
    if not path.name.lower().endswith(TABLE_SUFFIXES):
        raise FormatError(
            f"not a drive table: expected a name ending in {', '.join(TABLE_SUFFIXES)}{meant_for(path)}", path=path
        )
    if mapping is None:
        return _read(path, low_memory=False)
    return _read(path, mapping.encoding, mapping.layout, decimal=mapping.decimal, low_memory=False)


def read_text_table(path: Path) -> pd.DataFrame:
    """A table with all cells as text, missing ones empty. Raises `FormatError`: see `read_table`."""
    table = _read(path, dtype=str, keep_default_na=False)
    return as_text(table) if path.name.lower().endswith(ARROW) else table


def _read(path: Path, encoding: str | None = None, stated: Stated = PLAIN, **csv: Any) -> pd.DataFrame:
    if path.name.lower().endswith(ARROW):
        with foreign_errors(path, "can't be read as a table"):
            table = frame_of(read_arrow(path).to_pandas(split_blocks=True, self_destruct=True))
            if not table.columns.is_unique:
                twice = str(table.columns[table.columns.duplicated()][0])
                raise FormatError(f"column {twice!r} appears twice", path=path)
            return table.rename(columns=composed)
    with open_source(path) as source, foreign_errors(path, "can't be read as a table"):
        text = _in_utf8(unpacked_text(source), path, encoding)
        layout, skipped = Layout(), list[int]()
        if "dtype" not in csv:
            head = text.read(HEAD_SIZE)
            layout = layout_of(head, stated)
            skipped += layout.skipped
            skipped += late_comments(text, layout.start, stated.comment) if len(head) == HEAD_SIZE else []
        text.seek(layout.start)
        separator = layout.separator or _separator(text, path, layout.start)
        csv |= {"skiprows": skipped} if skipped else {}
        if "dtype" not in csv:
            csv["dtype"] = _texts_of_digits(head[layout.start :], separator)
        table = _in_parts(text, layout.start, sep=separator, encoding="utf-8-sig", index_col=False, **csv)
        table = table.drop(  # what a separator at the end of each line makes
            columns=[name for name in table.columns if str(name).startswith("Unnamed: ") and table[name].isna().all()]
        )
        table.columns = with_units(list(map(str, table.columns)), layout.units)
        return table.rename(columns=composed)


def _texts_of_digits(head: bytes, separator: str) -> dict[str, type[str]]:
    """Columns of ids such as 007, which are no numbers, by the file's beginning."""
    lines = head.decode("utf-8-sig", "replace").splitlines()[:MOST_LINES]
    names, *rows = ([cell.strip(' "') for cell in line.split(separator)] for line in lines or [""])
    ids = (k for k, name in enumerate(names) if ID_HEADER.search(name.lower()))
    return {names[k]: str for k in ids if any(re.fullmatch(r"0\d+", row[k]) for row in rows if len(row) > k)}


def _in_parts(text: IO[bytes], start: int, **csv: Any) -> pd.DataFrame:
    """The table, in little more memory than its numbers take: read in parts, as whole where these differ in kind."""
    parts = pd.read_csv(text, chunksize=PART_ROWS, **csv)
    columns = grouped((name, part[name].copy()) for part in parts for name in part.columns)  # the parts themselves go
    if not columns or any(len({one.dtype.kind in "iuf" or one.dtype for one in each}) > 1 for each in columns.values()):
        text.seek(start)
        whole: pd.DataFrame = pd.read_csv(text, **csv)
        return whole
    return pd.DataFrame({name: pd.concat(columns.pop(name), ignore_index=True) for name in list(columns)}, copy=False)


def tables_at(path: Path) -> list[Path]:
    """The table of a path; of a folder, itself where it holds Parquet files, its parts, else all that are in it."""
    if not path.is_dir() or any(path.rglob(f"*{PARQUET}")):
        return [path]
    return sorted(one for one in path.iterdir() if one.name.lower().endswith(TABLE_SUFFIXES)) or [path]


def _parts(folder: Path) -> pd.DataFrame:
    """The table whose parts are the Parquet files of a folder, whose names of folders (``drive=7``) are columns."""
    files = sorted(folder.rglob(f"*{PARQUET}"))
    if not files:
        raise FormatError(f"holds no table ({', '.join(TABLE_SUFFIXES)})", path=folder)
    parts = []
    for file in files:
        keys = (part.partition("=") for part in file.relative_to(folder).parts[:-1])
        parts.append(_read(file).assign(**{name: value for name, sign, value in keys if sign}))
    return pd.concat(parts, ignore_index=True)


def as_text(table: pd.DataFrame) -> pd.DataFrame:
    """The table with all cells as text, missing ones empty."""

    def text(value: object) -> str:
        is_nan = isinstance(value, float) and value != value
        if value is None or is_nan or type(value).__name__ in ("NAType", "NaTType"):
            return ""
        return json.dumps(value) if isinstance(value, dict | list) else str(value)

    return pd.DataFrame({str(name): [text(value) for value in table[name]] for name in table.columns})


@contextmanager
def foreign_errors(path: Path, what: str) -> Iterator[None]:
    """Whatever a library raises about a file becomes one line that names the file."""
    try:
        yield
    except XoscLateralError:
        raise
    except MemoryError as error:
        raise FormatError(f"{what}: not enough memory to read it", path=path) from error
    except Exception as error:  # readers of binary formats raise anything, damaged bytes being what they are
        raise FormatError(f"{what}: {_plain_reason(error)}", path=path) from error


_FIELDS = re.compile(r"Expected (\d+) fields in line (\d+), saw (\d+)")
_OPEN_QUOTE = re.compile(r"EOF inside string starting at row (\d+)")
_READERS = {"pandas", "pyarrow", "gzip", "zlib"}  # whose own texts say nothing to a reader of ours


def _plain_reason(error: Exception) -> str:
    """What a library says about a file, in words that need no knowledge of the library."""
    reason = " ".join(str(error).split())[:LONGEST_MESSAGE]
    if match := _FIELDS.search(reason):
        return f"line {match[2]} has {match[3]} cells, the head has {match[1]}"
    if match := _OPEN_QUOTE.search(reason):
        return f"a quotation mark in line {int(match[1]) + 1} is not closed"
    if type(error).__module__.partition(".")[0] in _READERS or isinstance(error, EOFError):
        return "it is empty, damaged, or laid out otherwise"
    if isinstance(error, LookupError | TypeError | AttributeError | ArithmeticError) and not isinstance(
        error, UnicodeError
    ):
        return f"it is empty, damaged, or laid out otherwise ({type(error).__name__}: {reason})"
    return reason or type(error).__name__


def unpacked_text(source: Source) -> IO[bytes]:
    """The file, unpacked within `limits` if it is gzip (by its first bytes, whatever its name)."""
    magic = source.file.read(4)
    source.file.seek(0)
    is_zstd = magic == ZSTD
    if magic[:2] != b"\x1f\x8b" and not is_zstd:
        return source.file
    unpacked = io.BytesIO()
    with _zstd(source.file) if is_zstd else gzip.GzipFile(fileobj=source.file) as file:
        while chunk := file.read(_CHUNK):
            unpacked.write(chunk)
            source.unpacked(unpacked.tell())
    unpacked.seek(0)
    return unpacked


ZSTD = b"\x28\xb5\x2f\xfd"


def _zstd(file: IO[bytes]) -> Any:
    return pa.CompressedInputStream(pa.PythonFile(file, mode="r"), "zstd")


def frame_of(table: Any) -> pd.DataFrame:
    """Whatever holds columns as a data frame: Arrow's stream or pandas' interchange protocol, lazy frames of dask and
    polars, a dict of arrays; times in the index become a column. Raises `TypeError`.
    """
    if not isinstance(table, pd.DataFrame):
        for lazy in ("compute", "collect"):
            table = getattr(table, lazy)() if hasattr(table, lazy) and not isinstance(table, dict) else table
    if isinstance(table, dict) and not all(np.isscalar(each) for each in table.values()):
        table = pd.DataFrame(table)
    elif not isinstance(table, pd.DataFrame) and hasattr(table, "__arrow_c_stream__"):
        table = pa.table(table).to_pandas()
    elif not isinstance(table, pd.DataFrame) and hasattr(table, "__dataframe__"):
        table = pd.api.interchange.from_dataframe(table)
    if not isinstance(table, pd.DataFrame):
        raise TypeError(f"no table: {type(table).__name__}; a path, a data frame or a dict of columns is read")
    if "time" not in table.columns and isinstance(table.index, pd.DatetimeIndex | pd.TimedeltaIndex):
        return table.reset_index(names="time")
    return table


def text_layout(path: Path, mapping: TableMapping) -> tuple[str, Layout] | None:
    """Encoding and layout that `read_table` takes a text file to have; None of a table that is no text."""
    if path.is_dir() or not path.name.lower().endswith(TEXT_SUFFIXES):
        return None
    with open_source(path) as source, foreign_errors(path, "can't be read as a table"):
        packed = unpacked_text(source)
        code = mapping.encoding or _encoding(packed)
        text = _in_utf8(packed, path, code)
        layout = layout_of(text.read(HEAD_SIZE), mapping.layout)
        text.seek(layout.start)
        return code, layout._replace(separator=layout.separator or _separator(text, path, layout.start))


def _encoding(text: IO[bytes]) -> str:
    """UTF-8 where all of it is; else UTF-16 by its first bytes, else Windows' for Western Europe."""
    utf16 = text.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    text.seek(0)
    decoder = codecs.getincrementaldecoder("utf-8")()
    try:
        while not utf16 and (chunk := text.read(_CHUNK)):
            decoder.decode(chunk)
        decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        return "cp1252"
    finally:
        text.seek(0)
    return "utf-16" if utf16 else "utf-8"


def _in_utf8(text: IO[bytes], path: Path, encoding: str | None = None) -> IO[bytes]:
    """The text in UTF-8. Raises `FormatError`: it is not in the encoding that is given or found."""
    code = encoding or _encoding(text)
    if code.lower().replace("_", "-") in ("utf-8", "utf8", "utf-8-sig"):
        return text
    try:
        return io.BytesIO(text.read().decode(code).encode())
    except (UnicodeDecodeError, LookupError) as error:
        what = f'not in UTF-8 nor in {code}: {error}; `encoding = "..."` in the file of --mapping names it'
        raise FormatError(what, path=path) from error


_SHARED = re.compile(r"\b(dictionary<|\w+_view\b|run_end_encoded<|\w+_union<)")  # types whose cells may be one cell


@apart
def read_arrow(path: Path, columns: Sequence[str] | None = None, otherwise: str = "") -> Any:
    """A Parquet or Feather file, or some columns of it, as an Arrow table.

    Raises `FormatError`: it is none, or beyond `limits`; `otherwise`: what it is not where it lacks a column.
    """
    import pyarrow.feather as feather

    with open_source(path) as source, foreign_errors(path, "can't be read as a table"):
        if path.name.lower().endswith(FEATHER):
            return _of_cells(feather.read_table(source.file, columns, memory_map=False), source)
        file = parquet.ParquetFile(source.file)
        about, known = file.metadata, file.schema_arrow.names
        if missing := [name for name in columns or () if name not in known]:
            raise FormatError(f"no column {missing[0]!r}: {otherwise}", path=path)
        groups = range(about.num_row_groups)
        source.unpacked(max(0, sum(about.row_group(group).total_byte_size for group in groups)))
        _refuse_size(about.num_rows, about.num_columns, source)
        return _of_cells(file.read(None if columns is None else list(columns)), source)


def _refuse_size(rows: int, columns: int, source: Source) -> None:
    if columns > TABLE_COLUMNS.value:
        raise FormatError(TABLE_COLUMNS.refusal(columns), path=source.path)
    if rows * columns > TABLE_CELLS.value:
        raise FormatError(TABLE_CELLS.refusal(rows * columns), path=source.path)
    source.unpacked(rows * columns * _DOUBLE)  # a thousand million equal values take a few bytes in the file


def _of_cells(table: Any, source: Source) -> Any:
    """An Arrow table, if it is within limits with a cell of its own for every code: texts in a file are there once."""
    _refuse_size(table.num_rows, table.num_columns, source)
    table.validate(full=True)
    size = 0
    for name, column in zip(table.column_names, table.columns, strict=True):
        cells = column.cast(column.type.value_type) if str(column.type)[:11] == "dictionary<" else column
        if _SHARED.search(str(cells.type)):
            raise FormatError("cells of this kind are not read", path=source.path, element=f"column {name!r}")
        size += cells.nbytes
    source.unpacked(size)
    return table


def _separator(text: IO[bytes], path: Path, start: int = 0) -> str:
    """Comma, semicolon or tab: the commonest in the header."""
    header, first = (text.readline(_CHUNK).decode("utf-8", errors="replace").rstrip("\r\n") for _ in range(2))
    text.seek(start)
    separator = max(",;\t", key=header.count)
    if header.count(separator) >= TABLE_COLUMNS.value:
        raise FormatError(TABLE_COLUMNS.refusal(header.count(separator) + 1), path=path, line=1)
    if separator == "," and '"' not in first and first.rstrip(",").count(",") > header.count(","):
        what = f"{first.count(',') + 1} values under {header.count(',') + 1} headers"
        advice = "if numbers have a decimal comma, separate them by semicolons or tabs"
        raise FormatError(f"{what}; {advice}", path=path, line=2)
    return separator


class ContextTable(dict[str, tuple[FloatArray, FloatArray]]):
    """Context over time: name -> (time, values), shape (n,) each."""

    sha256: str = ""  # of the file's bytes


def read_context(path: Path) -> ContextTable:
    """Read a table with a `time` column [s from scenario start], increasing, and context columns, all of them numbers.

    NaN values are left out row by row: between what is stated, values are interpolated.
    """
    context = context_of_table(read_table(path), path)
    context.sha256 = parsed_hash(path)
    return context


def context_of_table(table: pd.DataFrame, path: Path) -> ContextTable:
    """The same of a table that is read; `path`: what errors call it."""
    if "time" not in table:
        raise FormatError("no column 'time'", path=path)
    if table["time"].dtype.kind not in "fiu":
        raise FormatError("times have to be numbers", path=path, element="column 'time'")
    time = table["time"].to_numpy(dtype=np.float64)
    if len(time) and np.abs(time[[0, -1]]).max() > TIME.value:
        raise FormatError(TIME.refusal(float(np.abs(time[[0, -1]]).max())), path=path, element="column 'time'")
    if len(time) == 0 or not np.isfinite(time).all() or (np.diff(time) <= 0).any():
        raise FormatError("times have to increase from row to row", path=path, element="column 'time'")
    context = ContextTable()
    for name in map(str, table.columns.drop("time")):
        values = _context_values(table[name], name, time, path)
        known = np.isfinite(values)
        if known.any():
            context[name] = (time[known], values[known])
    if not context:
        raise FormatError("no column with values besides 'time'", path=path)
    return context


def _context_values(column: pd.Series, name: str, time: FloatArray, path: Path) -> FloatArray:
    """A column's numbers, shape (n,) [own unit]; NaN: not stated."""
    if column.dtype.kind not in "fiub":
        column = plain_cells(column)
        row = int(np.argmin(pd.to_numeric(column.astype("string"), errors="coerce").notna() | column.isna()))
        cell = f"{str(column.iloc[row])!r} at {time[row]:g} s"
        what = f"{cell} is not a number; leave the column out if it is no context"
        raise FormatError(what, path=path, element=f"column {name!r}")
    values = column.to_numpy(dtype=np.float64)
    if (endless := np.flatnonzero(np.isinf(values))).size:
        what = f"{values[endless[0]]} at {time[endless[0]]:g} s is not finite"
        raise FormatError(what, path=path, element=f"column {name!r}")
    if (wrong := first_implausible(name, values)) is not None:
        what = f"{implausible(name, float(values[wrong]))} at {time[wrong]:g} s"
        raise FormatError(what, path=path, element=f"column {name!r}")
    return values
