"""Inputs that are named by a pattern, or lie elsewhere (``s3://``, ``gs://``, ``memory://``, by fsspec); outputs there.

What lies elsewhere is copied into a folder of this process, to the place that its address says: what one file says of
another's place holds there, too.
"""

from __future__ import annotations

import atexit
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from glob import glob, has_magic
from importlib import import_module
from pathlib import Path
from typing import Any

from xosc_lateral.base.errors import COPIES, FormatError, XoscLateralError
from xosc_lateral.base.limits import FILE_SIZE
from xosc_lateral.files.held import held_at
from xosc_lateral.files.source import file_state

PathLike = str | Path

_BROUGHT: dict[Path, str] = {}
"""Copies as they came from elsewhere, or went there, and their `file_state`."""

_AT_ONCE: set[Path] = set()
"""Folders of copies from which files go back as soon as they are written; of a batch, when it ends."""

_ADDRESS = re.compile(r"([a-z][a-z0-9+.-]+):/+(.+)", re.IGNORECASE)
"""A scheme has two letters at least (``C:/`` is a drive); of ``//``, a `Path` leaves one."""


SCHEMES = ("s3", "gs", "abfs", "file", "memory")
"""Of fsspec's, those that only fetch and store files."""


def is_url(path: object) -> bool:
    """Whether it is a place that fsspec knows: ``s3://bucket/cut-in.xosc``, ``memory://a``."""
    return isinstance(path, str | Path) and _ADDRESS.fullmatch(str(path)) is not None


def address(path: PathLike) -> str:
    """Address of what lies elsewhere, or of its copy; empty: it lies here."""
    text = str(path)
    match = _ADDRESS.fullmatch(COPIES.sub(r"\1://", text) if COPIES.match(text) else text)
    return "" if match is None else f"{match[1]}://{'/' * (match[1].lower() == 'file')}{match[2]}"


def leads_from(source: Path, output: Path) -> Path:
    """Of which file the references in an output are written: its own; the source's, from memory or another storage."""
    storages = {address(path).partition(":")[0] for path in (source, output)}
    return source if held_at(source) is not None or len(storages) > 1 else output


def local(path: PathLike) -> Path:
    """The path itself, or of a file or folder elsewhere a copy that lasts as long as this process.

    Raises `FormatError`: there is none, it is too large, or fsspec or what it needs is not installed.
    """
    (only,) = _files_of(path, is_pattern=False)
    return only


def inputs_of(paths: Iterable[PathLike]) -> list[Path]:
    """Files and folders that paths and patterns (``runs/*.csv``) name, see `local`, in the order of their names."""
    return [file for path in paths for file in _files_of(path, is_pattern=has_magic(str(path)))]


@contextmanager
def sent_back(*outputs: PathLike | None) -> Iterator[list[Any]]:
    """Where to write outputs: of those elsewhere, copies of what is there; what changed goes back, however it ends."""
    here: list[Any] = [None if output is None else _brought(output) for output in outputs]
    try:
        yield here
    finally:
        for output, place in zip(outputs, here, strict=True):
            if output is not None and is_url(output):
                _send_back(_folder_of(place))


def brought(output: PathLike) -> PathLike:
    """Where to write an output: itself, or, of one elsewhere, a copy of what is there, which is sent when written."""
    place = _brought(output)
    if is_url(output):
        _AT_ONCE.add(_folder_of(place))
    return place


def _brought(output: PathLike) -> PathLike:
    if not is_url(output):
        return output
    url = address(output)
    with _storage(url) as (files, place):
        _copies(files, [place], url)
    return f"{_place(url)}{'/' * url.endswith('/')}"


def _folder_of(place: PathLike) -> Path:
    path = Path(place)
    return path if path.is_dir() or str(place).endswith("/") or not path.suffix else path.parent


def _send_back(folder: Path) -> None:
    """Take what was written to a copy of a folder there, and remove there what is gone."""
    known = {file for file in _BROUGHT if folder in file.parents}
    for file in sorted(known | {file for file in folder.rglob("*") if file.is_file()}):
        _send(file)


def send(file: Path) -> None:
    """A file that was written where it belongs, if this is a copy of one elsewhere."""
    if _AT_ONCE and _AT_ONCE & {*file.parents}:
        _send(file)


def _send(file: Path) -> None:
    if (state := file_state(file)) == _BROUGHT.get(file):
        return
    with _storage(address(file)) as (files, place):
        if state:
            files.makedirs(files._parent(place), exist_ok=True)
            files.put_file(str(file), place)
            _BROUGHT[file] = state
        else:
            files.rm_file(place)
            del _BROUGHT[file]


def _files_of(path: PathLike, *, is_pattern: bool) -> list[Path]:
    if is_url(path):
        url = address(path)
        with _storage(url) as (files, place):
            names = sorted(files.glob(place)) if is_pattern else [place] * files.exists(place)
            if not names:
                raise FormatError("no file is called so", path=url)
            return _copies(files, names, url)
    if not is_pattern or Path(path).exists():
        return [Path(path)]
    if matches := [Path(file) for file in sorted(glob(str(path), recursive=True))]:  # noqa: PTH207 (a whole path)
        return matches
    raise FormatError("no file is called so", path=path)


@contextmanager
def _storage(url: str) -> Iterator[tuple[Any, str]]:
    """The file system that an address is of, and what it calls the place. Raises `FormatError` for all that it does."""
    scheme = url.partition("://")[0]
    if scheme.lower() not in SCHEMES or "::" in url:  # which chains file systems: each may be one that runs programs
        what = "a chain of storages" if "::" in url else f"{scheme}://"
        raise FormatError(f"{what} is not read; {', '.join(SCHEMES)} are", path=url)
    try:
        url_to_fs = import_module("fsspec.core").url_to_fs
    except ImportError as error:
        raise FormatError(f"{scheme}:// needs fsspec: pip install fsspec", path=url) from error
    try:
        yield url_to_fs(url)
    except XoscLateralError:
        raise
    except Exception as error:  # each kind of storage has its own
        what = " ".join(str(error).split()) or type(error).__name__
        raise FormatError(f"can't be reached there: {what}", path=url) from error


def _copies(files: Any, names: Iterable[str], url: str) -> list[Path]:
    """Of files, and of all that is in folders, as they are now; of what is not there, none is left."""
    scheme = url.partition("://")[0]
    for name in names:
        folder = _place(f"{scheme}://{name}")
        for former in [file for file in _BROUGHT if folder in (file, *file.parents)]:
            former.unlink(missing_ok=True)
            del _BROUGHT[former]
        for file, size in (files.du(name, total=False) if files.exists(name) else {}).items():
            if (size or 0) > FILE_SIZE.bytes:
                raise FormatError(FILE_SIZE.refusal(size / 1e6), path=url)
            if files.isfile(file):
                copy = _place(f"{scheme}://{file}")
                copy.parent.mkdir(parents=True, exist_ok=True)
                files.get_file(file, str(copy))
                _BROUGHT[copy] = file_state(copy)
    return [_place(f"{scheme}://{name}") for name in names]


def _place(url: str) -> Path:
    scheme, _, rest = url.rpartition("://")
    parts = [part for part in rest.split("/") if part not in ("", ".")]
    if ".." in parts:
        raise FormatError("an address without '..', please", path=url)
    return _folder().joinpath(scheme.rpartition("://")[2], *parts)


@cache
def _folder() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="xosc-lateral-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder / "elsewhere"
