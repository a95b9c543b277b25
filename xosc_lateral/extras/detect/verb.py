"""`xosc-lateral detect` and `vary`: what cut-in detectors do, on families of cut-ins and on measured traffic."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import xosc_lateral as xl
from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.play import Scenario
from xosc_lateral.cli.words import Options, Writing, command, naming_option

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()


@command(
    app, "detect", VERBS["detect"],
    "detect cut-in.xosc --variants 5 -p motorway --detector lateral-speed:threshold=0.15,hold=0.4",
    "detect scenarios/ drives.parquet -o table.csv --report detectors.html",
    "detect recording.csv --road road.xodr --detector logistic --home scenarios/ --sensor usual",
    'detect cut-in.xosc --ego Ego --detector "python mine.py"',
    "detect cut-in.xosc --like motorway --count 2 -o cut-ins.csv --report cut-ins.html",
)
def detect(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...",
        help="Scenarios, folders, drive tables, recordings.", show_default=False)],
    *,
    output: Annotated[str | None, typer.Option("--output", "-o", metavar="TABLE",
        help="Every threshold, with --like every cut-in: .csv, .csv.gz, .parquet.")] = None,
    report: Annotated[str | None, typer.Option(metavar="PAGE.html", help="Page with curves and worst cases.")] = None,
    options: Annotated[Options, xl.detect],
    reply: Writing,
) -> None:
    """Count false alarms in lane keeping, cut-ins seen and the time before the marking, source by source."""
    from xosc_lateral.files.atomic import together

    table, page = reply.claim(sources, table=(output, "detection.csv"), page=(report, "detection.html"))
    with naming_option("--detector"):
        result = xl.detect(sources, **options)
    with together():
        if table is not None:
            result.write(table, force=reply.force)
        if page is not None:
            result.write_report(page, force=reply.force)
    reply.say(result)
    if not getattr(result, "is_set", True):  # what was asked for could not be had, and is said above
        raise typer.Exit(1)


@command(
    app, "vary", VERBS["vary"],
    "vary cut-in.xosc --like motorway -n 200 -o varied/", "convert varied/cut-in-like-motorway.xosc -o out/",
)
def vary(
    scenario: Scenario, *,
    output: Annotated[str, typer.Option("--output", "-o", help="Folder to write to.", show_default=False)],
    options: Annotated[Options, xl.vary],
    reply: Writing,
) -> None:
    """Write variations of a scenario in which lane changes last as long as those of a profile's drivers.

    Drawn are durations (rates, where those are stated), for the gap to the vehicle ahead; with --speeds, changes of
    speed. Who changes lanes, when and where to stays the scenario's: neither gaps nor how often are drawn, nor lane
    changes that are given up. What is shorter than real drivers take is varied about itself.
    """
    reply.say(xl.vary(scenario, output, **options, force=reply.force))
