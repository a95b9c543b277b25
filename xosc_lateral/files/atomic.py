"""Writing a file so that it is there completely, or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import stat
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import IO

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.source import LOG, refuse_guarded

_RUN: ContextVar[str] = ContextVar("run", default="")


@contextmanager
def files_of_run(run: str) -> Iterator[None]:
    """While the block runs, temporary files carry this id: what a kill leaves is told from what others are writing."""
    token = _RUN.set(run)
    try:
        yield
    finally:
        _RUN.reset(token)


def temporary_files(runs: Iterable[str]) -> re.Pattern[str]:
    """Names that temporary files of these runs have."""
    return re.compile(rf"\..+\.(?:{'|'.join(map(re.escape, runs))})-[0-9a-z_]{{8}}\.tmp(?:\.\w+)?")


def write_atomically(path: Path | str, data: bytes | str, *, durable: bool = False) -> Path:
    """Write bytes or UTF-8 text to a temporary file beside the output, then move it there; missing folders are made.

    A full disk (`OSError`) leaves the output as it was. `durable`: return only when the disk has it, so that not even a
    power cut takes it back: a tenth of a second on a busy disk, for what ten thousand others depend on.
    """
    content = data.encode() if isinstance(data, str) else data

    def write(temporary: Path) -> None:
        with temporary.open("wb") as file:
            file.write(content)
            if durable:
                file.flush()
                os.fsync(file.fileno())

    return replace_atomically(path, write)


def replace_atomically(path: Path | str, write: Callable[[Path], object]) -> Path:
    """Let `write` fill a temporary file beside the output, then move it there; an input (`guarding_inputs`) stays."""
    path = Path(path)
    refuse_guarded(path)
    try:
        with _temporary_beside(path) as temporary:
            write(temporary)
            temporary.replace(path)
    except OSError as error:  # of a full disk, say: libraries name no file, or one that nobody knows
        raise OSError(error.errno or errno.EIO, error.strerror or str(error), str(path)) from error
    LOG.info("wrote %s", path)
    return path


@contextmanager
def _temporary_beside(path: Path) -> Iterator[Path]:
    # The suffix stays: some writers (Parquet, CSV.gz) choose the format by it.
    path.parent.mkdir(parents=True, exist_ok=True)
    prefix = f".{path.stem[:40]}.{_RUN.get() or os.getpid()}-"
    descriptor, name = tempfile.mkstemp(prefix=prefix, suffix=f".tmp{path.suffix}", dir=path.parent)
    os.close(descriptor)
    temporary = Path(name)
    mask = os.umask(0)
    os.umask(mask)
    try:
        temporary.chmod(0o666 & ~mask)  # mkstemp makes it private; outputs are for everybody
        yield temporary
    finally:
        with contextlib.suppress(FileNotFoundError):
            temporary.unlink()


_PLAIN = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
_LINKS = (errno.ELOOP, errno.EMLINK, errno.ENOTDIR)  # what systems answer where ``O_NOFOLLOW`` meets a link
_LINK = "is a link, which is not followed here: remove it"


def open_own(path: Path) -> IO[bytes]:
    """Open a file for reading and writing, made if it is not there; links and files of others are refused."""
    if not hasattr(os, "O_DIRECTORY"):  # Windows: links need a privilege there
        return os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | _PLAIN), "r+b")
    here = path.parent
    try:
        folder = os.open(here, os.O_RDONLY | os.O_DIRECTORY | _PLAIN)
        try:
            here = path
            descriptor = os.open(path.name, os.O_RDWR | os.O_CREAT | _PLAIN, 0o666, dir_fd=folder)
        finally:
            os.close(folder)
    except OSError as error:
        if error.errno in _LINKS:
            raise FormatError(_LINK, path=here) from error
        error.filename = str(here)
        raise
    state = os.fstat(descriptor)
    why = ""
    if not stat.S_ISREG(state.st_mode):
        why = "is no file"
    elif state.st_nlink > 1:
        why = "has another name elsewhere (a hard link)"
    elif state.st_uid != os.geteuid() and state.st_uid != _owner_of_new_files(path.parent):
        why = f"belongs to another user ({state.st_uid})"
    if why:
        os.close(descriptor)
        raise FormatError(f"{why}, and is left alone: remove it", path=path)
    return os.fdopen(descriptor, "r+b")


def _owner_of_new_files(folder: Path) -> int:
    """Some network folders give all files to one user."""
    with tempfile.TemporaryFile(dir=folder) as file:
        return os.fstat(file.fileno()).st_uid


def make_own_folder(folder: Path, depth: int) -> None:
    """Make a folder that is so many levels below the one that the user named; links on the way are refused."""
    for place in (folder, *folder.parents)[:depth]:
        if place.is_symlink():
            raise FormatError(_LINK, path=place)
    folder.mkdir(parents=True, exist_ok=True)
