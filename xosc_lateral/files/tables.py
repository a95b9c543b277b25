"""Tables from strangers: CSV, CSV.gz and Parquet as data frames, within `limits`, and the texts in their cells."""

from __future__ import annotations

import codecs
import gzip
import io
import json
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError, XoscLateralError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.limits import TABLE_CELLS, TABLE_COLUMNS
from xosc_lateral.base.texts import composed
from xosc_lateral.files.clock import seconds_of_stamps
from xosc_lateral.files.hashes import parsed_hash
from xosc_lateral.files.source import Source, open_source

if TYPE_CHECKING:
    from xosc_lateral.files.mapping import TableMapping

_COMMA_NUMBER = r"\s*[+-]?(?:\d{1,3}(?:\.\d{3})+|\d*)(?:,\d+)?(?:[eE][+-]?\d+)?\s*"


def plain_cells(column: pd.Series) -> pd.Series:
    """The column with lists, records and bytes, which Parquet has, as text: then a cell can be compared and named."""
    if column.dtype != object:
        return column
    strange = column.map(lambda cell: isinstance(cell, list | dict | tuple | bytes | np.ndarray))
    return column.mask(strange, column[strange].map(str)) if strange.any() else column


def comma_numbers(column: pd.Series) -> pd.Series | None:
    """Numbers such as ``3,75`` or ``1.234,5``; None if a value is no such number or none has a comma."""
    known = column.dropna().astype(str)
    if known.empty or not known.str.contains(",", regex=False).any() or not known.str.fullmatch(_COMMA_NUMBER).all():
        return None
    plain = known.str.replace(".", "", regex=False).str.replace(",", ".", regex=False)
    return pd.to_numeric(plain, errors="coerce").reindex(column.index)


def listed(columns: Iterable[object]) -> str:
    """The first twenty names, and how many more there are."""
    names = [str(name) for name in columns]
    return ", ".join(names[:20]) + (f" and {len(names) - 20} more" if len(names) > 20 else "")


def numbers_of(column: pd.Series, path: Path, name: str) -> FloatArray:
    """Numbers, also with decimal commas, and of `time` seconds, shape (n,); NaN where a cell is empty.

    Raises `FormatError` for a cell that is no number.
    """
    is_text = not pd.api.types.is_numeric_dtype(column)
    if is_text and name == "time" and (seconds := seconds_of_stamps(column, path)) is not None:
        return seconds
    if pd.api.types.is_datetime64_any_dtype(column):
        return np.array((column - column.min()).dt.total_seconds(), dtype=np.float64)
    numbers = pd.to_numeric(column, errors="coerce")
    if is_text and numbers.isna().any():
        commas = comma_numbers(column)
        numbers = numbers if commas is None else commas
    strange = numbers.isna() & column.notna()
    if strange.any():
        row = int(np.flatnonzero(strange)[0])
        what = "is neither a number nor a time" if name == "time" else "is not a number"
        raise FormatError(f"{column.iloc[row]!r} {what}", path=path, line=row + 2, element=f"column {name!r}")
    return np.array(numbers.to_numpy(dtype=np.float64, na_value=np.nan))


def indicators(name: str, column: pd.Series, drives: pd.Series | None, most: int) -> dict[str, FloatArray]:
    """A text column as one column ``name=value`` of 0 and 1 per value.

    Empty if it has more than `most` values, or changes in no drive: then it is a label, not a context.
    """
    codes, values = column.factorize()
    if not 2 <= len(values) <= most:
        return {}
    if drives is not None:
        by_drive = pd.Series(codes).groupby(drives.to_numpy())
        if not (by_drive.max() > by_drive.min()).any():
            return {}
    return {f"{name}={value}": (codes == k).astype(np.float64) for k, value in enumerate(values)}


PARQUET = ".parquet"
TABLE_SUFFIXES = (".csv", ".csv.gz", PARQUET)

LONGEST_MESSAGE = 300
"""Of what a library says about a file; some quote half of it."""

_CHUNK = 1 << 20

_DOUBLE = 8


def read_table(path: Path, mapping: TableMapping | None = None) -> tuple[pd.DataFrame, str]:
    """Read a CSV, CSV.gz or Parquet file as it is; a mapping may say how text is written.

    Raises `FormatError` when it isn't one, or is beyond the limits.

    Returns DataFrame, str: the table, and the SHA-256 of the bytes that it was parsed from.
    """
    name = path.name.lower()
    if not name.endswith(TABLE_SUFFIXES):
        raise FormatError(f"not a drive table: expected a name ending in {', '.join(TABLE_SUFFIXES)}", path=path)
    if mapping is None:
        table = _read(path, low_memory=False)
    else:
        table = _read(path, mapping.encoding, mapping.separator, decimal=mapping.decimal, low_memory=False)
    return table, parsed_hash(path)


