"""Writing a file so that it is there completely, or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.source import refuse_guarded


def write_atomically(path: Path | str, data: bytes | str, *, durable: bool = False) -> Path:
    """Write bytes or UTF-8 text to a temporary file beside the output, then move it there; missing folders are made.

    Raises `OSError`: Disk full, no permission: the output is as it was, and no temporary file stays behind.

    Parameters
    ----------
    path : path
    data : bytes or str
    durable : bool
        Return only when the disk has it, so that not even a power cut takes it back. On a busy disk that is a tenth of
        a second: for what ten thousand others depend on, not for each of the ten thousand.
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
    with _temporary_beside(path) as temporary:
        write(temporary)
        temporary.replace(path)
    return path


def refuse_outputs(outputs: Iterable[Path | None], inputs: Iterable[Path] = ()) -> None:
    """Refuse outputs that can't be meant, before any work is done and anything is written.

    Raises `FormatError` if an output is a folder, an input (links resolved), or named twice, or its folder can't be
    made or written to.

    Parameters
    ----------
    outputs : iterable of Path or None
        Files to be written; None: not wanted.
    inputs : iterable of Path
        Files that are read.
    """
    folders: dict[Path, str] = {}
    taken = {real_path(path, folders): "is an input; choose another output" for path in inputs}
    writable: set[Path] = set()
    for output in outputs:
        if output is None:
            continue
        if output.is_dir():
            raise FormatError("is a folder, not a file to write to", path=output)
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


@contextmanager
def _temporary_beside(path: Path) -> Iterator[Path]:
    # The suffix stays: some writers (Parquet, CSV.gz) choose the format by it.
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, name = tempfile.mkstemp(prefix=f".{path.stem[:40]}.", suffix=f".tmp{path.suffix}", dir=path.parent)
    os.close(descriptor)
    temporary = Path(name)
    try:
        temporary.chmod(0o666 & ~_umask())  # mkstemp makes it private; outputs are for everybody
        yield temporary
    finally:
        with contextlib.suppress(FileNotFoundError):
            temporary.unlink()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
