"""Where outputs go, and what may be written over.

A path that ends in a slash, or is a folder, means a file of the usual name in it. The suffix decides the format. A file
that this package did not write stays, unless the user says otherwise.
"""

from __future__ import annotations

import gzip
import json
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.atomic import refuse_targets
from xosc_lateral.formats.hashes import file_hash

STDOUT = "-"
"""Name of the standard output where an output is asked for."""

SIDECAR_SUFFIX = ".json"
"""Beside ``out.csv`` lies ``out.csv.json``: a comment inside a CSV would stop most readers."""

PACKAGE = b"xosc-lateral"

_HEAD = 65_536
"""The mark of a file of ours stands this near to its beginning. [byte]"""


def file_target(output: str | Path, usual_name: str, suffixes: Sequence[str]) -> Path:
    """Path of an output file.

    Parameters
    ----------
    output : str or Path
        As the user gave it. Ends in a slash, or is a folder: `usual_name` in that folder.
    usual_name : str
        File name in a folder.
    suffixes : sequence of str
        Formats that can be written, lower case with their dot.

    Raises
    ------
    FormatError
        For another suffix.
    """
    path = folder_target(output) / usual_name if is_folder(output) else Path(output)
    if not path.name.lower().endswith(tuple(suffixes)):
        kind = path.suffix or "a file without suffix"
        raise FormatError(f"can't write {kind}: expected a name ending in {' or '.join(suffixes)}", path=path)
    return path


def is_folder(output: str | Path) -> bool:
    """Whether an output means a folder: it is one, or ends in a slash."""
    text = str(output)
    return text.endswith(("/", os.sep)) or Path(output).is_dir()


def folder_target(output: str | Path) -> Path:
    """Path of an output folder, which need not be there yet.

    Raises
    ------
    FormatError
        If a file is there.
    """
    path = Path(output)
    if path.is_file():
        raise FormatError("is a file, expected a folder", path=path)
    return path


def claim(targets: Iterable[Path | None], inputs: Iterable[Path] = (), *, force: bool = False) -> None:
    """Refuse outputs that can't be meant, or that would replace somebody else's file, before any work is done.

    Parameters
    ----------
    targets : iterable of Path or None
        Files to be written; None: not wanted.
    inputs : iterable of Path
        Files that are read.
    force : bool
        Replace whatever is there, apart from inputs.

    Raises
    ------
    FormatError
        See `refuse_targets`; or a target is there that this package did not write.
    """
    wanted = [target for target in targets if target is not None]
    refuse_targets(wanted, inputs)
    for target in wanted:
        if not force and target.exists() and not is_own(target):
            raise FormatError("exists and was not written by xosc-lateral; --force replaces it", path=target)


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
    """Comment at the end of a template's file that tells whether it was edited since. `text` has none yet."""
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


_CHECKS: dict[str, Callable[[Path], bool]] = {
    ".xosc": _own_xml,
    ".xodr": _own_xml,
    ".json": _own_json,
    ".csv": _own_table,
    ".csv.gz": _own_table,
    ".parquet": _own_parquet,
    ".html": _own_html,
}


def _is_ours(values: dict[str, Any]) -> bool:
    return str(values.get("package", "")).startswith("xosc-lateral")


def _head(path: Path) -> bytes:
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
        return file.read(_HEAD)


def _sha256(data: bytes) -> str:
    import hashlib

    return hashlib.sha256(data).hexdigest()
