"""SHA-256 of files: of what lies on the disk now, and of what was parsed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

from xosc_lateral.files.source import check_regular, last_read, state_key


def file_hash(path: Path) -> str:
    """Hexadecimal SHA-256 of a file's bytes as they are now; read once per process for as long as it stays the same.

    Raises `OSError` when it can't be read; `FormatError` when it is not there, or no regular file.
    """
    return _file_hash(path, state_key(check_regular(path)))


def file_state(path: Path) -> str:
    """Text that is another one whenever the file was replaced or written to since; empty if it is not there."""
    try:
        return " ".join(map(str, state_key(path.stat())))
    except OSError:
        return ""


def parsed_hash(path: Path) -> str:
    """Hexadecimal SHA-256 of the bytes that this process parsed, whatever has become of the file since.

    What an output states about its inputs. A file that was not parsed is hashed now.
    """
    try:
        return last_read(path)
    except KeyError:
        return file_hash(path)


def parsed_hashes(paths: Iterable[Path]) -> dict[str, str]:
    """`parsed_hash` of each file by its name; files of one name by as much of their paths as differs."""
    names = {path: path.name for path in paths}
    for depth in range(2, max((len(path.parts) for path in names), default=0) + 1):
        given = list(names.values())
        names |= {path: "/".join(path.parts[-depth:]) for path, name in names.items() if given.count(name) > 1}
    return {name: parsed_hash(path) for path, name in names.items()}


@lru_cache(maxsize=1024)
def _file_hash(path: Path, _state: tuple[int, ...]) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
