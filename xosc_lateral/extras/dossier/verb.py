"""`xosc-lateral dossier`: evidence for an assessor."""

from __future__ import annotations

from typing import Annotated

import typer

import xosc_lateral as xl
from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Options, Writing, command

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()


@command(
    app, "dossier", VERBS["dossier"],
    "dossier motorway -o dossier.html", "dossier motorway --recompute",
    "dossier enriched/ -o dossier.html --claims ours.toml",
)
def dossier(
    subject: Annotated[str, typer.Argument(metavar="PROFILE|FOLDER",
        help="Profile's name or path, or a folder of outputs with its manifest.", show_default=False)],
    *,
    output: Annotated[str | None, typer.Option("--output", "-o", metavar="PAGE.html",
        help="Page; the same as JSON goes beside it.")] = None,
    options: Annotated[Options, xl.dossier],
    reply: Writing,
) -> None:
    """Claims with tests and figures, validity, data, anomalies, tool classification; exit 1: a claim is broken."""
    result = xl.dossier(subject, **options)
    if output is not None:
        result.write_report(output, force=reply.force)
    reply.say(result, even=bool(result.broken))
    if result.broken:
        raise typer.Exit(1)
