"""`xosc-lateral states`: the nominal motion as a table; `segments` of it; `view`: as a page; `template`: to start."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

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
    Writing,
    command,
    naming_option,
    pairs,
    refuse_warnings,
    say,
    say_json,
    write_stdout,
)
from xosc_lateral.files.source import changes

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()



def _played(scenario: Path, options: Mapping[str, Any]) -> xl.Playback:
    """Within the limits of a batch's scenario: no file keeps a verb busy for ever."""
    from xosc_lateral.workflows.batch.workers import for_one

    return for_one(lambda path: xl.play(path, **options), scenario)


Scenario = Annotated[Path, typer.Argument(help="Maneuver-based scenario (.xosc).", show_default=False)]


@command(
    app, "states", VERBS["states"],
    "states cut-in.xosc -o states.csv", "states cut-in.xosc --osi cut-in_gt.mcap",
    "states cut-in.xosc -o states.parquet", "states cut-in.xosc -o - | head",
)
def states(
    scenario: Scenario, *,
    output: Annotated[str | None, typer.Option("--output", "-o", help="Table: .csv, .csv.gz, .parquet, folder/, - .",
        show_default=False)] = None,
    osi: Osi = None,
    options: Annotated[Options, xl.play],
    reply: Writing,
) -> None:
    """Play a scenario without offsets and write every entity's position at every step."""
    if output is None and osi is None:
        raise typer.BadParameter("a table or, with --osi, a trace has to be named", param_hint="--output")
    from xosc_lateral.files.atomic import together

    stem = scenario.stem
    table, trace = reply.claim([scenario], table=(output, f"{stem}.csv"), trace=(osi, f"{stem}_gt.mcap"))
    played = _played(scenario, options)
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
    reply.warn(played.warnings, strict=options["strict"])
    refuse_warnings(played.warnings, options["strict"])


@command(app, "segments", VERBS["segments"], "segments cut-in.xosc", "segments cut-in.xosc --json")
def segments(
    scenario: Scenario, *, options: Annotated[Options, xl.segments], reply: Printing,
) -> None:
    """List each entity's road-following segments, and the reason for everything else."""
    played = _played(scenario, options)
    listed = xl.segments(played)
    reply.say(listed)
    if reply.as_json or reply.quiet:
        reply.warn(listed.warnings, strict=options["strict"])
    refuse_warnings(listed.warnings, options["strict"])


@command(
    app, "view", VERBS["view"],
    "view cut-in.xosc", "view cut-in_lifelike.xosc -o pages/", "view cut-in.xosc --image moment.svg --at 8.5",
)
def view(
    scenario: Annotated[Path, typer.Argument(help="Any scenario (.xosc), converted or not.", show_default=False)], *,
    output: Annotated[str | None, typer.Option("--output", "-o",
        help="Page to write; default: NAME_view.html beside it, unless a picture is asked for.")] = None,
    image: Annotated[str | None, typer.Option(metavar="FILE.svg|.png",
        help="Picture of a moment; PNG: extra pictures.")] = None,
    at: Annotated[float | None, typer.Option(help="Its time [s]; default: half of the run.", min=0.0)] = None,
    animation: Annotated[str | None, typer.Option(metavar="FILE.gif", help="The run; extra pictures.")] = None,
    watch: Annotated[bool, typer.Option("--watch", help="Write again whenever a file that is read changes.")] = False,
    options: Annotated[Options, xl.segments],
    open_page: Annotated[bool | None, typer.Option("--open/--no-open",
        help="Open the page in the browser. Default: from a terminal.")] = None,
    force: Force = False, quiet: Quiet = False, verbose: Verbose = False,
) -> None:
    """Play any scenario in the browser, on one self-contained page; adds no lateral movement."""
    from xosc_lateral.files.atomic import together

    if at is not None and image is None:
        raise typer.BadParameter("is the time of a picture, see --image", param_hint="--at")
    usual = None if image or animation else scenario.with_name(f"{scenario.stem}_view.html")

    def write(force: bool) -> tuple[xl.Playback, Path | None]:
        played = _played(scenario, options)
        page = output or usual
        with together():
            written = [None if page is None else played.write_page(page, force=force)]
            with naming_option("--at"):
                written += [] if image is None else [played.write_image(image, at, force=force)]
            with naming_option("--animation"):
                written += [] if animation is None else [played.write_animation(animation, force=force)]
        Printing(quiet).warn(played.warnings, strict=options.get("strict", False))
        for path in written if not quiet else ():
            if path is not None:
                say(path)
        return played, written[0]

    played, page = write(force)
    if page is not None and (open_page or (open_page is None and sys.stdout.isatty())):
        typer.launch(page.absolute().as_uri())
    if watch:
        for _ in changes(played.files):
            try:
                write(True)
            except xl.XoscLateralError as error:  # a file that is being edited may be broken for a while
                say(error, err=True)
    refuse_warnings(played.warnings, options.get("strict", False))


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
    reply: Writing,
) -> None:
    """Write a template's scenario and its road."""
    chosen: dict[str, str] = pairs(settings, "--set")
    written = xl.write_template(name, output, force=reply.force, **chosen)
    reply.say_written(written, template=name, settings=chosen)
