"""The mark that a file of ours carries: what made it, and from what.

It is for people and for the check that nothing is converted twice. Anybody can write one: no permission depends on it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import IO, Any

from lxml import etree

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.atomic import replace_atomically
from xosc_lateral.files.source import hash_of
from xosc_lateral.files.xml import line_of

MARK = "xosc-lateral provenance: "
HEADER_MARK = "[xosc-lateral: "
CONTENT_HASH_NAME = "content_sha256"
"""In the provenance: SHA-256 of the file without the provenance."""
PENDING_HASH = "0" * 64
"""In its place until it is known."""
_COMMENT_START, _COMMENT_END = f"<!-- {MARK}".encode(), b"-->"


def mark(root: etree._Element, provenance: Mapping[str, Any], summary: str) -> None:
    """Write the provenance as a comment before the file header, and in short into its description."""
    header = root.find("{*}FileHeader")
    text = json.dumps(provenance, sort_keys=True, ensure_ascii=False, default=str)
    text = text.replace("--", "-\\u002d")  # which may not stand in a comment
    comment = etree.Comment(f" {MARK}{text} ")
    comment.tail = root.text  # the white space before the first child
    root.insert(0 if header is None else root.index(header), comment)
    if header is not None:
        description = (header.get("description") or "").rstrip()
        header.set("description", f"{description} {HEADER_MARK}{summary}]".strip())


def provenance_of(root: etree._Element) -> Mapping[str, Any] | None:
    """Provenance of a file of ours; empty if only the header's mark is left; None for anybody else's file."""
    for comment in root.iterchildren(etree.Comment):
        text = (comment.text or "").strip()
        if text.startswith(MARK):
            try:
                facts = json.loads(text[len(MARK) :])
            except (ValueError, RecursionError):
                return {}
            return facts if isinstance(facts, dict) else {}
    header = root.find("{*}FileHeader")
    return {} if header is not None and HEADER_MARK in (header.get("description") or "") else None


def facts_in(data: bytes) -> Mapping[str, Any] | None:
    """Provenance in the bytes of a file of ours, which need not be well-formed any more; None: there is none."""
    begin, end = _comment_in(data)
    try:
        facts = json.loads(data[begin + len(_COMMENT_START) : end - len(_COMMENT_END)]) if begin < end else None
    except (ValueError, RecursionError):
        return None
    return facts if isinstance(facts, dict) else None


def content_hash(data: bytes) -> str:
    """`hash_of` a file of ours without its provenance."""
    return hash_of(without_provenance(data))


def without_provenance(data: bytes) -> bytes:
    """A file of ours without its provenance, which alone may differ where the content is the same."""
    begin, end = _comment_in(data)
    return data[:begin] + data[end:]


def write_sealed(path: Path, pieces: Iterable[bytes], *, save: bool) -> tuple[str, str, bytes]:
    """Write a document with the hash of its content in place of `PENDING_HASH`, which its provenance holds.

    The provenance is in the first piece. SHA-256 of the file and of its content come back, and the file itself where it
    is not to be saved.
    """
    rest = iter(pieces)
    first = next(rest)
    begin, end = _comment_in(first)
    place = first.find(PENDING_HASH.encode(), begin, end)
    digest = hashlib.sha256(first[:begin])
    digest.update(first[end:])

    def sealed() -> Iterator[bytes]:
        yield first
        for piece in rest:
            digest.update(piece)
            yield piece

    def write_to(file: IO[bytes]) -> str:
        file.writelines(sealed())
        if place >= 0:
            file.seek(place)
            file.write(digest.hexdigest().encode())
        file.seek(0)
        return hashlib.file_digest(file, "sha256").hexdigest()  # type: ignore[arg-type]

    if not save:
        memory = BytesIO()
        return write_to(memory), digest.hexdigest(), memory.getvalue()
    lines = []

    def write(temporary: Path) -> None:
        with temporary.open("w+b") as file:
            lines.append(write_to(file))

    replace_atomically(path, write)
    return lines[0], digest.hexdigest(), b""


def _comment_in(data: bytes) -> tuple[int, int]:
    """Where the provenance begins and ends; both at the end where there is none. [byte]"""
    begin = data.find(_COMMENT_START)
    end = data.find(_COMMENT_END, begin) if begin >= 0 else -1
    return (begin, end + len(_COMMENT_END)) if end >= 0 else (len(data), len(data))


def refuse_converted(root: etree._Element, path: object) -> None:
    """`FormatError` for a file that was converted before: its offsets would be counted twice."""
    facts = provenance_of(root)
    if facts is None:
        return
    inputs = facts.get("inputs")
    # Seen from the scenario, which has no folder in its name then; a road or a catalog may lie beside it.
    beside = [name for name in inputs if "/" not in name and name.endswith(".xosc")] if isinstance(inputs, dict) else []
    hint = f"; convert {beside[0]} instead" if len(beside) == 1 else "; convert its source instead"
    header = root.find("{*}FileHeader")
    line = None if header is None else line_of(header)
    raise FormatError(f"was converted by xosc-lateral already{hint}", path=path, line=line, element="FileHeader")
