"""`xosc-lateral close-loop`: find and add what a profile lacks; how far it is."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from logging import getLogger
from pathlib import Path
from typing import Annotated

import typer

import xosc_lateral as xl
from xosc_lateral.base.signals import Interrupted
from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Options, Tables, Writing, command, say

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()


@contextmanager
def shown_progress(title: str, quiet: bool) -> Iterator[Callable[[float, str], None]]:
    """Give a function that takes the share done (0..1) and what is being done, for the log and a bar on a terminal."""
    log, phase = getLogger(__name__), title

    def note(share: float, what: str) -> None:
        nonlocal phase
        phase = what
        log.info("%s: %s (%.0f %%)", title, what, 100.0 * share)

    try:
        if quiet or not sys.stderr.isatty():
            yield note
            return
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        times = TextColumn("so far"), TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn()
        columns = TextColumn("{task.description}:"), TextColumn("{task.fields[what]}"), BarColumn(), *times
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(title, total=1.0, what="")

            def show(share: float, what: str) -> None:
                note(share, what)
                bar.update(task, completed=share, what=what)

            yield show
    except (KeyboardInterrupt, Interrupted):
        say(f"xosc-lateral: stopped at: {phase}; nothing is written yet", err=True)
        raise


@command(
    app, "close-loop", VERBS["close-loop"],
    "close-loop drives.csv.gz -o refined.json --report loop/",
    "close-loop drives.csv.gz -p motorway -o refined.json --report loop/",
    "close-loop drives.csv.gz --plan",
)
def close_loop(
    tables: Tables, *,
    output: Annotated[str, typer.Option("--output", "-o", metavar="REFINED.json", help="Profile to write.")] = "",
    report: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for report.json and report.html.")] = None,
    plan: Annotated[bool, typer.Option("--plan",
        help="Say what these drives can show, and seek no effect; nothing is written.")] = False,
    options: Annotated[Options, xl.close_loop],
    reply: Writing,
) -> None:
    """Find what a profile fails to reproduce, trace it to effects, add them, and score the result on held-out data."""
    from xosc_lateral.extras.loop.call import ClosedLoop
    from xosc_lateral.files.atomic import together
    from xosc_lateral.files.output_paths import claim, output_file, output_folder
    from xosc_lateral.workflows.result import PROFILE_SUFFIXES

    if plan:
        asked = {name: options[name] for name in ("seed", "leave_out", "roles", "columns") if name in options}
        reply.say(xl.plan_loop(tables, **asked))
        return
    if not output or report is None:
        raise typer.BadParameter("both are needed, or --plan", param_hint="'--output' and '--report'")
    written = output_file(output, "refined.json", PROFILE_SUFFIXES)
    claim([written, *ClosedLoop.report_files(output_folder(report))], tables, force=reply.force)
    with shown_progress("closing the loop", reply.quiet) as progress:
        result = xl.close_loop(tables, name=written.stem, progress=progress, **options)
    with together():
        xl.write_profile(result.profile, written, force=reply.force)
        result.write_report(report, force=reply.force)
    reply.say(result)
