"""One run per output folder: a lock that dies with its process, and says whose it is."""

from __future__ import annotations

import json
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from xosc_lateral.errors import XoscLateralError


class FolderInUseError(XoscLateralError):
    """Another run writes into the folder."""


@contextmanager
def folder_lock(path: Path) -> Iterator[None]:
    """Hold a lock file while the block runs.

    The operating system's lock counts, not the file: it goes with the process, however that ends, so a file that a
    killed run has left is no obstacle. What the file says (process and host) is for the message.

    Raises
    ------
    FolderInUseError
        When another process holds it.
    OSError
        When the folder can't be written.
    """
    file = _open_locked(path)
    try:
        file.seek(0)
        file.truncate()
        json.dump({"pid": os.getpid(), "host": socket.gethostname()}, file)
        file.flush()
        yield
    finally:
        path.unlink(missing_ok=True)  # while still locked: who waits for it finds that it is gone and makes a new one
        file.close()


def _open_locked(path: Path) -> IO[str]:
    while True:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            file = path.open("a+", encoding="utf-8")
        except FileNotFoundError:
            continue  # a run that just ended has taken the folder away again
        if not _lock(file):
            holder = _holder(file)
            file.close()
            raise FolderInUseError(
                f"{path.parent.parent}: another run ({holder}) is writing into this folder; wait for it, or use another"
            )
        try:
            if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file
        except FileNotFoundError:
            pass
        file.close()  # its owner has removed it between our opening and locking it


def _holder(file: IO[str]) -> str:
    file.seek(0)
    try:
        values = json.loads(file.read())
        return f"process {values['pid']} on {values['host']}"
    except (ValueError, KeyError, TypeError):
        return "starting right now"


def _lock(file: IO[str]) -> bool:
    """Take the operating system's lock without waiting; False: another process has it."""
    try:
        if sys.platform == "win32":
            import msvcrt

            file.seek(4096)  # beyond what is written there, which others must be able to read
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    return True
