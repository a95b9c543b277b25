"""Columns of a run: what is beyond a fixed amount of memory lies in a file, and is worked on in blocks of rows.

A run of a day has millions of rows, one of an hour with hundreds of cars a hundred million. Whoever works on all of
them does so with `blocks`, and makes columns that last with `columns`, `stored` and `empty`. Within `beside`, columns
beyond `IN_MEMORY` are mapped from a file without a name, which is gone with the last of them, however the process ends.
A thread gives its pages in memory back as soon as they are more than `MAPPED_MEMORY`; nothing is lost by that: the
mapping is shared with the file (madvise(2), MADV_DONTNEED). Where the system can't, all is in memory.
"""

from __future__ import annotations

import errno
import mmap
import os
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

BLOCK = 65_536
"""Rows that are worked on at a time where all of a long run would take much memory: half a megabyte each. [-]"""

IN_MEMORY = 64e6
"""Columns of one run that are in memory before others go to the file: 2 h of one car, as of 100 for 70 s. [byte]"""

MAPPED_MEMORY = 50e6
"""Pages of the file that may be in memory: what two or three passes over a block touch. [byte]"""

LOOK_EVERY = 0.01
"""How often they are counted: a pass over a file at 5 GB/s brings as many again meanwhile. [s]"""

CHUNK_SIZE = 64 << 20
"""Least that the file grows by; a long one grows by an eighth, since each piece takes one of the open files. [byte]"""


def status_bytes(column: int) -> int:
    """Memory by a column of /proc/self/statm (0: all, 1: resident, 2: of files); 0: the system does not say. [byte]"""
    if not sys.platform.startswith("linux"):
        return 0
    return int(Path("/proc/self/statm").read_bytes().split()[column]) * mmap.PAGESIZE


