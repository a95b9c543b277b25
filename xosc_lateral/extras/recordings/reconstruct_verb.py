"""`xosc-lateral reconstruct`: from a recording to a maneuver-based scenario."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import xosc_lateral as xl
from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Mapped, Options, Writing, command
from xosc_lateral.extras.recordings.settings import ReconstructSettings

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
    mapped: Mapped,
    settings: Annotated[Options, ReconstructSettings],
    reply: Writing,
) -> None:
    """Turn a recording into maneuvers, its road, and the drivers who drove."""
    reply.say(xl.reconstruct(recording, output, columns=mapped.mapping(), **settings, force=reply.force))
