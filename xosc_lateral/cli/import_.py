"""`xosc-lateral import`: other people's recordings into the standard drive table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Source = Annotated[Path, typer.Argument(metavar="SOURCE", help="What to read.", show_default=False)]
Output = Annotated[Path, typer.Option("--output", "-o", metavar="TABLE", help="Drive table: .parquet, .csv, .csv.gz.")]
KeepCut = Annotated[bool, typer.Option("--keep-cut", help="Keep rows that are cut otherwise; column `state` says why.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the provenance as one line of JSON.")]


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    formats = typer.Typer(help="Other people's recordings into the standard drive table.", no_args_is_help=True)

    @formats.command("dlr-ht")
    def dlr_ht(
        source: Source,
        output: Output,
        max_gap: Annotated[
            float, typer.Option(help="Longest bridge between two cameras that is kept. [s]", min=0, max=60)
        ] = 1.0,
        keep_cut: KeepCut = False,
        as_json: AsJson = False,
    ) -> None:
        """DLR Highway Traffic: the wheel of tasi 0.15.4, the data set's zip, or its trajectory CSV."""
        from xosc_lateral.formats.importers.cuts import CutSettings
        from xosc_lateral.formats.importers.dlr_ht import import_dlr_ht
        from xosc_lateral.formats.importers.table import describe, write_imported

        imported = import_dlr_ht(source, CutSettings(max_gap=max_gap), keep_cut=keep_cut)
        write_imported(imported, output)
        typer.echo(describe(imported.provenance, as_json=as_json), err=not as_json)

    @formats.command("levelx")
    def levelx(source: Source, output: Output, keep_cut: KeepCut = False, as_json: AsJson = False) -> None:
        """HighD or exiD: a folder of recordings, or one XX_tracks.csv with its two meta files beside it."""
        from xosc_lateral.formats.importers.levelx import import_levelx
        from xosc_lateral.formats.importers.table import describe, write_imported

        imported = import_levelx(source, keep_cut=keep_cut)
        write_imported(imported, output)
        typer.echo(describe(imported.provenance, as_json=as_json), err=not as_json)

    @formats.command("mf4")
    def mf4(
        source: Source,
        output: Output,
        channels: Annotated[
            list[str] | None,
            typer.Option(
                "--map", metavar="NAME=CHANNEL[:UNIT]", help="Which channel is which column, e.g. speed=v_veh:km/h."
            ),
        ] = None,
        step: Annotated[
            float, typer.Option(help="Step of the table; channels are interpolated to it. [s]", min=0.001, max=1)
        ] = 0.04,
        as_json: AsJson = False,
    ) -> None:
        """ASAM MDF bus log (extra `mdf`): asks for a channel map, since no two cars name their signals alike."""
        from xosc_lateral.formats.importers.mf4 import channels_wanted, import_mf4
        from xosc_lateral.formats.importers.table import describe, write_imported

        if not channels:
            raise typer.BadParameter(channels_wanted(source), param_hint="--map")
        imported = import_mf4(source, channels, step=step)
        write_imported(imported, output)
        typer.echo(describe(imported.provenance, as_json=as_json), err=not as_json)

    app.add_typer(formats, name="import")
