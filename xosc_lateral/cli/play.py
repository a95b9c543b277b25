"""`xosc-lateral play`: the nominal motion of a scenario as a table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("play")(play)


def play(
    scenario: Annotated[Path, typer.Argument(help="Maneuver-based scenario (.xosc).", show_default=False)],
    output: Annotated[Path, typer.Option("--output", "-o", help="CSV table to write.", show_default=False)],
    step: Annotated[float, typer.Option(help="Length of a frame [s].", min=0.001, max=1.0)] = 0.02,
    time_limit: Annotated[
        float, typer.Option(help="End of a scenario that does not end by itself [s].", min=0.0, max=86_400)
    ] = 60.0,
) -> None:
    """Play a scenario and write where every entity is at every step; what was not played is named on stderr."""
    from xosc_lateral.formats.atomic import refuse_targets
    from xosc_lateral.formats.states import write_states
    from xosc_lateral.pipeline.load import play_scenario

    played = play_scenario(scenario, step=step, time_limit=time_limit)
    refuse_targets([output], [*played.scenario.input_files, played.scenario.road_file or scenario])
    write_states(played.motion, played.network, output)
    for note in played.motion.notes:
        typer.echo(str(note), err=True)
