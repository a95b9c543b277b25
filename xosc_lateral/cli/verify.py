"""`xosc-lateral verify`: whether outputs are what would be made today."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from xosc_lateral.cli.words import AsJson, Library, Quiet, examples, say

EXAMPLES = examples("verify enriched/", "verify lifelike.xosc --json")


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("verify", short_help="Whether outputs are what would be made today.", epilog=EXAMPLES)(verify)


def verify(
    outputs: Annotated[
        list[Path],
        typer.Argument(
            metavar="OUTPUT...", help="Converted scenarios, or folders with a manifest.", show_default=False
        ),
    ],
    library: Library = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Name outputs that were edited, whose inputs have changed, or that another version made; exit code 1 then."""
    from xosc_lateral import verify as check

    result = check(outputs, library=library or ())
    say(result, as_json=as_json, quiet=quiet and not result.failing)
    if result.failing:
        raise typer.Exit(1)
