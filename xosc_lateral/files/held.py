"""Files that a caller holds in memory: for as long as they are held, they lie in a folder that is on no disk.

The folder's name is made from names and bytes, so a path there means the same bytes for ever, and whatever remembers
files by their paths is right about these, too.
"""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from weakref import WeakValueDictionary

_HELD: WeakValueDictionary[str, Held] = WeakValueDictionary()  # name of the folder -> what is in it


class Held:
    """Files in memory. `folder`: that of the scenario; names lead from there, as a scenario says them."""

    def __init__(self, files: Mapping[str, bytes]) -> None:
        names = {name: os.path.normpath(name.replace("\\", "/")).replace(os.sep, "/") for name in files}
        up = max((PurePosixPath(name).parts.count("..") for name in names.values()), default=0)
        digest = hashlib.sha256()
        for name, data in sorted(files.items()):
            digest.update(f"{len(name)} {name} {len(data)} ".encode() + data)
        self.name = f"in-memory-{digest.hexdigest()[:16]}"
        self.folder = Path(os.sep, self.name, *["up"] * up)
        self.files = {Path(os.path.normpath(self.folder / names[name])): data for name, data in files.items()}


def hold(files: Mapping[str, bytes]) -> Held:
    """Hold files until nobody has the result any more."""
    return hold_again(Held(files))


def hold_again(held: Held) -> Held:
    """Hold what another process, or nobody yet, holds."""
    return _HELD.setdefault(held.name, held)


def held_at(path: Path) -> Held | None:
    """What lies in memory where this path leads to."""
    parts = path.parts[1:2]
    return _HELD.get(parts[0]) if parts and path.is_absolute() else None


def held_bytes(path: Path) -> bytes | None:
    """Content of a file in memory; None: there is none of that path."""
    held = held_at(path)
    return None if held is None else held.files.get(path)


def is_file(path: Path) -> bool:
    """Whether there is a file, in memory or on a disk."""
    return held_bytes(path) is not None or _on_disk(Path.is_file, path)


def _on_disk(asked: Callable[[Path], bool], path: Path) -> bool:
    """What a disk says; no file has a name that is too long for one."""
    try:
        return asked(path)
    except OSError as error:
        if error.errno != errno.ENAMETOOLONG:
            raise
        return False


def exists(path: Path) -> bool:
    """Whether there is a file or folder, in memory or on a disk."""
    held = held_at(path)
    return _on_disk(Path.exists, path) if held is None else any(path in (file, *file.parents) for file in held.files)


def glob(folder: Path, pattern: str) -> Iterator[Path]:
    """Paths below a folder, in memory or on a disk, that fit a pattern of one name for each level."""
    held = held_at(folder)
    if held is None:
        yield from folder.glob(pattern)
        return
    levels = pattern.count("/") + 1
    below = (path for path in held.files if folder in path.parents)
    yield from (path for path in below if len(path.relative_to(folder).parts) == levels and path.match(pattern))
