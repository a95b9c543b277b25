"""Where outputs go, and what may be written over.

A path that ends in a slash, or is a folder, means a file of the usual name in it. The suffix decides the format. A file
that this package did not write stays, unless the user says otherwise.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.atomic import mend
from xosc_lateral.files.remote import brought
from xosc_lateral.files.source import check_regular, file_hash

STDOUT = "-"  # name of the standard output where an output is asked for
LONGEST_NAME = 255  # of a file, on all common systems [byte]


def file_name(name: str, what: str) -> str:
    """A name that others gave, as the name of a file: the one gate to paths. `what`: whose it is, for the message."""
    wrong = name in ("", ".", "..") or any(sign in "/\\" or sign < " " for sign in name)
    if wrong or len(name.encode(errors="replace")) > LONGEST_NAME:
        raise FormatError(f"{what} {name[:60]!r}: expected the name of a file, without a folder")
    return name


def path_below(folder: Path, name: str, what: str) -> Path:
    """A path below a folder from names that others gave, with slashes. Raises `FormatError`: it leads elsewhere."""
    return folder.joinpath(*(file_name(part, what) for part in name.split("/")))


def output_file(output: str | Path, usual_name: str, suffixes: Sequence[str]) -> Path:
    """Path of an output file, which in a folder has its usual name. Raises `FormatError` for another suffix."""
    output = brought(output)
    path = output_folder(output) / file_name(usual_name, "name") if is_folder(output) else Path(output)
    if not path.name.lower().endswith(tuple(suffixes)):
        kind = path.suffix or "a file without suffix"
        raise FormatError(f"can't write {kind}: expected a name ending in {' or '.join(suffixes)}", path=path)
    return path


def is_folder(output: str | Path) -> bool:
    """Whether an output means a folder: it is one, or ends in a slash."""
    text = str(output)
    return text.endswith(("/", os.sep)) or Path(output).is_dir()


def output_folder(output: str | Path) -> Path:
    """Path of an output folder, which need not be there yet. Raises `FormatError` if a file is there."""
    path = Path(brought(output))
    if path.is_file():
        raise FormatError("is a file, expected a folder", path=path)
    return path


def claim(outputs: Iterable[Path | None], inputs: Iterable[Path] = (), *, force: bool = False) -> None:
    """Refuse outputs as `refuse_outputs` does, and, without `force`, files that this package did not write.

    What killed runs have left of these outputs is mended before.
    """
    wanted = [output for output in outputs if output is not None]
    refuse_outputs(wanted, inputs)
    mend(wanted, is_own)
    for output in wanted:
        if not force and output.exists() and not is_own(output):
            raise FormatError("exists and was not written by xosc-lateral; --force replaces it", path=output)


def refuse_outputs(outputs: Iterable[Path | None], inputs: Iterable[Path] = ()) -> None:
    """Refuse outputs before any work: folders, inputs (links resolved), what is named twice or can't be written."""
    folders: dict[Path, str] = {}
    taken = {real_path(path, folders): "is an input; choose another output" for path in inputs}
    writable: set[Path] = set()
    for output in outputs:
        if output is None:
            continue
        if output.is_dir():
            raise FormatError("is a folder, not a file to write to", path=output)
        if output.exists():
            check_regular(output)
        real = real_path(output, folders)
        if (why := taken.get(real)) is not None:
            raise FormatError(why, path=output)
        taken[real] = "is named for two outputs"
        if output.parent in writable:
            continue
        parent = next(folder for folder in output.absolute().parents if folder.exists())
        if not parent.is_dir():
            raise FormatError(f"can't be written: {parent} is a file, not a folder", path=output)
        if not os.access(parent, os.W_OK | os.X_OK):
            raise FormatError(f"can't be written: no permission to write to {parent}", path=output)
        writable.add(output.parent)


