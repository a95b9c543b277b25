"""`xosc-lateral play`: the nominal motion as a table; `segments` of it; `view`: as a page; `template`: to start."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

import xosc_lateral as xl
from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import (
    Force,
    Options,
    Osi,
    Printing,
    Quiet,
    Verbose,
    Written,
    command,
    pairs,
    say,
    say_json,
    warn,
    write_stdout,
)

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()

Scenario = Annotated[Path, typer.Argument(help="Maneuver-based scenario (.xosc).", show_default=False)]


@command(
    app, "play", VERBS["play"],
    "play cut-in.xosc -o states.csv", "play cut-in.xosc --osi cut-in_gt.mcap", "play cut-in.xosc -o states.parquet",
    "play cut-in.xosc -o - | head",
)
def play(
    scenario: Scenario, *,
    output: Annotated[str | None, typer.Option("--output", "-o", help="Table: .csv, .csv.gz, .parquet, folder/, - .",
        show_default=False)] = None,
    osi: Osi = None,
    options: Annotated[Options, xl.play],
    reply: Written,
) -> None:
    """Play a scenario without offsets and write every entity's position at every step."""
    if output is None and osi is None:
        raise typer.BadParameter("a table or, with --osi, a trace has to be named", param_hint="--output")
    from xosc_lateral.files.atomic import together

    stem = scenario.stem
    table, trace = reply.claim([scenario], table=(output, f"{stem}.csv"), trace=(osi, f"{stem}_gt.mcap"))
    played = xl.play(scenario, **options)
    with together():
        if table is not None:
            played.write(table, force=reply.force)
        elif output is not None:
            write_stdout(played.csv())
        if trace is not None:
            played.write_osi(trace, force=reply.force)
    if reply.as_json:
        traces = {} if trace is None else {"osi": str(trace)}
        say_json({"output": None if table is None else str(table), **traces, **played.to_dict()})
    elif not reply.quiet:
        for note in played.notes:
            say(note, err=True)
    warn(played.warnings)
    if options["strict"] and reply.quiet:
        warn(played.doubts)
    if options["strict"] and (played.warnings or played.doubts):
        raise typer.Exit(1)


@command(app, "segments", VERBS["segments"], "segments cut-in.xosc", "segments cut-in.xosc --json")
def segments(
    scenario: Scenario, *, options: Annotated[Options, xl.segments], reply: Printing,
) -> None:
    """List each entity's road-following segments, and the reason for everything else."""
    played = xl.play(scenario, **options)
    listed = xl.segments(played)
    warn(played.warnings)
    reply.say(listed)


@command(
    app, "view", VERBS["view"],
    "view cut-in.xosc", "view cut-in_lifelike.xosc -o pages/",
)
def view(
    scenario: Annotated[Path, typer.Argument(help="Any scenario (.xosc), converted or not.", show_default=False)], *,
    output: Annotated[str | None, typer.Option("--output", "-o",
        help="Page to write; default: NAME_view.html beside it.")] = None,
    options: Annotated[Options, xl.segments],
    open_page: Annotated[bool | None, typer.Option("--open/--no-open",
        help="Open the page in the browser. Default: from a terminal.")] = None,
    force: Force = False, quiet: Quiet = False, verbose: Verbose = False,
) -> None:
    """Play any scenario in the browser, on one self-contained page; adds no lateral movement."""
    played = xl.play(scenario, **options)
    page = played.write_page(output or scenario.with_name(f"{scenario.stem}_view.html"), force=force)
    warn(played.warnings)
    if not quiet:
        say(str(page))
    if open_page or (open_page is None and sys.stdout.isatty()):
        typer.launch(page.absolute().as_uri())


group = typer.Typer(help="Maneuver-based motorway scenarios to start from.", no_args_is_help=True)
app.add_typer(group, name="template", short_help=VERBS["template"])


@command(group, "list", "Templates, or one template's settings.", "template list cut-in")
def list_(
    name: Annotated[str | None, typer.Argument(help="Show this template's settings.", show_default=False)] = None,
    *, reply: Printing,
) -> None:
    """List the templates, or one template's settings with units, defaults and ranges."""
    reply.say(xl.list_templates(name))


@command(group, "write", "Write a scenario and its road.", "template write cut-in -o out/ --set ego_speed=28")
def write(
    name: Annotated[str, typer.Argument(help="Template; `template list` names them.", show_default=False)],
    *,
    output: Annotated[str, typer.Option("--output", "--out", "-o", help="Folder to write to.", show_default=False)],
    settings: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE",
        help="Change a setting; may be repeated.")] = None,
    reply: Written,
) -> None:
    """Write a template's scenario and its road."""
    chosen: dict[str, str] = pairs(settings, "--set")
    written = xl.write_template(name, output, force=reply.force, **chosen)
    reply.say_written(written, template=name, settings=chosen)
