"""Files and folders of a run in places that others may write to: no link there leads a run elsewhere."""

from __future__ import annotations

import errno
import os
import stat
import tempfile
from pathlib import Path
from typing import IO

from xosc_lateral.base.errors import FormatError

_PLAIN = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
_LINKS = (errno.ELOOP, errno.EMLINK, errno.ENOTDIR)
"""What systems answer where ``O_NOFOLLOW`` meets a link."""

_LINK = "is a link, which is not followed here: remove it"


def open_own(path: Path) -> IO[bytes]:
    """Open a file for reading and writing; made if it is not there.

    Raises `FormatError`: it or its folder is a link, it is no file, has another name elsewhere or another owner;
    `OSError`: it can't be opened.
    """
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
    """Make a folder that is so many levels below the one that the user named.

    Raises `FormatError`: it, or one in between, is a link, which an output would follow; `OSError`: it can't be made.
    """
    for place in (folder, *folder.parents)[:depth]:
        if place.is_symlink():
            raise FormatError(_LINK, path=place)
    folder.mkdir(parents=True, exist_ok=True)
