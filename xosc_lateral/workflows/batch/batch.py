"""Convert many scenarios: parallel, resumable, one bad scenario costing one row."""

from __future__ import annotations

import errno
import os
import time
import traceback
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import NamedTuple

from xosc_lateral.base.errors import FormatError, XoscLateralError
from xosc_lateral.base.signals import deferring_signals
from xosc_lateral.base.version import BEHAVIOUR, __version__
from xosc_lateral.files.atomic import files_of_run, temporary_files
from xosc_lateral.files.output_paths import label_files
from xosc_lateral.files.remote import address
from xosc_lateral.files.source import file_hash, file_state
from xosc_lateral.workflows.batch.jobs import Batch, Job, convert_job
from xosc_lateral.workflows.batch.journal import STATE_FOLDER, Journal, folder_lock
from xosc_lateral.workflows.batch.manifest import MANIFEST, ManifestRow, Timing, read_manifest
from xosc_lateral.workflows.batch.workers import (
    JobLimitError,
    JobLimits,
    Pool,
    WorkerDiedError,
    open_pool,
    run_tasks,
    within_limits,
)

Converter = Callable[[Job], ManifestRow]
"""Makes a job's output and describes it; raises an `XoscLateralError` when the input is at fault."""

MERGE_TIME = 600.0
"""So long a part waits for others that are writing the manifest: each takes a second for ten thousand rows. [s]"""

_STOPPING = frozenset(
    {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EMFILE, errno.ENFILE, errno.EIO, errno.ESTALE, errno.ENOTCONN}
)
"""Errors of the system that the next scenario would meet as well."""

_GOES_ON = "what is finished is kept, run it again to go on"


class JobState(StrEnum):
    """What became of a job."""

    WRITTEN = "written"
    UP_TO_DATE = "up to date"
    KEPT = "kept"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class JobOutcome:
    """What became of a job, and its row of the manifest."""

    state: JobState
    row: ManifestRow
    seconds: float  # the conversion took
    why: str = ""  # why an output that was there is made anew, or would be


PROGRAM, SETTINGS, INPUTS = "another version made it", "settings differ", "inputs changed"
CHANGES = frozenset({PROGRAM, SETTINGS, INPUTS})
"""Why an output that is as it was written is not what a conversion would write now."""


class BatchStoppedError(XoscLateralError):
    """The run can't go on (disk full, no permission). What is finished is kept; run it again to go on."""


def convert_many(
    batch: Batch,
    *,
    workers: int = 1,
    cluster: str | None = None,
    keep_old: bool = False,
    converter: Converter | None = None,
    limits: JobLimits | None = None,
    notify: Callable[[str], None] | None = None,
) -> Iterator[JobOutcome]:
    """Convert a batch and yield what became of each job as it comes: first what is up to date, then in any order.

    The outputs, and the manifest written at the end, do not depend on the number of workers, on the order, or on how
    often the run was interrupted. To stop early, close the iterator: what is finished is kept.

    - `workers`: processes on this machine; -1: one per core; 0: this process itself, which a scenario can then take
      down; `cluster`: address of a dask.distributed scheduler, whose workers are used instead
    - `keep_old`: leave outputs whose inputs, settings or program have changed
    - `converter`: in place of `convert_job`; has to be picklable; `limits`: what one job may take
    - `notify`: gets a line for what a user has to know besides the outcomes (a manifest that can't be read, say)

    Raises `FolderInUseError`: another run writes into the folder; `BatchStoppedError`: the folder can't be written, the
    disk is full; `ClusterError`: the cluster can't be reached, is gone, or has another version of this package.
    """
    limits = limits or JobLimits()
    work = partial(_run_job, converter or convert_job, limits)
    new = [folder for folder in (batch.folder, *batch.folder.parents) if not folder.exists()]
    try:
        try:
            pool = partial(open_pool, cluster=cluster, limits=limits)
            yield from _outcomes(batch, work, workers, pool, keep_old, notify or (lambda line: None))
        except OSError as error:
            if error.errno not in (errno.EROFS, errno.EACCES):
                raise
            done = list(_up_to_date(batch))
            if len(done) < len(batch):
                raise
            yield from done
    except OSError as error:
        where = error.filename or batch.folder
        raise BatchStoppedError(f"{where}: {error.strerror or error}; {_GOES_ON}") from error
    finally:
        remove_empty([batch.folder / STATE_FOLDER, *new])


