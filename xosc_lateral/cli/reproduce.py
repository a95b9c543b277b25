"""`xosc-lateral reproduce`: make an output again from what it carries."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from xosc_lateral.cli.words import Allow, AsJson, Force, Library, Quiet, RoadPath, examples, say

EXAMPLES = examples("reproduce lifelike.xosc -o again.xosc", "reproduce enriched/ -o again/ --jobs 2")


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("reproduce", short_help="Make an output again from what it carries.", epilog=EXAMPLES)(reproduce)


def reproduce(
    output: Annotated[
        Path,
        typer.Argument(metavar="OUTPUT", help="Converted scenario, or a folder with a manifest.", show_default=False),
    ],
    new: Annotated[str, typer.Option("--output", "-o", help="File or folder to write to.", show_default=False)],
    library: Library = None,
    allow: Allow = None,
    road_path: RoadPath = None,
    jobs: Annotated[int, typer.Option(help="Of a folder: number of processes; -1: one per core.")] = 1,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Make an output, or a folder of them, again and compare the content; exit code 1 if it differs."""
    from xosc_lateral import reproduce as again

    if jobs == 0 or jobs < -1:
        raise typer.BadParameter("at least 1, or -1 for one per core", param_hint="--jobs")
    found = {"library": library or (), "allow": allow or (), "road_path": road_path or ()}
    result = again(output, new, **found, workers=jobs, force=force)
    say(result, as_json=as_json, quiet=quiet and not result.failing)
    if result.failing:
        raise typer.Exit(1)
