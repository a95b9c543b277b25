"""`xosc-lateral segments`: road-following segments per entity, and why the rest is none."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from xosc_lateral.cli.words import Allow, AsJson, Parameters, Quiet, TimeLimit, examples, pairs, say, warn


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    epilog = examples("segments cut-in.xosc", "segments cut-in.xosc --json")
    app.command("segments", short_help="Where offsets are sampled, and why not elsewhere.", epilog=epilog)(segments)


def segments(
    scenario: Annotated[Path, typer.Argument(help="Maneuver-based scenario (.xosc).", show_default=False)],
    time_limit: TimeLimit = None,
    parameter: Parameters = None,
    allow: Allow = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """List each entity's road-following segments, and the reason for everything else."""
    from xosc_lateral import play, segments

    played = play(scenario, time_limit=time_limit, parameters=pairs(parameter, "--set"), allow=allow or ())
    found = segments(played)
    warn(played.warnings)
    say(found, as_json=as_json, quiet=quiet)