def _outcomes(
    batch: Batch,
    work: Callable[[str, Job], _Reply],
    workers: int,
    open_pool: Callable[[int], Pool],
    keep_old: bool,
    notify: Callable[[str], None],
) -> Iterator[JobOutcome]:
    state = batch.folder / STATE_FOLDER / batch.shard
    planned = {job.name for job in batch.jobs}
    with ExitStack() as stack:
        stack.callback(remove_empty, [state])
        runs = stack.enter_context(folder_lock(state / "lock"))
        stack.callback(_sweep, batch.folder, runs[:1])
        _sweep(batch.folder, runs[1:])
        if batch.shard:
            with whole_folder(batch.folder):
                pass  # nobody is at work on the whole
        only = planned if batch.shard else None
        journal = stack.enter_context(Journal(batch.folder, state / "journal.jsonl", notify, only))
        if not batch.shard:
            _take_over_parts(batch.folder, journal, notify)
        todo: dict[str, tuple[Job, str]] = {}
        failed: set[Path] = set()
        for job in batch.jobs:
            former, timing = journal.row(job.name), journal.timing(job.name)
            why = _why_anew(job, former, timing.state)
            if former is None or (why and not (keep_old and why in CHANGES)):
                todo[job.name] = job, why
                continue
            row = replace(former, error="", stale=bool(why))
            if row != former:
                journal.add(row, timing)
            yield JobOutcome(JobState.KEPT if why else JobState.UP_TO_DATE, row, 0.0, why)
        if todo:
            with deferring_signals(), open_pool(min(workers, len(todo))) as pool:
                for job, reply in run_tasks(pool, partial(work, runs[0]), (job for job, _ in todo.values())):
                    outcome = _noted(job, reply, journal, todo[job.name][1])
                    failed |= {job.output.parent} if outcome.row.error else set()
                    yield outcome
        if not batch.shard:
            _finish(journal, batch, planned, runs[0])
        elif not address(batch.folder):  # where there are no locks, the run of the whole ends the batch
            with whole_folder(batch.folder) as run:
                whole = Journal(batch.folder, batch.folder / STATE_FOLDER / "journal.jsonl", notify)
                whole.take_over(journal)
                _finish(whole, batch, planned | batch.elsewhere, run)
            journal.drop()
        remove_empty(place for folder in failed for place in (folder, *folder.parents) if batch.folder in place.parents)


@contextmanager
def whole_folder(folder: Path) -> Iterator[str]:
    """Hold the folder for a moment, other parts of a batch being at work in it; gives the id of this run.

    Raises `FolderInUseError`: somebody is at work on the whole.
    """
    with folder_lock(folder / STATE_FOLDER / "lock", wait=MERGE_TIME) as runs:
        _sweep(folder, runs[1:])
        yield runs[0]


def _take_over_parts(folder: Path, journal: Journal, notify: Callable[[str], None]) -> None:
    """Go on where parts were killed; `FolderInUseError`: one is at work."""
    for part in sorted((folder / STATE_FOLDER).glob("*-of-*")):
        with folder_lock(part / "lock") as runs:
            _sweep(folder, runs[1:])
            of_part = Journal(folder, part / "journal.jsonl", notify, only=())
            journal.take_over(of_part)
            of_part.drop()
        remove_empty([part])


def _finish(journal: Journal, batch: Batch, planned: Container[str], run: str) -> None:
    """Write the manifest; rows of former runs stay as long as their output does."""
    for output in journal:
        if output not in planned and not (batch.folder / output).is_file():
            journal.forget(output)
    with files_of_run(run):
        journal.finish()


def _up_to_date(batch: Batch) -> Iterator[JobOutcome]:
    """Jobs with nothing to do, in a folder that can't be written."""
    rows = {row.output: row for row in read_manifest(batch.folder / MANIFEST)}
    for job in batch.jobs:
        row = rows.get(job.name)
        if row is not None and not row.error and not row.stale and not _why_anew(job, row, ""):
            yield JobOutcome(JobState.UP_TO_DATE, row, 0.0)


