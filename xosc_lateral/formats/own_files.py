"""Whether a file is one that this package wrote: each format says so in its own place."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from xosc_lateral.formats.hashes import file_hash

SIDECAR_SUFFIX = ".json"
"""Beside ``out.csv`` lies ``out.csv.json``: a comment inside a CSV would stop most readers."""

PACKAGE = b"xosc-lateral"

_HEAD = 65_536
"""The mark of a file of ours stands this near to its beginning. [byte]"""


def is_own(path: Path) -> bool:
    """Whether the provenance in a file, or beside it, says that this package wrote it. An empty file is nobody's."""
    if path.stat().st_size == 0:
        return True
    name = path.name.lower()
    for suffix, check in _CHECKS.items():
        if name.endswith(suffix):
            return check(path)
    return _own_table(path)


def template_mark(text: str) -> str:
    """Comment at the end of a template's file that says whether it was edited since. `text` has none yet."""
    return f"<!-- xosc-lateral template, sha256 {_sha256(text.rstrip().encode())} -->\n"


def _own_xml(path: Path) -> bool:
    if b"xosc-lateral provenance: " in _head(path) or b"[xosc-lateral: " in _head(path):
        return True
    body, _, mark = path.read_bytes().rpartition(b"<!-- xosc-lateral template, sha256 ")
    return bool(body) and mark.startswith(_sha256(body.rstrip()).encode())


def _own_json(path: Path) -> bool:
    try:
        values = json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        return False
    if not isinstance(values, dict):
        return False
    provenance = values.get("provenance", {})
    return bool(isinstance(provenance, dict) and provenance.get("package_version")) or _is_ours(values)


def _own_table(path: Path) -> bool:
    """A table is ours as long as it is what the file beside it says."""
    sidecar = path.with_name(path.name + SIDECAR_SUFFIX)
    try:
        values = json.loads(sidecar.read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(values, dict) and _is_ours(values) and values.get("sha256") == file_hash(path)


def _own_parquet(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 4 * _HEAD))  # Parquet's metadata stand at its end
        return PACKAGE in file.read() or b"xosc_lateral" in _head(path)


def _own_html(path: Path) -> bool:
    return b'content="xosc-lateral ' in _head(path)


def _own_recording(path: Path) -> bool:
    return PACKAGE in _head(path)  # MCAP's header and metadata are not compressed


_CHECKS: dict[str, Callable[[Path], bool]] = {
    ".xosc": _own_xml,
    ".xodr": _own_xml,
    ".json": _own_json,
    ".csv": _own_table,
    ".csv.gz": _own_table,
    ".parquet": _own_parquet,
    ".html": _own_html,
    ".mcap": _own_recording,
}


def _is_ours(values: dict[str, Any]) -> bool:
    return str(values.get("package", "")).startswith("xosc-lateral")


def _head(path: Path) -> bytes:
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
        return file.read(_HEAD)


def _sha256(data: bytes) -> str:
    import hashlib

    return hashlib.sha256(data).hexdigest()
