"""`convert_many`: folders, globs, tables and frames of scenarios; parallel, resumable."""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Unpack

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.limits import JOB_MEMORY, JOB_TIMEOUT
from xosc_lateral.base.names import in_terminal
from xosc_lateral.base.note import Note, notes
from xosc_lateral.base.signals import Interrupted
from xosc_lateral.files.output_paths import claim, output_folder
from xosc_lateral.files.remote import address, is_url, sent_back
from xosc_lateral.workflows.batch.batch import JobOutcome, JobState, remove_empty, whole_folder
from xosc_lateral.workflows.batch.batch import convert_many as outcomes_of
from xosc_lateral.workflows.batch.jobs import Batch, plan_batch
from xosc_lateral.workflows.batch.journal import STATE_FOLDER
from xosc_lateral.workflows.batch.manifest import MANIFEST, ManifestRow, read_manifest
from xosc_lateral.workflows.batch.page import write_batch_index
from xosc_lateral.workflows.batch.progress import Display, Summary, follow
from xosc_lateral.workflows.batch.request import read_request_table
from xosc_lateral.workflows.batch.workers import JobLimits
from xosc_lateral.workflows.conversion.settings import ConvertKeywords, ConvertSettings
from xosc_lateral.workflows.opened import scenarios_at
from xosc_lateral.workflows.options import declare_options, flag, process_count, spelled_out
from xosc_lateral.workflows.result import PathLike, Result

if TYPE_CHECKING:
    ScenariosLike = PathLike | pd.DataFrame | Sequence[PathLike]


BATCH = "Batches"
"""Heading of their options on the command line."""


def _workers(stated: str) -> dict[str, Any]:
    """So many processes, or those of a cluster."""
    if ":" in stated:
        return {"cluster": stated}
    try:
        return {"workers": int(stated)}
    except ValueError as error:
        raise ValueError(f"{stated!r} is neither a number nor the address of a dask scheduler") from error


JOB_LIMIT_UNITS = {"s": ("job_timeout", 1.0, 86_400.0), "MB": ("job_memory", 100.0, 1e6)}
"""Unit of a limit of one scenario -> keyword, and between what it can be."""


def _limits(stated: Sequence[str]) -> dict[str, Any]:
    """Limits of one scenario by their units."""
    limits = dict[str, Any]()
    for text in stated:
        match = re.fullmatch(r"(\d+(?:\.\d+)?) ?(s|MB)", text)
        name, least, most = JOB_LIMIT_UNITS[match[2]] if match else ("", 0.0, 0.0)
        if match is None or not least <= float(match[1]) <= most:
            raise ValueError(f"{text!r}, expected 1s to 86400s or 100MB to 1000000MB")
        limits[name] = float(match[1])
    return limits