def remove_empty(folders: Iterable[Path]) -> None:
    """Those with nothing in them, inner ones first; a run that has just begun may have its lock there."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


class _Reply(NamedTuple):
    """What comes back from a worker; `stop`: why no other job can be done."""

    row: ManifestRow
    timing: Timing = Timing()
    stop: str = ""


def _run_job(converter: Converter, limits: JobLimits, run: str, job: Job) -> _Reply:
    """One job, in a worker. Whatever goes wrong with this one scenario ends up in its row."""
    start = time.perf_counter()
    if job.package_version != __version__:  # a worker of a cluster that came later
        what = f"a worker has version {__version__}, the run was planned by {job.package_version}"
        return _Reply(job.row(what), stop=what)
    try:
        with files_of_run(run):
            row = job.row(job.error) if job.error else within_limits(converter, job, limits)
    except JobLimitError as error:
        row = job.row(f"{job.source}: {error}")
    except (XoscLateralError, OSError) as error:
        if isinstance(error, OSError) and error.errno in _STOPPING:
            return _Reply(job.row(str(error)), stop=f"{job.output}: {error.strerror or error}")
        remarks = (str(one) for one in getattr(error, "messages", ()) if one.is_warning)
        row = replace(job.row(" ".join(str(error).split())), warnings=tuple(remarks))
    except Exception as error:  # a bug of ours must not cost the other ten thousand; the row says that it is one
        place = traceback.extract_tb(error.__traceback__)[-1]
        what = f"{type(error).__name__}: {' '.join(str(error).split())} ({Path(place.filename).name}:{place.lineno})"
        row = job.row(f"{job.source}: internal error: {what}")
    written = not row.error and job.page is None  # while a page is written, much can happen to an output
    return _Reply(row, Timing(time.perf_counter() - start, file_state(job.output) if written else ""))


def _noted(job: Job, reply: _Reply | WorkerDiedError, journal: Journal, why: str) -> JobOutcome:
    if isinstance(reply, WorkerDiedError):
        reply = _Reply(job.row(f"{job.source}: {reply}"))
    if reply.stop:
        raise BatchStoppedError(f"{reply.stop}; {_GOES_ON}")
    row, timing, _ = reply
    former = journal.row(job.name) if row.error else None
    if former is not None and former.output_sha256 and _are({job.output: former.output_sha256}):
        row = replace(former, error=row.error, stale=True)  # what the output is made of, and why it is not made now
    journal.add(row, timing)
    return JobOutcome(JobState.FAILED if row.error else JobState.WRITTEN, row, timing.seconds, why)


def _why_anew(job: Job, row: ManifestRow | None, state: str) -> str:
    """Why an output is not what a conversion would write now; empty if it is, or if there is no output.

    An output in the same `file_state` as when it was written is not read: `verify` does that.
    """
    if job.error or row is None or not row.output_sha256:
        return "" if row is None else "could not be made"
    if not (state and state == file_state(job.output)) and not _are({job.output: row.output_sha256}):
        return "changed or gone"
    if job.page is not None and not job.page.is_file():
        return "its page is gone"
    if job.labels and not all(path.is_file() for path in label_files(job.output)):
        return "its labels are gone"
    if row.behaviour != BEHAVIOUR:
        return PROGRAM
    if row.settings != job.fingerprint or row.scenario != job.scenario:
        return SETTINGS
    inputs = {Path(os.path.normpath(job.base / name)): value for name, value in row.inputs.items()}
    return "" if _are(inputs) else INPUTS


def _are(files: Mapping[Path, str]) -> bool:
    """Whether files are there and have these hashes."""
    try:
        return all(file_hash(path) == value for path, value in files.items())
    except (OSError, FormatError):
        return False


def _sweep(folder: Path, runs: Sequence[str]) -> None:
    """Remove what killed runs, or killed workers of them, were just writing; nobody else's."""
    names = temporary_files(runs)
    for path in folder.rglob(".*.tmp*") if runs else ():
        if names.fullmatch(path.name):
            path.unlink(missing_ok=True)
