"""`xosc-lateral play`: the nominal motion of a scenario as a table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from xosc_lateral.cli.words import (
    Allow,
    AsJson,
    Force,
    Osi,
    Parameters,
    Quiet,
    Road,
    RoadPath,
    TimeLimit,
    examples,
    pairs,
    say_json,
    warn,
    write_stdout,
)

EXAMPLES = examples(
    "play cut-in.xosc -o states.csv",
    "play cut-in.xosc --osi cut-in_gt.mcap",
    "play cut-in.xosc -o states.parquet",
    "play cut-in.xosc -o - | head",
)


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("play", short_help="Write the nominal motion as a table.", epilog=EXAMPLES)(play)


def play(
    scenario: Annotated[Path, typer.Argument(help="Maneuver-based scenario (.xosc).", show_default=False)],
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", help="Table: .csv, .csv.gz, .parquet, folder/, - .", show_default=False),
    ] = None,
    osi: Osi = None,
    step: Annotated[float, typer.Option(help="Length of a frame [s].", min=0.001, max=1.0)] = 0.02,
    time_limit: TimeLimit = None,
    parameter: Parameters = None,
    allow: Allow = None,
    road: Road = None,
    road_path: RoadPath = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="A missing vehicle catalog, or a run cut off, is an error.")
    ] = False,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Play a scenario without offsets and write every entity's position at every step."""
    from xosc_lateral import play
    from xosc_lateral.formats.osi.extra import SUFFIXES, osi_wanted
    from xosc_lateral.formats.output_paths import STDOUT, claim, output_file
    from xosc_lateral.formats.output_tables import output_suffixes

    if output is None and osi is None:
        raise typer.BadParameter("a table or, with --osi, a trace has to be named", param_hint="--output")
    is_file = output is not None and output != STDOUT
    table = output_file(output, f"{scenario.stem}.csv", output_suffixes()) if output is not None and is_file else None
    trace = None if osi is None else output_file(osi, f"{scenario.stem}_gt.mcap", SUFFIXES)
    claim([table, trace], [scenario], force=force)
    osi_wanted(trace)
    played = play(
        scenario,
        step=step,
        time_limit=time_limit,
        parameters=pairs(parameter, "--set"),
        allow=allow or (),
        road=road,
        road_path=road_path or (),
        strict=strict,
    )
    written = None
    if output == STDOUT:
        write_stdout(played.csv())
    elif output is not None:
        written = played.write(output, force=force)
    if trace is not None:
        played.write_osi(trace, force=force)
    if as_json:
        traces = {} if trace is None else {"osi": str(trace)}
        say_json({"output": None if written is None else str(written), **traces, **played.to_dict()})
    elif not quiet:
        for note in played.notes:
            typer.echo(note, err=True)
    warn(played.warnings)
    if strict and played.warnings:
        raise typer.Exit(1)
