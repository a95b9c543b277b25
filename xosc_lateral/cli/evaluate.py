"""`xosc-lateral evaluate`: how true a profile is to measured drives."""

from __future__ import annotations

from typing import Annotated

import typer

from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Library, Mapped, Profile, Seed, Tables, Written, command

app = group_of_verbs()


@command(app, "evaluate", VERBS["evaluate"], "evaluate drives.csv.gz -p mine.json --report evaluation.html")
def evaluate(
    tables: Tables,
    *,
    profile: Profile,
    report: Annotated[str | None, typer.Option(metavar="PAGE.html", help="Write a report with figures.")] = None,
    seed: Seed = 0,
    classify: Annotated[bool, typer.Option(help="Also train classifiers (extra `classifier`).")] = True,
    mapped: Mapped,
    library: Library = None,
    said: Written,
) -> None:
    """Score a profile on measured drives, beside other real drivers: metrics, spectrum, classifiers."""
    from xosc_lateral import evaluate
    from xosc_lateral.files.output_paths import claim, output_file
    from xosc_lateral.workflows.result import PAGE_SUFFIXES

    page = None if report is None else output_file(report, "evaluation.html", PAGE_SUFFIXES)
    claim([page], tables, force=said.force)
    result = evaluate(profile, tables, seed=seed, classify=classify, columns=mapped.mapping(), library=library or ())
    if page is not None:
        result.write_report(page, force=said.force)
    said.say(result)
