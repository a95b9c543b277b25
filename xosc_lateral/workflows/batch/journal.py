"""What a run has done so far, on disk at every moment: rows appended one by one, read again after a kill."""

from __future__ import annotations

import json
import os
import re
import secrets
import socket
import time
from collections.abc import Callable, Container, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, Self

from xosc_lateral.base.errors import FormatError, XoscLateralError
from xosc_lateral.files.atomic import LARGEST_RECORD, lock, open_own
from xosc_lateral.workflows.batch import manifest
from xosc_lateral.workflows.batch.manifest import MANIFEST, TIMINGS, ManifestRow, Timing


class FolderInUseError(XoscLateralError):
    """Another run writes into the folder."""


STATE_FOLDER = ".xosc-lateral"
"""Folder inside the output folder, there only while a batch is unfinished: journal and lock; of a part in a folder of
its own."""


@contextmanager
def folder_lock(path: Path, wait: float = 0.0) -> Iterator[Sequence[str]]:
    """Hold a lock file while the block runs; gives ids: that of this run, then those of killed runs before it.

    The operating system's lock counts, which goes with the process; what the file says (process and host) is for the
    message, and the ids for what killed runs have left half-written.

    Raises `FolderInUseError`: when another process holds it for longer than `wait` [s]; `FormatError`: it is a link or
    somebody else's; `OSError`: when the folder can't be written.
    """
    file = _open_locked(path, wait)
    try:
        killed = stated if isinstance(stated := _stated(file).get("runs"), list) else []
        killed = [run for run in map(str, killed) if re.fullmatch(rf"[0-9a-f]{{{RUN_DIGITS}}}", run)]
        runs = [secrets.token_hex(RUN_DIGITS // 2), *killed][:MOST_RUNS]
        file.seek(0)
        file.truncate()
        file.write(json.dumps({"pid": os.getpid(), "host": socket.gethostname(), "runs": runs}).encode())
        file.flush()
        yield runs
    finally:
        path.unlink(missing_ok=True)  # while still locked: who waits for it finds that it is gone and makes a new one
        file.close()


RUN_DIGITS, MOST_RUNS = 12, 1000
"""Hexadecimal digits of a run's id; ids that a lock keeps: nobody is killed so often one after another, and what a lock
says can't grow from run to run."""


def _stated(file: IO[bytes]) -> dict[str, Any]:
    """What a lock file says, whoever wrote it."""
    file.seek(0)
    try:
        values = json.loads(file.read(LARGEST_RECORD))
    except (ValueError, RecursionError):
        values = None
    return values if isinstance(values, dict) else {}


def _open_locked(path: Path, wait: float) -> IO[bytes]:
    end = time.monotonic() + wait
    while True:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            file = open_own(path)
        except FileNotFoundError:
            continue  # a run that just ended has taken the folder away again
        if not lock(file.fileno()):
            values = _stated(file)
            file.close()
            if time.monotonic() < end:
                time.sleep(0.05)
                continue
            is_stated = {"pid", "host"} <= values.keys()
            holder = f"process {values['pid']} on {values['host']}" if is_stated else "starting right now"
            folder = path.parents[1 if path.parent.name == STATE_FOLDER else 2]
            raise FolderInUseError(
                f"{folder}: another run ({holder}) is writing into this folder; wait for it, or use another"
            )
        try:
            if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file
        except FileNotFoundError:
            pass
        file.close()  # its owner has removed it between our opening and locking it


CLOCK_TICK = 20_000_000
"""A file that is written to twice within the resolution of a file system's clock (4 ms on Linux, 16 ms on Windows) may
look as if it had not been: what was written so shortly before is not known by its state. [ns]"""


def _known(timing: Timing, now: int) -> Timing:
    """With the state if an edit from `now` on [ns] would change it."""
    changed = max(map(int, timing.state.split()[1:3]), default=now)
    return timing if now - changed > CLOCK_TICK else Timing(timing.seconds)


class Journal:
    """Rows of an output folder, the newest of each output.

    A file of JSON lines; a line that a kill cut short is dropped. Rows stay on disk: in memory is only where each one
    begins, so that ten thousand of them cost a megabyte.

    `folder`: output folder; rows of its manifest count until the journal has newer ones; `path`: the journal; `notify`:
    gets a line if manifest or timings can't be read: they are put aside, and the run goes on without; `only`: outputs
    of the manifest that matter.
    """

    def __init__(
        self, folder: Path, path: Path, notify: Callable[[str], None], only: Container[str] | None = None
    ) -> None:
        self._folder, self._path, self._notify, self._only = folder, path, notify, only
        self._begin: dict[str, int] = {}
        self._timings: dict[str, Timing] = {}
        self._file = open_own(path)
        self._end = self._intact_end()
        self._file.truncate(self._end)
        self._adopt_manifest()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        with suppress(OSError):  # every row has been flushed; what a full disk refused was never promised
            self._file.close()
        if not self._begin and raised[1] is not None:  # nothing was done
            self._path.unlink(missing_ok=True)

    def __iter__(self) -> Iterator[str]:
        return iter(tuple(self._begin))

    def row(self, output: str) -> ManifestRow | None:
        """The newest row of an output."""
        import msgspec

        if output not in self._begin:
            return None
        self._file.seek(self._begin[output])
        return msgspec.convert(json.loads(self._file.readline())["row"], ManifestRow)  # was checked when it came in

    def timing(self, output: str) -> Timing:
        """Of the newest conversion of an output."""
        return self._timings.get(output, Timing())

    def add(self, row: ManifestRow, timing: Timing) -> None:
        """Append a row, which survives the death of this process; `OSError` on a full disk, earlier rows stay."""
        self._changed = True
        line = json.dumps({"row": row.to_dict(), **timing._asdict()}).encode() + b"\n"
        self._file.seek(self._end)
        self._file.write(line)
        self._file.flush()
        self._begin[row.output] = self._end
        self._timings[row.output] = timing
        self._end += len(line)

    def forget(self, output: str) -> None:
        """Leave an output out of the manifest."""
        self._changed = True
        del self._begin[output]

    def finish(self) -> None:
        """Write manifest and timings, sorted by output, if they change; then the journal goes, which says the same."""
        if self._changed:
            outputs, now = sorted(self._begin), time.time_ns()
            timings = ((output, _known(self._timings[output], now)) for output in outputs)
            manifest.write_timings(timings, self._folder / TIMINGS)
            manifest.write_manifest(filter(None, map(self.row, outputs)), self._folder / MANIFEST)
        self.drop()

    def drop(self) -> None:
        """Leave nothing behind: what it says is in the manifest."""
        self._file.close()
        self._path.unlink()

    def take_over(self, other: Journal) -> None:
        """Take the rows of another journal, as they are there."""
        for output in other:
            row, timing = other.row(output), other.timing(output)
            if row is not None and (row, timing) != (self.row(output), self.timing(output)):
                self.add(row, timing)

    def _intact_end(self) -> int:
        """Index the lines there are; returns where the last whole one ends. [byte]"""
        end = 0
        for line in iter(lambda: self._file.readline(LARGEST_RECORD), b""):
            try:
                values = json.loads(line)
                output, timing = ManifestRow.from_dict(values["row"]).output, Timing.of(values)
            except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
                break
            if not line.endswith(b"\n"):
                break
            self._begin[output], self._timings[output] = end, timing
            end += len(line)
        return end

    def _adopt_manifest(self) -> None:
        recovered = bool(self._begin)
        timings, timings_path, path = dict[str, Timing](), self._folder / TIMINGS, self._folder / MANIFEST
        with self._put_aside_if_damaged(TIMINGS):
            timings = manifest.read_timings(timings_path)
        with self._put_aside_if_damaged(MANIFEST):
            for row in manifest.read_manifest(path):
                if row.output not in self._begin and (self._only is None or row.output in self._only):
                    self.add(row, timings.get(row.output, Timing()))
        self._changed = recovered or not (timings_path.exists() and path.exists() and manifest.is_of_now(path))

    @contextmanager
    def _put_aside_if_damaged(self, name: str) -> Iterator[None]:
        path = self._folder / name
        try:
            yield
        except FormatError as error:
            aside = path.with_suffix(f".damaged{path.suffix}")
            path.replace(aside)
            self._notify(f"{error}; it is put aside as {aside.name}, outputs that it named are made anew")
