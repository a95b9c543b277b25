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
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import IO

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.remote import send
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


Staged = Mapping[Path, Path]  # Output and the temporary file that becomes it.
_STAGED: ContextVar[tuple[dict[Path, Path], ExitStack] | None] = ContextVar("staged", default=None)


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
        staged: dict[Path, Path] = {}
        token = _STAGED.set((staged, kept))
        try:
            yield
        finally:
            _STAGED.reset(token)
        first = next(iter(staged), None)
        if first is not None and len(staged) > 1:
            with _naming(first):
                plan = {os.path.relpath(path, first.parent): one.name for path, one in staged.items()}
                kept.enter_context(_temporary_beside(first, _PLAN)).write_text(json.dumps(plan), "utf-8")
        _move(staged)


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
                temporary.replace(path)
            send(path)
            LOG.info("wrote %s", path)
    except BaseException:
        for path, temporary in staged.items():
            with contextlib.suppress(OSError):
                temporary.replace(path)
        raise


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
        with contextlib.suppress(OSError):  # what others may not read stays so
            temporary.chmod(stat.S_IMODE(path.stat().st_mode))
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


LARGEST_RECORD = 10_000_000  # of what one run says to the next: a plan of moves, a lock, a journal's line [byte]


def mend(outputs: Iterable[Path], is_own: Callable[[Path], bool]) -> None:
    """Finish what killed runs were moving to these places, and remove what they had only begun to write.

    What is found may be anybody's: no other file than these outputs is replaced, nor one that is not ours (`is_own`).
    Files of a run that is at work are locked, and stay; so do links, and files of other users.
    """
    begun, wanted = temporary_files(), {Path(os.path.normpath(output.absolute())) for output in outputs}
    stems: dict[Path, set[str]] = {}
    for output in wanted:
        stems.setdefault(output.parent, set()).update((output.stem[:_STEM], output.name[:_STEM]))
    for folder, named in stems.items():
        matches = {path: begun.fullmatch(path.name) for path in folder.glob(".*.tmp*")}
        mine = [path for path, match in matches.items() if match is not None and match[1] in named]
        for path in sorted(mine, key=lambda path: path.suffix != _PLAN):
            with contextlib.suppress(OSError, FormatError), open_own(path, flags=0) as file:
                if sys.platform == "win32" or not lock(file.fileno()):
                    continue
                if path.suffix == _PLAN:
                    with contextlib.suppress(ValueError, AttributeError, TypeError, RecursionError):  # half of a plan
                        _finish(folder, json.loads(file.read(LARGEST_RECORD)), wanted, is_own)
                path.unlink()


def _finish(folder: Path, plan: Mapping[str, str], wanted: Container[Path], is_own: Callable[[Path], bool]) -> None:
    """Move what is left to move; a plan says which temporary file of an output becomes it."""
    for relative, name in plan.items():
        path = Path(os.path.normpath((folder / relative).absolute()))
        match, temporary = temporary_files().fullmatch(name), path.with_name(name)
        if path not in wanted or match is None or match[1] != path.stem[:_STEM] or temporary.is_symlink():
            continue
        if temporary.is_file() and not path.is_symlink() and (not path.exists() or is_own(path)):
            temporary.replace(path)


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
