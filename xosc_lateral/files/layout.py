"""How a text file holds its table: what stands before the header, a row of units, comments, and the separator.

Excel begins with ``sep=;``; loggers and their tools (CANape, DIAdem) with lines about the measurement, and have the
units in a row below the header; scripts put ``#`` before what is no data.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import IO, NamedTuple

from xosc_lateral.files.columns import PLAIN, Stated

SEPARATORS = ",;\t"
HEAD_SIZE = 1 << 16  # of the text, in which a header is sought [bytes]
_NUMBER = re.compile(r"\s*\"?[+-]?[.,]?\d")


class Layout(NamedTuple):
    """Of a table in a text."""

    start: int = 0  # place of the header's first byte, the mark of a comment left out
    skipped: tuple[int, ...] = ()  # lines that are no data, counted from the header
    separator: str | None = None  # as the file states it
    units: tuple[str, ...] = ()  # a cell per column, if they stand in a row of their own
    header: int = 1  # its line, counted from 1
    unit_row: int = 0  # likewise, of the units


def layout_of(head: bytes, stated: Stated = PLAIN) -> Layout:
    """Of a table that begins with `head`, in UTF-8; that of a plain one where no other is clear.

    Raises `ValueError`: there is no line as stated.
    """
    separator, lines = stated.separator, head.decode("utf-8-sig", "replace").splitlines(keepends=True)
    shift = 3 if head.startswith(b"\xef\xbb\xbf") else 0
    places = [shift]
    for line in lines:
        places.append(places[-1] + len(line.encode()))
    if len(head) == HEAD_SIZE:
        lines = lines[:-1]  # cut off
    first = 0
    if lines and (named := re.fullmatch(r"\"?sep=(.)\"?\s*", lines[0], re.IGNORECASE)):
        separator, first = separator or named[1], 1
    comments = [k for k, line in enumerate(lines) if k >= first and line.startswith(stated.comment)]
    rows = [k for k, line in enumerate(lines) if k >= first and line.strip() and k not in comments]
    if (last := max(stated.header or 0, stated.units or 0)) > len(lines):
        raise ValueError(f"line {last} is stated to hold headers or units, and there are {len(lines)}")
    if len(rows) < 2:
        return Layout(places[first], (), separator)

    def cells(k: int, mark: str) -> list[str]:
        return [cell.strip().strip('"') for cell in lines[k].rstrip("\r\n").split(mark)]

    def is_data(k: int, mark: str) -> bool:
        return any(_NUMBER.match(cell) for cell in cells(k, mark))

    header, skipped, units = _header_of(rows, cells, is_data, separator)
    if stated.header or stated.units:
        header = stated.header - 1 if stated.header else header
        mark, below = separator or max(SEPARATORS, key=lines[header].count), [k for k in rows if k > header]
        row = stated.units - 1 if stated.units else next((k for k in below[:1] if _units_in(cells(k, mark))), -1)
        units = tuple(cells(row, mark)) if row >= 0 else ()
        skipped = (row - header,) if row > header else ()
    before = [k for k in comments if k < header and not stated.header]
    mark = separator or max(SEPARATORS, key=lines[header].count)
    if before and is_data(header, mark) and len(cells(before[-1], mark)) == len(cells(header, mark)) > 1:
        header = before[-1]  # the header stands in a comment, as numpy writes it
        start = places[header] + len(lines[header]) - len(lines[header].lstrip("# "))
        return Layout(start, tuple(k - header for k in comments if k > header), separator, (), header + 1)
    skipped += tuple(k - header for k in comments if k > header)
    row = next((k for k in rows if k != header and tuple(cells(k, mark)) == units), -1) + 1 if units else 0
    return Layout(places[header] if header else 0, tuple(sorted(skipped)), separator, units, header + 1, row)


def _units_in(cells: list[str]) -> tuple[str, ...]:
    """The cells of a row that names units, else none."""
    from xosc_lateral.files.mapping import spelled

    named = [cell for cell in cells if cell.strip("[]()- ")]
    return tuple(cells) if named and all(spelled(cell) for cell in named) else ()


def late_comments(text: IO[bytes], start: int, mark: str) -> list[int]:
    """Lines beyond the head that begin with the mark of comments, counted from the header at `start`."""
    sought, place, begins = mark.encode(), start, list[int]()
    text.seek(start)
    if not any(b"\n" + sought in b"\n" + part for part in iter(lambda: text.read(1 << 24), b"")):
        return begins
    text.seek(start)
    for number, line in enumerate(text):
        if line.startswith(sought) and place >= HEAD_SIZE:
            begins.append(number)
        place += len(line)
    return begins


def _header_of(
    rows: list[int], cells: Callable[[int, str], list[str]], is_data: Callable[[int, str], bool], separator: str | None
) -> tuple[int, tuple[int, ...], tuple[str, ...]]:
    """Line of the header, lines below it that are no data, and units."""
    for place, k in enumerate(rows[1:], 1):
        for mark in separator or SEPARATORS:
            width = len(cells(k, mark))
            after = rows[place + 1] if place + 1 < len(rows) else k
            if width < 2 or not is_data(k, mark) or len(cells(after, mark)) != width or not is_data(after, mark):
                continue
            block = place
            while block and len(cells(rows[block - 1], mark)) == width and not is_data(rows[block - 1], mark):
                block -= 1
            between = rows[block:place]
            if not between:
                continue
            heads = [k for k in between if len(set(cells(k, mark))) == width and not _units_in(cells(k, mark))]
            units = next((named for row in between if (named := _units_in(cells(row, mark)))), ())
            if heads and (block or len(between) > 1) and (block == 0 or len(cells(rows[block - 1], mark)) != width):
                header = heads[0]
                return header, tuple(row - header for row in between if row > header), units
            return rows[0], (), ()
    return rows[0], (), ()


def with_units(headers: list[str], units: tuple[str, ...]) -> list[str]:
    """Headers with the units of the row below, where these are named."""
    if len(units) != len(headers):
        return headers
    bare = [unit.strip("[]() ") for unit in units]
    return [f"{name} [{unit}]" if unit and unit != "-" else name for name, unit in zip(headers, bare, strict=True)]
