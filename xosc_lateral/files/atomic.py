"""Writing a file so that it is there completely, or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

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

    Raises `OSError`: Disk full, no permission: the output is as it was, and no temporary file stays behind.

    `durable`: return only when the disk has it, so that not even a power cut takes it back. On a busy disk that is a
    tenth of a second: for what ten thousand others depend on, not for each of the ten thousand.
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
    """Let `write` fill a temporary file beside the output, then move it there: for writers that want a path.

    Raises `FormatError`: The output is a file that was opened as an input (`source.guarding_inputs`); `OSError`: As for
    `write_atomically`.
    """
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
