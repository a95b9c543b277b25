"""Tables of the laboratory in documents, between two markers."""

from __future__ import annotations

import re
from pathlib import Path

from xosc_lateral.files.atomic import write_atomically


def write_between_markers(path: Path, text: str, marker: str) -> None:
    """Put the table into a document, between its two markers."""
    begin, end = f"<!-- {marker}: begin -->", f"<!-- {marker}: end -->"
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    document = path.read_text(encoding="utf-8")
    if not pattern.search(document):
        raise SystemExit(f"{path}: no markers {begin} ... {end}")
    write_atomically(path, pattern.sub(lambda _: f"{begin}\n{text}\n{end}", document))


def show(text: str, page: Path | None, marker: str) -> None:
    """Print a table, and put it into a page where one is named."""
    print(text)
    if page is not None:
        write_between_markers(page, text, marker)
