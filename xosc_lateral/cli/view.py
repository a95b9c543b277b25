"""`xosc-lateral view`: look at a scenario."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from xosc_lateral.cli.words import Allow, Force, Parameters, Quiet, TimeLimit, examples, pairs, warn

EXAMPLES = examples("view cut-in.xosc", "view cut-in_lifelike.xosc -o pages/")


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("view", short_help="Play a scenario in the browser.", epilog=EXAMPLES)(view)


def view(
    scenario: Annotated[Path, typer.Argument(help="Any scenario (.xosc), converted or not.", show_default=False)],
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", help="Page to write; default: NAME_view.html beside it."),
    ] = None,
    parameter: Parameters = None,
    allow: Allow = None,
    time_limit: TimeLimit = None,
    open_page: Annotated[
        bool | None, typer.Option("--open/--no-open", help="Open the page in the browser. Default: from a terminal.")
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Play any scenario in the browser, on one self-contained page; adds no lateral movement."""
    from xosc_lateral import play

    played = play(scenario, time_limit=time_limit, parameters=pairs(parameter, "--set"), allow=allow or ())
    page = played.write_page(output or scenario.with_name(f"{scenario.stem}_view.html"), force=force)
    warn(played.warnings)
    if not quiet:
        typer.echo(str(page))
    if open_page or (open_page is None and sys.stdout.isatty()):
        typer.launch(page.absolute().as_uri())
