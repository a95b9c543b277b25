"""`xosc-lateral reconstruct`: from a recording to a maneuver-based scenario."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Library, Mapped, Written, command

app = group_of_verbs()


@command(
    app, "reconstruct", VERBS["reconstruct"],
    "reconstruct tasi-0.15.4-py3-none-any.whl -o a39/ --from 60 --to 120",
    "reconstruct tracks.csv --road road.xodr -o out/ --around 17 --host 17 --relative",
    "convert out/drivers.csv -o twins/ --variants 20",
)  # fmt: skip
def reconstruct(
    recording: Annotated[Path, typer.Argument(help="Tracks of several vehicles.", show_default=False)],
    *,
    output: Annotated[str, typer.Option("--output", "-o", help="Folder to write to.", show_default=False)],
    format_: Annotated[
        str | None,
        typer.Option(
            "--format", help="dlr-ht, levelx, osi, commonroad, tracks; default: by the name.", show_default=False
        ),
    ] = None,
    road: Annotated[
        Path | None, typer.Option("--road", help="OpenDRIVE file that it was recorded on.", show_default=False)
    ] = None,
    mapped: Mapped,
    begin: Annotated[float | None, typer.Option("--from", help="Begin there [s].", show_default=False)] = None,
    end: Annotated[float | None, typer.Option("--to", help="End there [s].", show_default=False)] = None,
    vehicles: Annotated[
        list[str] | None, typer.Option("--vehicles", metavar="ID", help="This vehicle alone; may be repeated.")
    ] = None,
    around: Annotated[
        str | None, typer.Option(metavar="ID", help="This vehicle and those who come near it.", show_default=False)
    ] = None,
    window: Annotated[float, typer.Option(help="Length of the part that --around takes [s].", min=1, max=3600)] = 60.0,
    host: Annotated[str | None, typer.Option(metavar="ID", help="The vehicle under test.", show_default=False)] = None,
    error: Annotated[
        float,
        typer.Option(help="Positions along the road are within this [m]: the smaller, the more corners.", min=0.01),
    ] = 0.5,
    version: Annotated[str, typer.Option(metavar="1.0..1.3", help="Version of OpenSCENARIO to write.")] = "1.2",
    relative: Annotated[
        bool, typer.Option("--relative", help="Cut-ins and braking begin at a distance to another vehicle.")
    ] = False,
    exact: Annotated[bool, typer.Option("--exact", help="Recorded paths as trajectories, no maneuvers.")] = False,
    fit: Annotated[bool, typer.Option("--fit", help="Fit a profile to everybody who drove long enough.")] = False,
    library: Library = None,
    said: Written,
) -> None:
    """Turn a recording into maneuvers, its road, and the drivers who drove."""
    from xosc_lateral.api.reconstruct import reconstruct as make

    try:
        made = make(
            recording,
            output,
            format=format_,
            road=road,
            columns=mapped.mapping(),
            begin=begin,
            end=end,
            vehicles=vehicles or None,
            around=around,
            window=window,
            host=host,
            error=error,
            version=version,
            relative=relative,
            exact=exact,
            fit=fit,
            library=library or (),
            force=said.force,
        )
    except ValueError as wrong:
        from xosc_lateral.errors import XoscLateralError

        if isinstance(wrong, XoscLateralError):
            raise
        raise typer.BadParameter(str(wrong), param_hint="--version") from wrong
    said.say(made)
