"""`xosc-lateral close-loop`: find and add what a profile lacks; how far it is."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from xosc_lateral.cli.words import (
    AsJson,
    Columns,
    Force,
    Library,
    MappingFile,
    Quiet,
    Seed,
    Tables,
    examples,
    mapped,
    pairs,
    say,
)


@contextmanager
def shown_progress(title: str) -> Iterator[Callable[[float, str], None]]:
    """Give a function that takes the share done (0..1) and what is being done; silent when stderr is no terminal."""
    if not sys.stderr.isatty():
        yield lambda share, what: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[what]}"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=1.0, what="")
        yield lambda share, what: bar.update(task, completed=share, what=what)


@contextmanager
def no_progress() -> Iterator[Callable[[float, str], None]]:
    """The same for who does not want to see any."""
    yield lambda share, what: None


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    epilog = examples(
        "close-loop drives.csv.gz -o refined.json --report loop/",
        "close-loop drives.csv.gz -p motorway -o refined.json --report loop/",
    )
    app.command("close-loop", short_help="Find and add what a profile lacks.", epilog=epilog)(close_loop)


def close_loop(
    tables: Tables,
    output: Annotated[str, typer.Option("--output", "-o", metavar="REFINED.json", help="Profile to write.")],
    report: Annotated[Path, typer.Option(metavar="DIR", help="Folder for report.json and report.html.")],
    profile: Annotated[
        str | None,
        typer.Option("--profile", "-p", metavar="NAME|PATH", help="Profile to start from; default: one is fitted."),
    ] = None,
    seed: Seed = 0,
    leave_out: Annotated[
        list[str] | None, typer.Option(metavar="COLUMN", help="Context column to ignore; may be repeated.")
    ] = None,
    role: Annotated[
        list[str] | None,
        typer.Option(
            metavar="COLUMN=ROLE",
            help="What a column is: road, weather, traffic, time, own, driver or unknown; may be repeated.",
        ),
    ] = None,
    columns: Columns = None,
    mapping_file: MappingFile = None,
    library: Library = None,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Find what a profile fails to reproduce, trace it to effects, add them, and score the result on held-out data."""
    from xosc_lateral import close_loop, write_profile
    from xosc_lateral.api.loop import ClosedLoop
    from xosc_lateral.api.profiles import PROFILE_SUFFIXES
    from xosc_lateral.cli.close_loop import no_progress, shown_progress
    from xosc_lateral.formats.output_paths import claim, output_file, output_folder

    written = output_file(output, "refined.json", PROFILE_SUFFIXES)
    claim([written, *ClosedLoop.report_files(output_folder(report))], tables, force=force)
    with no_progress() if quiet else shown_progress("closing the loop") as progress:
        result = close_loop(
            tables,
            profile,
            seed=seed,
            name=written.stem,
            leave_out=leave_out or (),
            roles=pairs(role, "--role"),
            columns=mapped(columns, mapping_file),
            library=library or (),
            progress=progress,
        )
    write_profile(result.profile, written, force=force)
    result.write_report(report, force=force)
    say(result, as_json=as_json, quiet=quiet)
