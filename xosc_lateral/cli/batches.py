"""What `convert` does with more than one scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import typer

from xosc_lateral.cli.words import say_json, warn


def is_batch(inputs: Sequence[str]) -> bool:
    """Whether the inputs stand for more than one scenario: several, a folder, a glob, a table, a distribution."""
    from xosc_lateral.pipeline.request import is_single

    return len(inputs) != 1 or not is_single(inputs[0])


def convert_batch(
    inputs: Sequence[str],
    output: str | None,
    settings: Mapping[str, Any],
    *,
    strict: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Convert all of them; exit code 1 if any failed, or with `strict` if anything is to be said of any."""
    from xosc_lateral.api.batch import convert_many

    if output is None or output == "-":
        raise typer.BadParameter("several scenarios need a folder for their outputs: -o FOLDER", param_hint="-o")
    finished = 0

    def show(row: Mapping[str, Any]) -> None:
        nonlocal finished
        finished += row["state"] != "failed"
        if as_json:
            say_json({"kind": "output", **row})

    try:
        result = convert_many(list(inputs), output, on_outcome=show, **settings)
    except KeyboardInterrupt:
        typer.echo(
            f"\nxosc-lateral: interrupted; {finished} outputs in {output} are finished, and the same command continues",
            err=True,
        )
        raise typer.Exit(130) from None
    if as_json:
        say_json({"kind": "summary", **result.totals()})
    elif not quiet:
        typer.echo(str(result))
    if result.cut_off and (quiet or as_json):
        warn([f"{len(result.cut_off)} runs end at the time limit, not by themselves: {result.cut_off[0]} is one"])
    if result.failed or (strict and (result.with_warnings or result.nobody_enriched)):
        raise typer.Exit(1)
