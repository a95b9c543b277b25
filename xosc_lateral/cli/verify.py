"""`xosc-lateral verify`: whether outputs are what would be made today; `reproduce`: make one again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Allow, Library, Printing, RoadPath, Written, command

app = group_of_verbs()


@command(app, "verify", VERBS["verify"], "verify enriched/", "verify lifelike.xosc --json")
def verify(
    outputs: Annotated[
        list[Path],
        typer.Argument(
            metavar="OUTPUT...", help="Converted scenarios, or folders with a manifest.", show_default=False
        ),
    ],
    *,
    library: Library = None,
    allow: Allow = None,
    road_path: RoadPath = None,
    fast: Annotated[bool, typer.Option("--fast", help="Compare hashes alone; make nothing again.")] = False,
    jobs: Annotated[int, typer.Option(help="Number of processes; -1: one per core.")] = 1,
    said: Printing,
) -> None:
    """Make outputs again in memory and name those that differ, and why: edited, other inputs, another version."""
    from xosc_lateral import verify as check

    if jobs == 0 or jobs < -1:
        raise typer.BadParameter("at least 1, or -1 for one per core", param_hint="--jobs")
    places = {"library": library or (), "allow": allow or (), "road_path": road_path or ()}
    result = check(outputs, **places, fast=fast, workers=0 if jobs == 1 else jobs)
    said.say(result, even=bool(result.failing))
    if result.failing:
        raise typer.Exit(1)


@command(
    app, "reproduce", VERBS["reproduce"],
    "reproduce lifelike.xosc -o again.xosc", "reproduce enriched/ -o again/ --jobs 2",
)  # fmt: skip
def reproduce(
    output: Annotated[
        Path,
        typer.Argument(metavar="OUTPUT", help="Converted scenario, or a folder with a manifest.", show_default=False),
    ],
    new: Annotated[str, typer.Option("--output", "-o", help="File or folder to write to.", show_default=False)],
    *,
    library: Library = None,
    allow: Allow = None,
    road_path: RoadPath = None,
    jobs: Annotated[int, typer.Option(help="Of a folder: number of processes; -1: one per core.")] = 1,
    said: Written,
) -> None:
    """Make an output, or a folder of them, again and compare the content; exit code 1 if it differs."""
    from xosc_lateral import reproduce as again

    if jobs == 0 or jobs < -1:
        raise typer.BadParameter("at least 1, or -1 for one per core", param_hint="--jobs")
    found = {"library": library or (), "allow": allow or (), "road_path": road_path or ()}
    result = again(output, new, **found, workers=jobs, force=said.force)
    said.say(result, even=bool(result.failing))
    if result.failing:
        raise typer.Exit(1)
