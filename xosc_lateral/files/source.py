"""The one gate through which input files are opened, and the hashes of files.

Only regular files pass (a device or a fifo would be read for ever), only up to a size, and what is stated about a file
afterwards is the hash of the bytes that were parsed: small files are read once into memory and hashed there, large ones
are hashed through the same open file, which must not have changed meanwhile.

Files that passed are remembered while `guarding_inputs` is on: the atomic writer replaces none of them, whatever name
they go by.
"""

from __future__ import annotations

import errno
import hashlib
import io
import os
import stat
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import lru_cache
from logging import getLogger
from pathlib import Path
from typing import IO, Any

from xosc_lateral.base.errors import FormatError, absent, names_beside
from xosc_lateral.base.limits import (
    FILE_SIZE,
    JSON_DEPTH,
    PACKING_RATIO,
    TOML_SIZE,
    UNPACKED_SIZE,
    UNPACKED_UNASKED,
    Limit,
)
from xosc_lateral.files.held import held_bytes

LOG = getLogger(__name__)
IN_MEMORY = 64_000_000  # files up to this are read once and parsed from memory [byte]

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISFIFO, "a fifo"),
    (stat.S_ISSOCK, "a socket"),
)

REMEMBERED = 1000  # hashes of so many files that were parsed are kept; a command states what it has just read
_LAST_READ: dict[str, str] = {}  # path -> SHA-256 of the bytes that were parsed, the oldest first
_GUARDED: ContextVar[set[tuple[int, int]] | None] = ContextVar("inputs", default=None)


@dataclass(eq=False, slots=True)
class Source:
    """An input file that is open."""

    path: Path
    file: IO[bytes]  # at its beginning; readers may seek
    size: int  # [byte]

    def unpacked(self, size: int) -> None:
        """Refuse a packed file that would take all memory, see `limits`; `size`: unpacked so far. [byte]"""
        if size > UNPACKED_SIZE.bytes:
            raise FormatError(UNPACKED_SIZE.refusal(size / 1e6), path=self.path)
        ratio = size / max(self.size, 1)
        if size > UNPACKED_UNASKED.bytes and ratio > PACKING_RATIO.value:
            what = f"{PACKING_RATIO.refusal(ratio)} above {UNPACKED_UNASKED}; it looks like a decompression bomb"
            raise FormatError(what, path=self.path)


@dataclass(frozen=True, slots=True)
class Content:
    """A file's bytes, and their SHA-256."""

    data: bytes
    sha256: str


def read_source(path: Path | str, limit: Limit = FILE_SIZE) -> Content:
    """Bytes of an input file. Raises `FormatError`: see `open_source`."""
    with open_source(path, limit) as source:
        data = source.file.read(limit.bytes + 1)
    if len(data) > limit.bytes:
        raise FormatError(limit.refusal(len(data) / 1e6), path=path)
    return Content(data, last_read(Path(path)))


def read_toml(path: Path, otherwise: str) -> dict[str, Any]:
    """What a file in TOML says. Raises `FormatError`, beginning with `otherwise`, if it is none; see `open_source`."""
    import tomllib

    try:
        text = read_source(path, TOML_SIZE).data.decode("utf-8-sig")
        if any(part.count(".") > JSON_DEPTH.value for part in text.replace(",", "\n").split("\n")):
            raise RecursionError  # a name of so many parts, for which `tomllib` takes the square of their number
        return tomllib.loads(text)
    except (RecursionError, ValueError) as error:  # no UTF-8, no TOML, a number of thousands of digits
        raise FormatError(
            f"{otherwise}: {'it is nested too deeply' if isinstance(error, RecursionError) else error}", path=path
        ) from error


@contextmanager
def open_source(path: Path | str, limit: Limit = FILE_SIZE) -> Iterator[Source]:
    """Open an input file for reading. Raises `FormatError`."""
    path = Path(path)
    if (held := held_bytes(path)) is not None:
        if len(held) > limit.bytes:
            raise FormatError(limit.refusal(len(held) / 1e6), path=path)
        _remember(path, hash_of(held))
        yield Source(path, io.BytesIO(held), len(held))
        return
    with _opened(path) as file:
        before = os.fstat(file.fileno())
        if before.st_size > limit.bytes:
            raise FormatError(limit.refusal(before.st_size / 1e6), path=path)
        _guard(before)
        if before.st_size <= IN_MEMORY:
            data = _part(file, path)
            _remember(path, hash_of(data))
            yield Source(path, io.BytesIO(data), len(data))
            return
        yield Source(path, file, before.st_size)
        with os.fdopen(os.dup(file.fileno()), "rb") as again:
            again.seek(0)
            digest = hashlib.file_digest(again, "sha256").hexdigest()
        after = os.fstat(file.fileno())
        if (after.st_mtime_ns, after.st_size) != (before.st_mtime_ns, before.st_size):
            raise FormatError("changed while it was being read; try again when it is complete", path=path)
        _remember(path, digest)


def last_read(path: Path) -> str:
    """SHA-256 of the bytes that this process parsed under that path last; `KeyError` if it parsed none."""
    return _LAST_READ[str(path)]


def parsed_files() -> Mapping[str, str]:
    """Path -> SHA-256 of what this process parsed last under it."""
    return _LAST_READ


def take_over(path: Path, digest: str) -> None:
    """Count a file as an input of this process that another one parsed for it; `digest`: SHA-256 of what it parsed."""
    _remember(path, digest)
    guard_input(path)


