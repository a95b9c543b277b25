"""`xosc-lateral evaluate`: how true a profile is to measured drives."""

from __future__ import annotations

from typing import Annotated

import typer

from xosc_lateral.cli.words import (
    AsJson,
    Columns,
    Force,
    Library,
    MappingFile,
    Profile,
    Quiet,
    Seed,
    Tables,
    examples,
    mapped,
    say,
)


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    epilog = examples("evaluate drives.csv.gz -p mine.json --report evaluation.html")
    app.command("evaluate", short_help="Score a profile on measured drives.", epilog=epilog)(evaluate)


def evaluate(
    tables: Tables,
    profile: Profile,
    report: Annotated[str | None, typer.Option(metavar="PAGE.html", help="Write a report with figures.")] = None,
    seed: Seed = 0,
    classify: Annotated[bool, typer.Option(help="Also train classifiers (extra `classifier`).")] = True,
    columns: Columns = None,
    mapping_file: MappingFile = None,
    library: Library = None,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Score a profile on measured drives, beside other real drivers: metrics, spectrum, classifiers."""
    from xosc_lateral import evaluate
    from xosc_lateral.api.convert import REPORT_SUFFIXES
    from xosc_lateral.formats.output_paths import claim, output_file

    page = None if report is None else output_file(report, "evaluation.html", REPORT_SUFFIXES)
    claim([page], tables, force=force)
    mapping = mapped(columns, mapping_file)
    result = evaluate(profile, tables, seed=seed, classify=classify, columns=mapping, library=library or ())
    if page is not None:
        result.write_report(page, force=force)
    say(result, as_json=as_json, quiet=quiet)