def read_text_table(path: Path) -> pd.DataFrame:
    """A table with all cells as text, missing ones empty. Raises `FormatError`: see `read_table`."""
    table = _read(path, dtype=str, keep_default_na=False)
    return as_text(table) if path.name.lower().endswith(PARQUET) else table


def _read(path: Path, encoding: str | None = None, separator: str | None = None, **csv: Any) -> pd.DataFrame:
    with open_source(path) as source, foreign_errors(path, "can't be read as a table"):
        if path.name.lower().endswith(PARQUET):
            return _read_parquet(source).rename(columns=composed)
        text = _in_utf8(unpacked_text(source), path, encoding)
        separator = separator or _separator(text, path)
        table: pd.DataFrame = pd.read_csv(text, sep=separator, encoding="utf-8-sig", index_col=False, **csv)
        return table.rename(columns=composed)


def as_text(table: pd.DataFrame) -> pd.DataFrame:
    """The table with all cells as text, missing ones empty."""
    return pd.DataFrame({str(name): [_as_text(value) for value in table[name]] for name in table.columns})


@contextmanager
def foreign_errors(path: Path, what: str) -> Iterator[None]:
    """Whatever a library raises about a file becomes one line that names the file.

    Raises `FormatError` in place of anything that is no error of ours.
    """
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
    """The file, unpacked if it is gzip (by its first bytes, whatever its name).

    Raises `FormatError`: It unpacks to more than `limits` allow.
    """
    packed = source.file.read(2) == b"\x1f\x8b"
    source.file.seek(0)
    if not packed:
        return source.file
    unpacked = io.BytesIO()
    with gzip.GzipFile(fileobj=source.file) as file:
        while chunk := file.read(_CHUNK):
            unpacked.write(chunk)
            source.unpacked(unpacked.tell())
    unpacked.seek(0)
    return unpacked


def text_encoding(path: Path) -> str:
    """Encoding of a text file: UTF-8, or what `read_table` takes it for."""
    with open_source(path) as source:
        return "utf-8" if path.name.lower().endswith(".parquet") else _encoding(unpacked_text(source))


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
    given = encoding or _encoding(text)
    if given.lower().replace("_", "-") in ("utf-8", "utf8", "utf-8-sig"):
        return text
    try:
        return io.BytesIO(text.read().decode(given).encode())
    except (UnicodeDecodeError, LookupError) as error:
        what = f'not in UTF-8 nor in {given}: {error}; `encoding = "..."` in the file of --mapping names it'
        raise FormatError(what, path=path) from error


def _read_parquet(source: Source) -> pd.DataFrame:
    import pyarrow.parquet as pq

    with pq.ParquetFile(source.file) as file:
        about = file.metadata
        groups = range(about.num_row_groups)
        source.unpacked(max(0, sum(about.row_group(group).total_byte_size for group in groups)))
        rows, columns = about.num_rows, about.num_columns
        if columns > TABLE_COLUMNS.value:
            raise FormatError(TABLE_COLUMNS.refusal(columns), path=source.path)
        if rows * columns > TABLE_CELLS.value:
            raise FormatError(TABLE_CELLS.refusal(rows * columns), path=source.path)
        source.unpacked(rows * columns * _DOUBLE)  # a thousand million equal values take a few bytes in the file
        table: pd.DataFrame = file.read().to_pandas()
    if not table.columns.is_unique:
        twice = str(table.columns[table.columns.duplicated()][0])
        raise FormatError(f"column {twice!r} appears twice", path=source.path)
    return table


def _separator(text: IO[bytes], path: Path) -> str:
    """Comma, semicolon or tab: the commonest in the header."""
    header, first = (text.readline(_CHUNK).decode("utf-8", errors="replace").rstrip("\r\n") for _ in range(2))
    text.seek(0)
    separator = max(",;\t", key=header.count)
    if header.count(separator) >= TABLE_COLUMNS.value:
        raise FormatError(TABLE_COLUMNS.refusal(header.count(separator) + 1), path=path, line=1)
    if separator == "," and '"' not in first and first.rstrip(",").count(",") > header.count(","):
        what = f"{first.count(',') + 1} values under {header.count(',') + 1} headers"
        advice = "if numbers have a decimal comma, separate them by semicolons or tabs"
        raise FormatError(f"{what}; {advice}", path=path, line=2)
    return separator


def _as_text(value: object) -> str:
    if value is None or type(value).__name__ in ("NAType", "NaTType") or (isinstance(value, float) and value != value):
        return ""
    return json.dumps(value) if isinstance(value, dict | list) else str(value)
