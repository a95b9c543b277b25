"""`xosc-lateral reconstruct`: from a recording to a maneuver-based scenario."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Mapped, Written, command
from xosc_lateral.workflows.recordings.settings import ReconstructSettings

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()


@command(
    app, "reconstruct", VERBS["reconstruct"],
    "reconstruct tasi-0.15.4-py3-none-any.whl -o a39/ --from 60 --to 120",
    "reconstruct tracks.csv --road road.xodr -o out/ --around 17 --host 17 --relative",
    "convert out/drivers.csv -o twins/ --variants 20",
)
def reconstruct(
    recording: Annotated[Path, typer.Argument(help="Tracks of several vehicles.", show_default=False)],
    *,
    output: Annotated[str, typer.Option("--output", "-o", help="Folder to write to.", show_default=False)],
    format_: Annotated[str | None, typer.Option("--format",
        help="dlr-ht, levelx, osi, commonroad, fcd, tracks; default: by the file.", show_default=False)] = None,
    road: Annotated[Path | None, typer.Option("--road",
        help="OpenDRIVE file, or SUMO network, that it was recorded on.", show_default=False)] = None,
    mapped: Mapped,
    settings: Annotated[dict[str, Any], ReconstructSettings],
    reply: Written,
) -> None:
    """Turn a recording into maneuvers, its road, and the drivers who drove."""
    from xosc_lateral import reconstruct as make

    columns = mapped.mapping()
    reply.say(make(recording, output, format=format_, road=road, columns=columns, force=reply.force, **settings))
