"""`xosc-lateral close-loop`: what a profile fails to reproduce, traced, added and scored."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""

    @app.command("close-loop")
    def close_loop(
        tables: Annotated[
            list[Path], typer.Argument(metavar="TABLE...", help="Drive tables: .csv, .csv.gz, .parquet.")
        ],
        output: Annotated[Path, typer.Option("--output", "-o", metavar="REFINED.json", help="Profile to write.")],
        report: Annotated[Path, typer.Option(metavar="DIR", help="Folder for report.json and report.html.")],
        profile: Annotated[
            str | None, typer.Option("--profile", "-p", metavar="NAME|PATH", help="Start from it; else one is fitted.")
        ] = None,
        seed: Annotated[int, typer.Option(help="Same inputs and seed, same result.", min=0)] = 0,
        leave_out: Annotated[list[str] | None, typer.Option(metavar="COLUMN", help="Column not to look at.")] = None,
        columns: Annotated[
            list[str] | None,
            typer.Option("--map", metavar="NAME=COLUMN[:UNIT]", help="Foreign header, e.g. speed=v_kmh:km/h."),
        ] = None,
        library: Annotated[list[Path] | None, typer.Option(help="Folder with further profiles.")] = None,
        as_json: Annotated[bool, typer.Option("--json", help="Print report.json too.")] = False,
    ) -> None:
        """Find what measured drives do and a profile doesn't, trace it to an effect, add it, score it held out."""
        from xosc_lateral.driver.profile import Provenance
        from xosc_lateral.formats.atomic import refuse_targets
        from xosc_lateral.formats.drives import parse_map, read_drives
        from xosc_lateral.formats.hashes import file_hash
        from xosc_lateral.formats.profiles import read_profile, write_profile
        from xosc_lateral.loop.close import close_loop
        from xosc_lateral.loop.leftover import leftover_of
        from xosc_lateral.report.loop import loop_text, write_loop
        from xosc_lateral.report.loop_json import loop_json
        from xosc_lateral.report.progress import shown_progress

        refuse_targets([output, report / "report.json"], tables)
        drives = read_drives(tables, parse_map(columns or []))
        base = None if profile is None else read_profile(profile, library or [])
        known = Provenance(
            source=", ".join(table.name for table in tables),
            inputs={table.name: file_hash(table) for table in tables},
        )
        with shown_progress("closing the loop") as progress:
            result = close_loop(
                drives, base, seed=seed, name=output.stem, provenance=known, excluded=leave_out or [], progress=progress
            )
        write_profile(result.refined, output)
        leftover = leftover_of(result)
        write_loop(result, leftover, tables, report)
        typer.echo(loop_json(result, leftover, tables) if as_json else loop_text(result, leftover))