# ---- where columns lie -----------------------------------------------------------------------------------------------
class _Store:
    """The columns of one run."""

    def __init__(self, folder: Path) -> None:
        self.folder = next(parent for parent in (folder.absolute(), *folder.absolute().parents) if parent.is_dir())
        self.memory = IN_MEMORY
        """Left of it. [byte]"""
        self._chunk: mmap.mmap | None = None
        self._free = self._size = 0

    def empty(self, shape: tuple[int, ...], kind: np.dtype[Any]) -> NDArray[Any]:
        """Of this shape and kind."""
        size = int(np.prod(shape)) * kind.itemsize
        self.memory -= size
        if self.memory >= 0 or size == 0:
            return np.empty(shape, kind)
        if self._chunk is None or len(self._chunk) - self._free < size:
            self._chunk, self._free = self.grown(max(CHUNK_SIZE, self._size // 8, size)), 0
        values = np.frombuffer(self._chunk, kind, size // kind.itemsize, self._free).reshape(shape)
        self._free += -(-size // 64) * 64  # a line of the processor's cache
        return values

    def grown(self, size: int) -> mmap.mmap:
        """A piece of the file that is gone with what lies in it."""
        size = -(-size // mmap.PAGESIZE) * mmap.PAGESIZE
        with ExitStack() as opened:
            try:
                file = opened.enter_context(tempfile.TemporaryFile(dir=self.folder))
                os.posix_fallocate(file.fileno(), 0, size)  # a full disk is an error here, and not a signal later
                chunk = mmap.mmap(file.fileno(), size)
            except OSError as error:
                if error.errno == errno.ENOMEM:
                    raise MemoryError from error  # a limit of this process (`RLIMIT_AS`)
                what = f"{error.strerror}, and {size / 1e6:.0f} MB are needed there for the rows of a long run"
                raise OSError(error.errno, what, str(self.folder)) from error
            weakref.finalize(chunk, opened.pop_all().close)
        self._size += size
        global _is_giving_back
        with _changing_chunks:
            _chunks[chunk] = np.frombuffer(chunk, np.uint8).ctypes.data, file.fileno()
            if not _is_giving_back:
                _is_giving_back = True
                threading.Thread(target=_give_back, daemon=True, name="give back pages").start()
        return chunk


# Of all runs whose columns somebody still has: where they are in memory, and the numbers of their files.
_chunks = weakref.WeakKeyDictionary[mmap.mmap, tuple[int, int]]()
_changing_chunks, _is_giving_back = threading.Lock(), False
_store: ContextVar[_Store | None] = ContextVar("store", default=None)


@contextmanager
def spilling_to(folder: Path | None) -> Iterator[None]:
    """Columns beyond `IN_MEMORY` lie in a file in this folder, or above it where it is not there yet; None: in memory.

    They may be used after it. Raises `OSError` (with the folder) where its disk is full.
    """
    can = status_bytes(2) > 0 and hasattr(mmap, "MADV_DONTNEED")
    token = _store.set(_Store(folder) if can and folder is not None else None)
    try:
        yield
    finally:
        _store.reset(token)


def _give_back() -> None:
    """As long as there is a file: pages of it leave memory when they are too many."""
    global _is_giving_back
    other_pages = status_bytes(2)  # of libraries [byte]
    while True:
        time.sleep(LOOK_EVERY)
        with _changing_chunks:
            chunks = tuple(_chunks)
            if not chunks:
                _is_giving_back = False
                return
        if status_bytes(2) - other_pages > MAPPED_MEMORY:
            for chunk in chunks:
                chunk.madvise(mmap.MADV_DONTNEED)
            other_pages = status_bytes(2)
        del chunks


def empty(shape: int | tuple[int, ...], kind: DTypeLike = np.float64) -> NDArray[Any]:
    """A column, or several, to be filled."""
    shape = (shape,) if isinstance(shape, int) else shape
    store = _store.get()
    return np.empty(shape, kind) if store is None else store.empty(shape, np.dtype(kind))


def put(column: NDArray[Any], rows: slice, values: NDArray[Any]) -> None:
    """`column[rows] = values`; where a column is in the file that takes an eighth of the time."""
    if _chunks:
        address = column.ctypes.data
        for chunk, (begin, number) in _chunks.items():
            if begin <= address < begin + len(chunk):
                data = np.ascontiguousarray(values, dtype=column.dtype)
                os.pwrite(number, data.data, address - begin + rows.start * column.strides[0])
                return
    column[rows] = values


def scratch(n: int) -> NDArray[np.float64]:
    """A column to be filled that is gone after the work on one vehicle: in memory, unless it is long."""
    store = _store.get()
    if store is None or 8 * n <= MAPPED_MEMORY / 10:
        return np.empty(n)
    return np.frombuffer(store.grown(8 * n), dtype=np.float64, count=n)


def stored(values: NDArray[Any]) -> NDArray[Any]:
    """Values as a column that lasts, shape (n,): themselves while there is memory, read-only where all are the same."""
    store = _store.get()
    if store is None or store.memory >= values.nbytes or not len(values):
        if store is not None:
            store.memory -= values.nbytes
        return values
    if _is_all(values, values[:1]):
        return np.broadcast_to(values[:1].copy(), values.shape)
    column = store.empty(values.shape, values.dtype)
    put(column, slice(0, len(values)), values)
    return column


def columns(n: int, parts: Iterable[Sequence[NDArray[Any]]]) -> list[NDArray[Any]]:
    """Columns that last, shape (n,) each with n at least 1; read-only where all values are the same.

    `parts`: blocks of their rows in order, the same columns each time, shape (rows of the block,) each.
    """
    made: list[NDArray[Any]] = []
    begin = 0
    for part in parts:
        end = begin + len(part[0])
        made = made or [stored(values) if end == n else values[:1].copy() for values in part]
        for k, values in enumerate(part if end - begin < n else ()):
            if len(made[k]) == 1 and not _is_all(values, made[k]):
                column = empty(n, values.dtype)
                for rows in blocks(begin):
                    put(column, rows, np.broadcast_to(made[k], rows.stop - rows.start))
                made[k] = column
            if len(made[k]) == n:
                put(made[k], slice(begin, end), values)
        begin = end
    return [values if len(values) == n else np.broadcast_to(values, n) for values in made]


def _is_all(values: NDArray[Any], first: NDArray[Any]) -> bool:
    """Whether all values are the first one to the bit: a negative zero is another."""
    bits = f"u{values.dtype.itemsize}"
    return bool((np.ascontiguousarray(values).view(bits) == first.view(bits)).all())


# ---- work on them ----------------------------------------------------------------------------------------------------
def blocks(n: int, begin: int = 0) -> Iterator[slice]:
    """Rows from `begin` to n, at most `BLOCK` at a time."""
    for first in range(begin, n, BLOCK):
        yield slice(first, min(first + BLOCK, n))


def rows_where(n: int, holds: Callable[[slice], NDArray[np.bool_]], begin: int = 0) -> NDArray[np.intp]:
    """Rows from `begin` to n where something holds, which is asked block by block."""
    parts = [np.flatnonzero(holds(rows)) + rows.start for rows in blocks(n, begin)]
    return np.concatenate(parts) if parts else np.empty(0, dtype=np.intp)


def true_slices(mask: NDArray[np.bool_]) -> list[slice]:
    """The longest slices in which a mask, shape (n,), is True throughout, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [slice(first, stop) for first, stop in edges.reshape(-1, 2).tolist()]


def slices_where(n: int, holds: Callable[[slice], NDArray[np.bool_]], begin: int = 0) -> list[slice]:
    """The longest slices of rows from `begin` to n where something holds, which is asked block by block."""
    stretches: list[slice] = []
    for rows in blocks(n, begin):
        for part in true_slices(holds(rows)):
            first, stop = rows.start + part.start, rows.start + part.stop
            if stretches and stretches[-1].stop == first:
                first = stretches.pop().start
            stretches.append(slice(first, stop))
    return stretches