@spelled_out(ConvertSettings)
@declare_options
def convert_many(
    scenarios: ScenariosLike,
    output: PathLike, *,
    variants: Annotated[int, flag(help="Number of outputs, each with different offsets.", min=1)] = 1,
    report: PathLike | None = None,
    workers: Annotated[int, flag("--jobs", kind=str | None, metavar="N|ADDRESS", show_default=False, read=process_count,
        gives=_workers, help="Number of processes (default 1); -1: one per core. Address of a dask scheduler: there.",
        rich_help_panel=BATCH)] = 1,
    job_timeout: Annotated[float, flag("--job-limit", kind=list[str] | None, metavar="600s|4000MB", show_default=False,
        gives=_limits, help=f"Of each scenario: time ({JOB_TIMEOUT.value:g}s), memory ({JOB_MEMORY.value:g}MB); may be "
        "repeated.", rich_help_panel=BATCH)] = JOB_TIMEOUT.value,
    job_memory: Annotated[float, flag(kind=float, said_by="--job-limit", help="Memory.")] = JOB_MEMORY.value,
    cluster: Annotated[str | None, flag(kind=str, said_by="--jobs",
        help="Address of a dask scheduler, whose workers work.")] = None,
    shard: Annotated[str | None, flag("--shard", metavar="K/N",
        help="Part K of N, for a scheduler: all parts together leave what one run leaves.",
        rich_help_panel=BATCH)] = None,
    labels: Annotated[bool, flag("--labels",
        help="Beside each output OpenLABEL tags and an ASAM quality result (.xqar).")] = False,
    keep_old: Annotated[bool, flag("--keep-old", help="Leave outputs of older inputs or versions alone.",
        rich_help_panel=BATCH)] = False,
    force: bool = False,
    show: Literal["auto", "quiet", "json", "nothing"] = "nothing",
    on_outcome: Callable[[Mapping[str, Any]], None] | None = None,
    **options: Unpack[ConvertKeywords],
) -> BatchResult:  # fmt: skip
    """Convert many scenarios into a folder; what is up to date there already is left alone.

    Parameters
    ----------
    scenarios : str, Path, DataFrame, or sequence of paths
        A file, a folder (searched to the bottom), a glob, a URL (``s3://...``, through fsspec), a table (CSV, Parquet)
        or frame with a column `scenario` and if wanted `variants`, `profile:ENTITY`, `parameter:NAME` and names of
        options; or several of them.
    output : str or Path
        Folder or URL; it mirrors the inputs, and holds `manifest.parquet` at the end.
    report : str or Path, optional
        Folder for a page per output, and an ``index.html`` that lists what needs attention first.
    job_timeout, job_memory : float
        What one scenario may take; one that takes more fails. [s], [MB]
    shard : str
        "2/8": the second of eight parts, which may run at the same time, on other machines with the same folder; a part
        that was killed is run again, or the whole without `shard`, as ends parts that write to a URL.
    keep_old : bool
        Leave outputs as they are whose inputs, settings or program have changed since; they count as stale.
    force : bool
        Replace files that this package did not write.
    show : {"auto", "quiet", "json", "nothing"}
        What is said on standard error meanwhile.
    on_outcome : callable, optional
        Called with each output's row of the manifest as it comes, with `state` and `seconds`.
    options
        `ConvertSettings`, for all of them.

    Raises
    ------
    FormatError
        An input that is not there or holds no scenario; two inputs with one output.
    """
    settings = replace(ConvertSettings.of(**options), names_may_lack=True)
    if isinstance(scenarios, str | Path):
        inputs: list[Any] = [scenarios]
    elif isinstance(scenarios, Sequence):
        inputs = list(scenarios)
    else:
        inputs = list(read_request_table(scenarios, settings, variants=variants))
    number, parts = (1, 1) if shard is None else read_shard(shard)
    if cluster is not None and any(map(is_url, (*inputs, output))):
        raise FormatError("workers of a cluster see paths alone; parts of a batch need none: --shard", path=output)
    here = [path for one in inputs for path in (scenarios_at(one) if is_url(one) else [one])]
    with sent_back(output, report) as (written, pages):
        folder = output_folder(written)
        whole = plan_batch(here, folder, settings, variants=variants, report=pages, labels=labels)
        if not len(whole):
            named = ", ".join(map(str, inputs[:3]))
            raise FormatError(f"no scenario to convert{_left_out(whole)}", path=named or output)
        batch = whole if shard is None else whole.part(number, parts)
        _refuse_unknown_names(whole)
        # A folder in an output's place is that output's failure alone.
        claim((job.output for job in batch.jobs if not job.output.is_dir()), force=force)
        outcomes = outcomes_of(
            batch,
            workers=workers,
            cluster=cluster,
            keep_old=keep_old,
            limits=JobLimits(job_timeout, job_memory),
            notify=None
            if show == "nothing"
            else lambda line: print(in_terminal(f"xosc-lateral: {line}"), file=sys.stderr, flush=True),
        )

        def report_row(outcome: JobOutcome) -> None:
            if on_outcome is not None:
                on_outcome(_row(outcome.state, outcome.seconds, outcome.row))

        try:
            summary = follow(outcomes, len(batch), Display(show), report=report_row)
        except Interrupted as signal:
            signal.finished = sum(job.output.is_file() for job in batch.jobs)
            raise
        index = None
        if pages is not None and not (shard and address(folder)):  # whichever part ends last has all of them
            with nullcontext() if shard is None else whole_folder(batch.folder):
                index = write_batch_index(whole, Path(pages))
            remove_empty([batch.folder / STATE_FOLDER])
        return BatchResult(batch, summary, index)