def check_regular(path: Path) -> os.stat_result:
    """State of a regular file. Raises `FormatError`: It is not there, or something else."""
    if (held := held_bytes(path)) is not None:
        return os.stat_result((stat.S_IFREG | 0o444, 0, 0, 1, 0, 0, len(held), 0, 0, 0))
    try:
        state = path.stat()
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        raise _unreadable(error, path) from error
    if not stat.S_ISREG(state.st_mode):
        what = next((name for is_kind, name in _KINDS if is_kind(state.st_mode)), "something else")
        inside = ", ".join(sorted(names_beside(path / "x"))[:3])
        raise FormatError(f"is {what}, not a file{inside and f'; it holds {inside}'}", path=path)
    return state


def state_key(state: os.stat_result) -> tuple[int, ...]:
    """Changes whenever a file is replaced or written to, also by tools that put its time of change back."""
    return state.st_ino, state.st_ctime_ns, state.st_mtime_ns, state.st_size


@contextmanager
def guarding_inputs() -> Iterator[None]:
    """While the block runs, no file that was opened as an input is replaced by an output."""
    token = _GUARDED.set(set())
    try:
        yield
    finally:
        _GUARDED.reset(token)


def guard_input(path: Path) -> None:
    """Count a file as an input that was read earlier, from a cache, say; what is not there needs no guard."""
    if _GUARDED.get() is not None and path.exists():
        _guard(path.stat())


def edit_in_place(path: Path) -> None:
    """Take a file from the guarded ones: the user asked for a change of this very file."""
    guarded = _GUARDED.get()
    if guarded is not None:
        state = path.stat()
        guarded.discard((state.st_dev, state.st_ino))


def refuse_guarded(target: Path) -> None:
    """Refuse to replace an input; links of both kinds are seen through. Raises `FormatError`."""
    guarded = _GUARDED.get()
    if guarded and target.exists():
        state = target.stat()
        if (state.st_dev, state.st_ino) in guarded:
            raise FormatError("is an input; choose another output", path=target)


def _remember(path: Path, digest: str) -> None:
    LOG.info("read %s, sha256 %s", path, digest)
    _LAST_READ.pop(str(path), None)
    _LAST_READ[str(path)] = digest
    if len(_LAST_READ) > REMEMBERED:
        _LAST_READ.pop(next(iter(_LAST_READ)), None)


def _guard(state: os.stat_result) -> None:
    guarded = _GUARDED.get()
    if guarded is not None:
        guarded.add((state.st_dev, state.st_ino))


@contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    check_regular(path)
    try:
        # Non-blocking: between the check and here it may have become a fifo that nobody writes to.
        file = os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)), "rb")
    except OSError as error:
        raise _unreadable(error, path) from error
    with file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise FormatError("is not a file", path=path)
        try:
            yield file
        except OSError as error:
            if error.errno not in (errno.EIO, errno.ESTALE, errno.ENOTCONN, errno.ENODEV):
                raise
            raise _unreadable(error, path) from error


def _part(file: IO[bytes], path: Path) -> bytes:
    """What comes next, one byte more than `IN_MEMORY` at most."""
    data: bytes | None = file.read(IN_MEMORY + 1)
    if data is None:  # files of the kernel's that speak when there is something to say
        raise FormatError("has nothing to read now, and no end", path=path)
    return data


def _unreadable(error: OSError | ValueError, path: Path) -> FormatError:
    what = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    what = absent(path) if isinstance(error, FileNotFoundError) else what
    return FormatError(f"{what[:1].lower()}{what[1:]}", path=path)


def hash_of(data: bytes) -> str:
    """SHA-256 of a file's bytes, in hexadecimal: what provenance and manifests state of inputs and of outputs."""
    return hashlib.sha256(data).hexdigest()


def file_hash(path: Path) -> str:
    """SHA-256 of a file's bytes as they are now; read once per process for as long as it stays the same."""
    return _file_hash(path, state_key(check_regular(path)))


def file_state(path: Path) -> str:
    """Text that is another one whenever the file was replaced or written to since; empty if it is not there."""
    try:
        return " ".join(map(str, state_key(path.stat())))
    except OSError:
        return ""


def parsed_hash(path: Path) -> str:
    """SHA-256 of the bytes that this process parsed, whatever the file is since; a file not parsed is hashed now."""
    if path.is_dir():  # a table in parts
        parts = "".join(parsed_hash(part) for part in sorted(path.rglob("*")) if part.is_file())
        return hashlib.sha256(parts.encode()).hexdigest()
    if (held := held_bytes(path)) is not None:
        return hash_of(held)
    try:
        return last_read(path)
    except KeyError:
        return file_hash(path)


def parsed_hashes(paths: Iterable[Path]) -> dict[str, str]:
    """`parsed_hash` of each file by its name; files of one name by as much of their paths as differs."""
    names = {path: path.name for path in paths}
    for depth in range(2, max((len(path.parts) for path in names), default=0) + 1):
        taken = list(names.values())
        names |= {path: "/".join(path.parts[-depth:]) for path, name in names.items() if taken.count(name) > 1}
    return {name: parsed_hash(path) for path, name in names.items()}


@lru_cache(maxsize=1024)
def _file_hash(path: Path, _state: tuple[int, ...]) -> str:
    digest, size = hashlib.sha256(), 0
    with _opened(path) as file:
        while data := _part(file, path):
            digest.update(data)
            size += len(data)
            if max(size, os.fstat(file.fileno()).st_size) > FILE_SIZE.bytes:
                raise FormatError(FILE_SIZE.refusal(size / 1e6), path=path)
    return digest.hexdigest()


WATCH_TIME = 0.5
"""Between two looks at files that are watched. [s]"""


def changes(paths: Iterable[Path]) -> Iterator[None]:
    """Wait, for ever: yields whenever one of the files is another one than before. One that is gone is waited for."""
    watched = list(paths)

    def states() -> list[str]:
        return [file_state(path) for path in watched]

    before = states()
    while True:
        time.sleep(WATCH_TIME)
        now = states()
        if now != before:
            before = now
            yield
