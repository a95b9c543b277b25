"""Inputs that are named by a pattern, or lie elsewhere (``s3://``, ``gs://``, ``memory://``, by fsspec)."""

from __future__ import annotations

import atexit
import posixpath
import re
import shutil
import tempfile
from collections.abc import Iterable
from contextlib import AbstractContextManager
from functools import cache
from glob import glob, has_magic
from importlib import import_module
from pathlib import Path
from typing import IO

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.limits import FILE_SIZE

ADDRESS = re.compile(r"([a-z][a-z0-9+.-]+):/{1,2}(?!/)(.+)", re.IGNORECASE)
"""A scheme has two letters at least (``C:/`` is a drive); of ``//``, a `Path` leaves one."""


def local(path: str | Path) -> Path:
    """The path itself, or of a file or folder elsewhere a copy that lasts as long as this process.

    Raises `FormatError`: there is none, it is too large, or fsspec or what it needs is not installed.
    """
    (only,) = _files_of(path, is_pattern=False)
    return only


def inputs_of(paths: Iterable[str | Path]) -> list[Path]:
    """Files and folders that paths and patterns (``runs/*.csv``) name, see `local`, in the order of their names."""
    return [file for path in paths for file in _files_of(path, is_pattern=has_magic(str(path)))]


def _files_of(path: str | Path, *, is_pattern: bool) -> list[Path]:
    if (match := ADDRESS.fullmatch(str(path))) is not None:
        return _copies(match[1], match[2], is_pattern)
    if not is_pattern or Path(path).exists():
        return [Path(path)]
    if matches := [Path(file) for file in sorted(glob(str(path), recursive=True))]:  # noqa: PTH207 (a whole path)
        return matches
    raise FormatError("no file is called so", path=path)


@cache
def _copies(scheme: str, rest: str, is_pattern: bool) -> list[Path]:
    address = f"{scheme}://{rest}"
    try:
        url_to_fs = import_module("fsspec.core").url_to_fs
    except ImportError as error:
        raise FormatError(f"{scheme}:// needs fsspec: pip install fsspec", path=address) from error
    try:
        files, place = url_to_fs(address)
        names, made = sorted(files.glob(place)) if is_pattern else [place], list[Path]()
        for name in names:
            if (size := sum(files.du(name, total=False).values())) > FILE_SIZE.bytes:
                raise FormatError(FILE_SIZE.refusal(size / 1e6), path=address)
            made.append(_folder() / scheme / str(name).lstrip("/"))
            made[-1].parent.mkdir(parents=True, exist_ok=True)
            files.get(name, str(made[-1]), recursive=files.isdir(name))
    except FormatError:
        raise
    except Exception as error:  # each kind of storage has its own
        what = " ".join(str(error).split()) or type(error).__name__
        raise FormatError(f"can't be read from there: {what}", path=address) from error
    if not made:
        raise FormatError("no file is called so", path=address)
    return made


@cache
def _folder() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="xosc-lateral-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


# ---- single files, without a copy: as they are now
_URL = re.compile(r"[a-z][a-z0-9+.-]+://")


def is_url(stated: object) -> bool:
    """Whether it is a place that fsspec knows: ``s3://bucket/cut-in.xosc``, ``memory://a``."""
    return isinstance(stated, str) and _URL.match(stated) is not None


def open_url(url: str, mode: str) -> AbstractContextManager[IO[bytes]]:
    """Open a file in a bucket or the like. Raises `FormatError`: what that needs is not installed."""
    try:
        import fsspec

        opened: AbstractContextManager[IO[bytes]] = fsspec.open(url, mode)
    except (ImportError, ValueError) as error:
        raise FormatError(
            f"can't be opened: {error} (pip install fsspec, and its package for this place)", path=url
        ) from error
    return opened


def fetched(url: str) -> bytes:
    """Bytes of a file there, as it is now. Raises `FormatError`: see `open_url`; it is too large."""
    with open_url(url, "rb") as file:
        data = file.read(FILE_SIZE.bytes + 1)
    if len(data) > FILE_SIZE.bytes:
        raise FormatError(FILE_SIZE.refusal(len(data) / 1e6), path=url)
    return data


def urljoin(base: str, written: str) -> str:
    """Where a reference leads to, as seen from the file at a URL."""
    scheme, _, path = base.partition("://")
    return f"{scheme}://{posixpath.normpath(posixpath.join(posixpath.dirname(path), written))}"
