"""`xosc-lateral fit`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from xosc_lateral.driver.kinds import ModelKind


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""

    @app.command()
    def fit(
        tables: Annotated[
            list[Path], typer.Argument(metavar="TABLE...", help="Drive tables: .csv, .csv.gz, .parquet.")
        ],
        output: Annotated[Path, typer.Option("--output", "-o", metavar="PROFILE.json", help="Profile to write.")],
        model: Annotated[ModelKind, typer.Option(help="two-level: the paper's; best: ours.")] = ModelKind.BEST,
        columns: Annotated[
            list[str] | None,
            typer.Option("--map", metavar="NAME=COLUMN[:UNIT]", help="Foreign header, e.g. speed=v_kmh:km/h."),
        ] = None,
        name: Annotated[str, typer.Option(help="Name of the profile; the file's where not given.")] = "",
        source: Annotated[str, typer.Option(help="The drives in words, for the provenance.")] = "",
        licence: Annotated[str, typer.Option(help="Of the drives, for the provenance.")] = "",
        as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
    ) -> None:
        """Fit a driver profile to measured drives."""
        from xosc_lateral.driver.fitting import fit_profile
        from xosc_lateral.driver.profile import Provenance
        from xosc_lateral.formats.atomic import refuse_targets
        from xosc_lateral.formats.drives import parse_map, read_drives
        from xosc_lateral.formats.hashes import file_hash
        from xosc_lateral.formats.profiles import describe_profile, write_profile

        refuse_targets([output], tables)
        drives = read_drives(tables, parse_map(columns or []))
        provenance = Provenance(
            source=source or ", ".join(table.name for table in tables),
            licence=licence,
            inputs={table.name: file_hash(table) for table in tables},
        )
        profile = fit_profile(drives, name=name or output.stem, model=model, provenance=provenance)
        write_profile(profile, output)
        typer.echo(describe_profile(profile, as_json=as_json), err=not as_json)