def real_path(path: Path, folders: dict[Path, str]) -> str:
    """Path with links followed; `folders` remembers those of folders, for many files are in the same few."""
    folder = path.parent
    if path.is_symlink() or path.name in ("", ".."):
        return os.path.realpath(path)
    if folder not in folders:
        folders[folder] = os.path.realpath(folder)
    return f"{folders[folder].rstrip(os.sep)}{os.sep}{path.name}"


def numbered(path: Path, variant_index: int, variants: int) -> Path:
    """Path of one variant: as it is when there is one alone, else with its number, from 1, before the suffix."""
    if variants == 1:
        return path
    digits = max(2, len(str(variants)))
    return path.with_name(f"{path.stem}_{variant_index + 1:0{digits}d}{path.suffix}")


def label_files(output: Path) -> tuple[Path, Path]:
    """Where tags and quality result of an output go: beside it."""
    return output.with_suffix(".openlabel.json"), output.with_suffix(".xqar")


# ---- whether a file is one that this package wrote: each format says so in its own place
SIDECAR_SUFFIX = ".json"  # beside ``out.csv`` lies ``out.csv.json``: a comment inside a CSV would stop most readers
PACKAGE = b"xosc-lateral"
MARKDOWN_MARK, SVG_MARK = "<!-- made by xosc-lateral -->", "<metadata>xosc-lateral</metadata>"
_HEAD = 65_536  # the mark of a file of ours stands this near to its beginning [byte]


def is_own(path: Path) -> bool:
    """Whether the provenance in a file, or beside it, says that this package wrote it. An empty file is nobody's."""
    if path.stat().st_size == 0:
        return True
    name = path.name.lower()
    check = next((check for suffix, check in _CHECKS.items() if name.endswith(suffix)), _own_table)
    return check(path)


def template_mark(text: str, begin: str = "<!-- ", end: str = " -->") -> str:
    """Comment, a line, at the end of a template's file that says whether it was edited since. `text` has none yet."""
    return f"{begin}{_SEAL}{hashlib.sha256(text.rstrip().encode()).hexdigest()}{end}\n"


_SEAL = "xosc-lateral template, sha256 "


def _as_written(path: Path) -> bool:
    text, _, mark = path.read_bytes().rpartition(_SEAL.encode())
    body, line, _ = text.rpartition(b"\n")
    return bool(line) and mark.startswith(hashlib.sha256(body.rstrip()).hexdigest().encode())


def _own_xml(path: Path) -> bool:
    return any(mark in _head(path) for mark in (b"xosc-lateral provenance: ", b"[xosc-lateral: ")) or _as_written(path)


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


def _own_at_end(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 4 * _HEAD))  # Parquet's metadata and a zip file's comment stand there
        return PACKAGE in file.read() or b"xosc_lateral" in _head(path)


# of other tables than Parquet the file beside them says so
_CHECKS: dict[str, Callable[[Path], bool]] = {
    ".xosc": _own_xml,
    ".xodr": _own_xml,
    ".json": _own_json,
    ".parquet": _own_at_end,
    ".fmu": _own_at_end,
    ".c": _as_written,
    ".h": _as_written,
    "cmakelists.txt": _as_written,
    ".html": lambda path: b'content="xosc-lateral ' in _head(path),
    ".xqar": lambda path: b'name="xosc-lateral"' in _head(path),
    ".md": lambda path: MARKDOWN_MARK.encode() in _head(path),
    ".svg": lambda path: SVG_MARK.encode() in _head(path),
    ".png": lambda path: PACKAGE in _head(path),
    ".gif": lambda path: PACKAGE in _head(path),
    ".mcap": lambda path: PACKAGE in _head(path),  # its header and metadata are not compressed
}


def _is_ours(values: dict[str, Any]) -> bool:
    tags = values.get("openlabel")
    metadata = tags.get("metadata") if isinstance(tags, dict) else None
    package = metadata.get("annotator", "") if isinstance(metadata, dict) else values.get("package", "")
    return str(package).startswith("xosc-lateral")


def _head(path: Path) -> bytes:
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
        return file.read(_HEAD)