def read_shard(text: str) -> tuple[int, int]:
    """Which part of how many; `ValueError`: neither."""
    number, parts = (int(word) if word.isdecimal() else 0 for word in (text.partition("/")[::2]))
    if not 1 <= number <= parts:
        raise ValueError(f"shard {text!r}: expected K/N, the parts counted from 1 to N")
    return number, parts


def _refuse_unknown_names(batch: Batch) -> None:
    """An entity may be missing in some scenarios, but not in all."""
    asked = dict[tuple[str, str], bool]()
    texts = dict[Path, str]()
    for job in batch.jobs:
        for option in ("entity", "only", "ego"):
            names = getattr(job.settings, option)
            for name in names or ():
                if not asked.get((option, name)):
                    text = texts.setdefault(job.source, job.source.read_text("utf-8", errors="replace"))
                    # A name may stand in an escaped form or in a parameter: then the conversion looks at it.
                    asked[option, name] = f'"{name}"' in text or f"'{name}'" in text or not name.isidentifier()
    for (option, name), is_there in asked.items():
        if not is_there:
            raise FormatError(f"--{option} {name!r}: no scenario has such an entity", path=batch.base)


def _row(state: JobState, seconds: float, row: ManifestRow) -> dict[str, Any]:
    return {"state": state.value, "seconds": round(seconds, 4), **row.to_dict()}


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class BatchResult(Result):
    """What became of a batch; of single outputs, `to_frame` and `to_dict` read it from the manifest."""

    _batch: Batch
    _summary: Summary
    report: Path | None  # index of the pages, if there are any

    @property
    def folder(self) -> Path:
        """Of the outputs."""
        return self._batch.folder

    @property
    def messages(self) -> tuple[Note, ...]:
        """What a user has to know of the whole: a shipped profile that one of their own hides, say."""
        return notes(self._batch.notes)

    @property
    def failed(self) -> int:
        """Scenarios that could not be converted; `to_frame` says why, in its column `error`."""
        return self._summary.failed

    @property
    def with_warnings(self) -> int:
        """Outputs with at least one warning."""
        return self._summary.with_warnings

    @property
    def nobody_enriched(self) -> int:
        """Outputs in which no entity got offsets."""
        return sum(self._summary.nobody_enriched.values())

    @property
    def cut_off(self) -> tuple[str, ...]:
        """Outputs whose runs end at the time limit, though their scenarios go on."""
        return tuple(self._summary.cut_off)

    def headline(self) -> str:
        """One line."""
        return f"{address(self.folder) or self.folder}: {self._summary.text()}"

    def __str__(self) -> str:
        report = [] if self.report is None else [f"report: {self.report}"]
        lines = [self.headline() + _left_out(self._batch), *self.notes, *self._summary.remarks(), *report]
        return "\n".join(lines)

    def to_frame(self) -> pd.DataFrame:
        """One row per output: the manifest's columns, with `state` and `seconds`."""
        return pd.DataFrame(self._rows())

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        return {**self.totals(), "outputs": list(self._rows())}

    def _rows(self) -> Iterator[dict[str, Any]]:
        """Of this batch's outputs, sorted."""
        manifest = self.folder / MANIFEST
        if not manifest.is_file():
            raise FormatError("is gone, so what became of single outputs is not known", path=manifest)
        for row in read_manifest(manifest):
            if row.output in self._summary.became:
                yield _row(*self._summary.became[row.output], row)

    def totals(self) -> dict[str, Any]:
        """Plain values of the whole batch: the last line that ``--json`` prints."""
        return {
            "folder": address(self.folder) or str(self.folder),
            "left_out": len(self._batch.left_out),
            "notes": list(self.notes),
            **self._summary.to_dict(),
            **({} if self.report is None else {"report": str(self.report)}),
        }


def _left_out(batch: Batch) -> str:
    kinds = Counter(kind.value for _, kind in batch.left_out)
    listed = ", ".join(f"{count} {kind}{'s' if count > 1 else ''}" for kind, count in kinds.items())
    return f"; left out: {listed}" if listed else ""
