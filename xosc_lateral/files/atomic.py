"""Writing files so that they are there completely, or not at all: one, or all of an output (`together`)."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import secrets
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
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


def temporary_files(runs: Iterable[str] = ()) -> re.Pattern[str]:
    """Names that temporary files of these runs have, or of any; its first group is how the output's name begins."""
    return re.compile(rf"\.(.+)\.(?:{'|'.join(map(re.escape, runs)) or '[^.]+'})-[0-9a-z_]{{8}}\.tmp(?:\.\w+)?")


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
    """Let `write` fill a temporary file beside the output, then move it there; an input (`guarding_inputs`) stays.

    Within `together` it is moved when that ends.
    """
    path = Path(path)
    refuse_guarded(path)
    with ExitStack() as alone, _naming(path):
        staged, kept = _STAGED.get() or ({}, alone)
        temporary = kept.enter_context(_temporary_beside(path, path.suffix))
        write(temporary)
        staged[path] = temporary
        if kept is alone:
            _move(staged)
    return path


Staged = Mapping[Path, Path | None]  # Output and the temporary file that becomes it; None: it is removed.
_STAGED: ContextVar[tuple[dict[Path, Path | None], ExitStack] | None] = ContextVar("staged", default=None)


@contextmanager
def together() -> Iterator[None]:
    """Files that are written in the block appear when it ends, all of them, and none where it fails.

    A file beside the first of them says what is being moved where, for as long as it takes: of a run that is killed
    meanwhile, the next one moves the rest (`mend`). A block within another one is part of it.
    """
    if _STAGED.get() is not None:
        yield
        return
    with ExitStack() as kept:
        staged: dict[Path, Path | None] = {}
        token = _STAGED.set((staged, kept))
        try:
            yield
        finally:
            _STAGED.reset(token)
        first = next(iter(staged), None)
        if first is not None and len(staged) > 1:
            with _naming(first):
                plan = {os.path.relpath(path, first.parent): one and one.name for path, one in staged.items()}
                kept.enter_context(_temporary_beside(first, _PLAN)).write_text(json.dumps(plan), "utf-8")
        _move(staged)


def remove_together(path: Path) -> None:
    """Within `together`, a file beside its outputs goes when they appear."""
    staged = _STAGED.get()
    assert staged is not None
    staged[0][path] = None


@contextmanager
def at_once() -> Iterator[None]:
    """Files that are written in the block appear one by one, also within `together`: others' code reads its own."""
    token = _STAGED.set(None)
    try:
        yield
    finally:
        _STAGED.reset(token)


def _move(staged: Staged) -> None:
    """Move temporary files to their places; once begun, it is gone through with."""
    try:
        for path, temporary in staged.items():
            with _naming(path):
                _put(path, temporary)
            LOG.info("wrote %s" if temporary else "removed %s", path)
    except BaseException:
        for path, temporary in staged.items():
            with contextlib.suppress(OSError):
                _put(path, temporary)
        raise


def _put(path: Path, temporary: Path | None) -> None:
    if temporary is None:
        path.unlink(missing_ok=True)
    else:
        temporary.replace(path)


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:  # of a full disk, say: libraries name no file, or one that nobody knows
        raise OSError(error.errno or errno.EIO, error.strerror or str(error), str(path)) from error


_PLAN = ".moves"  # suffix of what says which temporary files are moved where
_STEM = 40  # characters of an output's name that its temporary file begins with


@contextmanager
def _temporary_beside(path: Path, suffix: str) -> Iterator[Path]:
    # The suffix stays: some writers (Parquet, CSV.gz) choose the format by it. It is locked for as long as it is used.
    made = [folder for folder in path.parents if not folder.exists()]
    path.parent.mkdir(parents=True, exist_ok=True)
    name = f".{path.stem[:_STEM]}.{_RUN.get() or os.getpid()}-{secrets.token_hex(4)}.tmp{suffix}"
    temporary = path.with_name(name)
    descriptor = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_CLOEXEC", 0), 0o666)
    try:
        if sys.platform != "win32":  # where a lock keeps the writer itself out
            with contextlib.suppress(OSError):
                lock(descriptor)
        yield temporary
    finally:
        os.close(descriptor)
        with contextlib.suppress(FileNotFoundError):
            temporary.unlink()
        with contextlib.suppress(OSError):  # where nothing came of it
            for folder in made:
                folder.rmdir()


def lock(descriptor: int) -> bool:
    """Take the lock of an open file without waiting, which ends with the process; False: somebody else has it."""
    try:
        if sys.platform == "win32":
            import msvcrt

            os.lseek(descriptor, 4096, os.SEEK_SET)  # beyond what is written there, which others must be able to read
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    return True


def mend(outputs: Iterable[Path]) -> None:
    """Finish what killed runs were moving to these places, and remove what they had only begun to write.

    Files of a run that is at work are locked, and stay; so do links, and files of other users.
    """
    begun = temporary_files()
    stems: dict[Path, set[str]] = {}
    for output in outputs:
        stems.setdefault(output.parent, set()).update((output.stem[:_STEM], output.name[:_STEM]))
    for folder, wanted in stems.items():
        matches = {path: begun.fullmatch(path.name) for path in folder.glob(".*.tmp*")}
        mine = [path for path, match in matches.items() if match is not None and match[1] in wanted]
        for path in sorted(mine, key=lambda path: path.suffix != _PLAN):
            with contextlib.suppress(OSError, FormatError), open_own(path, flags=0) as file:
                if sys.platform == "win32" or not lock(file.fileno()):
                    continue
                if path.suffix == _PLAN:
                    with contextlib.suppress(
                        ValueError, AttributeError, TypeError
                    ):  # half of a plan: nothing was moved
                        _finish(folder, json.loads(file.read()), begun)
                path.unlink()


def _finish(folder: Path, plan: Mapping[str, str | None], begun: re.Pattern[str]) -> None:
    """Move what is left to move; a plan says which temporary file of an output becomes it, or what beside it goes."""
    for relative, name in plan.items():
        path = folder / relative
        if name is None:
            if path == folder / path.name and path.is_file() and not path.is_symlink():
                path.unlink()
            continue
        match = begun.fullmatch(name)
        if match and match[1] == path.stem[:_STEM] and (path.parent / name).is_file():
            (path.parent / name).replace(path)


_PLAIN = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
_LINKS = (errno.ELOOP, errno.EMLINK, errno.ENOTDIR)  # what systems answer where ``O_NOFOLLOW`` meets a link
_LINK = "is a link, which is not followed here: remove it"


def open_own(path: Path, flags: int = os.O_CREAT) -> IO[bytes]:
    """Open a file for reading and writing, made if it is not there; links and files of others are refused."""
    if not hasattr(os, "O_DIRECTORY"):  # Windows: links need a privilege there
        return os.fdopen(os.open(path, os.O_RDWR | flags | _PLAIN), "r+b")
    here = path.parent
    try:
        folder = os.open(here, os.O_RDONLY | os.O_DIRECTORY | _PLAIN)
        try:
            here = path
            descriptor = os.open(path.name, os.O_RDWR | flags | _PLAIN, 0o666, dir_fd=folder)
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
