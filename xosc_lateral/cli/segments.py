"""`xosc-lateral segments`: road-following segments per entity, and why the rest is none."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("segments")(segments)


def segments(
    scenario: Annotated[Path, typer.Argument(help="Maneuver-based scenario (.xosc).", show_default=False)],
    time_limit: Annotated[
        float, typer.Option(help="End of a scenario that does not end by itself [s].", min=0.0, max=86_400)
    ] = 60.0,
    as_json: Annotated[bool, typer.Option("--json", help="For machines.")] = False,
) -> None:
    """Name each entity's road-following segments, and why the rest is none."""
    from xosc_lateral.pipeline.load import play_scenario
    from xosc_lateral.pipeline.segments import scenario_segments
    from xosc_lateral.report.segments import as_text, to_json

    found = scenario_segments(play_scenario(scenario, time_limit=time_limit))
    typer.echo(to_json(found) if as_json else as_text(found))
